"""The steps of a mapping run, kept within bounds.

A step is a frame that was mapped. Each is a few small files in a folder of its own: the picture,
what the frame saw, and how the map's objects differ from the step before; every so many steps,
all objects. When there are too many steps, every second one is dropped, and from then on only
every second frame is kept, then every fourth, and so on. So the folder does not grow forever,
however long the recording is.
"""

from __future__ import annotations

import json
from bisect import bisect_left, bisect_right
from collections import OrderedDict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hypermap.core.errors import HypermapError
from hypermap.viewer.live.json_text import json_bytes
from hypermap.viewer.watch.grids import GridPicture
from hypermap.viewer.watch.objects import (
    Difference,
    ObjectState,
    ObjectStates,
    change,
    changed_by,
    difference,
    merged,
)

MOST_STEPS = 4000
"""How many steps are kept at most."""
MOST_BYTES = 500_000_000
"""How much room their files may take."""

_WHOLE_EVERY = 50  # steps; so many differences are read at most to say how the objects were
_STATES_KEPT = 8  # of those requested


class NoSuchStep(HypermapError):
    """There is no step, or no picture, of that number."""


@dataclass(frozen=True)
class Step:
    """What is kept in memory of a step.

    Attributes:
        number: of its frame in the recording, from 1.
        stamp: time of the frame [s].
        position: where the camera stood [m].
        objects: how many the map had.
        grid: number of the step with the newest picture of the grid; None if there is none yet.
    """

    number: int
    stamp: float
    position: tuple[float, float]
    objects: int
    grid: int | None


class History:
    """The steps of a run in a folder; callers must synchronize threads.

    Attributes:
        steps: those that are kept, oldest first.
        stride: of so many mapped frames one is kept.
        thinned: how often every second step was dropped.
    """

    def __init__(
        self, folder: Path, most_steps: int = MOST_STEPS, most_bytes: int = MOST_BYTES
    ) -> None:
        """Prepare an empty history.

        Args:
            folder: for its files; an empty one.
            most_steps: how many are kept at most; two or more.
            most_bytes: how much room they may take; a bound for what is kept on, not for one step.
        """
        if most_steps < 2:
            raise ValueError(f"most_steps must be 2 or more, got {most_steps}")
        self.steps: list[Step] = []
        self.stride = 1
        self.thinned = 0
        self._folder = folder
        self._most_steps = most_steps
        self._most_bytes = most_bytes
        self._newest: ObjectStates = {}
        self._states: OrderedDict[int, ObjectStates] = OrderedDict()
        self._extents: dict[int, tuple[float, float, float, float]] = {}  # of the grids' pictures
        self._size = 0  # of all files [bytes]

    def add(
        self,
        number: int,
        observation: dict[str, Any],
        picture: bytes,
        objects: ObjectStates,
        grid: GridPicture | None,
    ) -> None:
        """Keep one more step.

        Args:
            number: of the frame in the recording; larger than that of the step before.
            observation: what the frame saw, from `describe_observation`.
            picture: JPEG.
            objects: the objects of the map after this frame.
            grid: the map's grid after this frame; None where there is no new picture of it.

        Raises:
            OSError: If it cannot be written.
        """
        newest = self.steps[-1].grid if self.steps else None
        if grid is not None:
            newest = self._write_grid(number, grid)
        self._write(f"{number}.jpg", picture)
        self._write_observation(number, observation, newest)
        self._write_objects(len(self.steps), number, self._newest, objects)
        place = (observation["camera"]["x"], observation["camera"]["y"])
        self.steps.append(Step(number, observation["stamp"], place, len(objects), newest))
        self._newest = objects
        if len(self.steps) >= self._most_steps or (
            self._size > self._most_bytes and len(self.steps) > 1
        ):
            self._thin()

    def renew_grid(self, grid: GridPicture) -> None:
        """Let the newest step show another picture of the grid.

        Raises:
            OSError: If it cannot be written.
        """
        step = self.steps[-1]
        number = self._write_grid(step.number, grid)
        self._write_observation(step.number, json.loads(self.observation(step.number)), number)
        self.steps[-1] = replace(step, grid=number)

    def number_at(self, number: int) -> int:
        """Return the number of the newest step that is not newer than a frame.

        Raises:
            NoSuchStep: If there is none.
        """
        return self.steps[self._position(number)].number

    def __contains__(self, number: int) -> bool:
        """Return whether there is a step of this number."""
        position = bisect_left(self.steps, number, key=_number_of)
        return position < len(self.steps) and self.steps[position].number == number

    def observation(self, number: int) -> bytes:
        """Return as JSON what the frame of a step saw.

        Raises:
            NoSuchStep: If there is no such step.
        """
        return self._read(f"{number}.json")

    def picture(self, number: int) -> bytes:
        """Return the camera's picture of a step as JPEG.

        Raises:
            NoSuchStep: If there is no such step.
        """
        return self._read(f"{number}.jpg")

    def grid(self, number: int) -> bytes:
        """Return the picture of the grid that was made at a step as PNG.

        Raises:
            NoSuchStep: If none was made there.
        """
        return self._read(f"{number}.png")

    def objects(self, number: int) -> ObjectStates:
        """Return the objects of the map at a step.

        Raises:
            NoSuchStep: If there is no step of that age.
        """
        last = self._position(number)
        kept = self._states.get(self.steps[last].number)
        if kept is None:
            kept = self._rebuilt(last)
            self._states[self.steps[last].number] = kept
            if len(self._states) > _STATES_KEPT:
                self._states.popitem(last=False)
        return kept

    def _position(self, number: int) -> int:
        position = bisect_right(self.steps, number, key=_number_of) - 1
        if position < 0:
            raise NoSuchStep(f"there is no step {number}")
        return position

    def _rebuilt(self, last: int) -> ObjectStates:
        """Return the objects at a position: from the nearest that are known, by the differences."""
        first = last
        while first % _WHOLE_EVERY and self.steps[first].number not in self._states:
            first -= 1
        number = self.steps[first].number
        objects = self._states.get(number)
        if objects is None:
            whole = json.loads(self._read(f"{number}.whole"))
            objects = {number: ObjectState(*columns) for number, *columns in whole}
        for step in self.steps[first + 1 : last + 1]:
            objects = changed_by(objects, json.loads(self._read(f"{step.number}.change")))
        return objects

    def _write_grid(self, number: int, grid: GridPicture) -> int:
        self._write(f"{number}.png", grid.content)
        self._extents[number] = grid.extent
        return number

    def _write_observation(
        self, number: int, observation: dict[str, Any], grid: int | None
    ) -> None:
        shown = None if grid is None else {"number": grid, "extent": list(self._extents[grid])}
        self._write(f"{number}.json", json_bytes({"number": number, **observation, "grid": shown}))

    def _write_objects(
        self, position: int, number: int, before: ObjectStates, after: ObjectStates
    ) -> None:
        """Write the objects at a position."""
        self._write(f"{number}.change", json_bytes(difference(before, after)))
        self._write_whole(position, number, after)

    def _write_whole(self, position: int, number: int, objects: ObjectStates) -> None:
        """Write all objects, if that is due at a position."""
        if position % _WHOLE_EVERY == 0:
            whole = [[id_, *thing] for id_, thing in sorted(objects.items())]
            self._write(f"{number}.whole", json_bytes(whole))

    def _thin(self) -> None:
        """Drop every second step; the newest stays."""
        kept: list[Step] = []
        dropped: Difference = {"set": [], "existence": [], "removed": []}
        objects: ObjectStates = {}
        for position, step in enumerate(self.steps):
            name = f"{step.number}.change"
            changes = merged(dropped, json.loads(self._read(name)))
            (self._folder / f"{step.number}.whole").unlink(missing_ok=True)
            if (len(self.steps) - 1 - position) % 2:
                dropped = changes
                for ending in ("change", "jpg", "json"):
                    (self._folder / f"{step.number}.{ending}").unlink(missing_ok=True)
                continue
            dropped = {"set": [], "existence": [], "removed": []}
            change(objects, changes)
            self._write(name, json_bytes(changes))
            self._write_whole(len(kept), step.number, objects)
            kept.append(step)
        self.steps = kept
        used = {step.grid for step in kept}
        for number in set(self._extents) - used:
            (self._folder / f"{number}.png").unlink(missing_ok=True)
            del self._extents[number]
        self._size = sum(path.stat().st_size for path in self._folder.iterdir())
        self.stride *= 2
        self.thinned += 1

    def _write(self, name: str, content: bytes) -> None:
        (self._folder / name).write_bytes(content)
        self._size += len(content)

    def _read(self, name: str) -> bytes:
        try:
            return (self._folder / name).read_bytes()
        except FileNotFoundError:
            raise NoSuchStep(f"there is no {name}") from None


def _number_of(step: Step) -> int:
    return step.number
