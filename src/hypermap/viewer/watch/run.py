"""A mapping run that is recorded for the page: its history, its state, and updates of both."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Literal, NamedTuple

from hypermap.colors import class_colors
from hypermap.core.occupancy import OccupancyLayer
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.counts import Counts
from hypermap.mapping.mapper import MappedFrame, Mapper
from hypermap.mapping.recording_to_map import Progress
from hypermap.viewer.live.description import hex_color
from hypermap.viewer.live.json_text import json_bytes
from hypermap.viewer.watch.grids import GridPictures
from hypermap.viewer.watch.history import MOST_BYTES, MOST_STEPS, History
from hypermap.viewer.watch.objects import ObjectsNow, ObjectStates, difference
from hypermap.viewer.watch.observation import describe_observation
from hypermap.viewer.watch.picture import picture_of

_log = logging.getLogger(__name__)

State = Literal["mapping", "saved", "failed"]


class ClientState(NamedTuple):
    """What a window knows of a run so far.

    Attributes:
        event_count: the last event that it knows.
        steps: how many steps it knows.
        thinned: how often steps had been dropped.
        colors: for how many classes it knows the color.
    """

    event_count: int = -1
    steps: int = 0
    thinned: int = 0
    colors: int = 0


class WatchedRun:
    """A mapping run, recorded step by step; thread-safe.

    `watch` and `progress` are for `map_recording`, which calls them.

    Attributes:
        recording: name of what is mapped.
        output: name of the map that is made.
        event_count: grows with every event.
    """

    def __init__(
        self,
        folder: Path,
        recording: str,
        output: str,
        total: int,
        most_steps: int = MOST_STEPS,
        most_bytes: int = MOST_BYTES,
    ) -> None:
        """Prepare for a run.

        Args:
            folder: an empty one, for the history.
            recording: name of what is mapped.
            output: name of the map that is made.
            total: frames of the recording, at most.
            most_steps: how many steps are kept at most.
            most_bytes: how much room they may take.
        """
        self.recording = recording
        self.output = output
        self.event_count = 0
        self._history = History(folder, most_steps, most_bytes)
        self._lock = threading.Lock()
        self._grids = GridPictures()
        self._total, self._done, self._objects, self._counts = total, 0, 0, Counts()
        self._state: State = "mapping"
        self._message = ""
        self._map_url: str | None = None
        self._is_kept = True
        self._colors: dict[str, str] = {}
        self._objects_now = ObjectsNow()
        self._since_kept = 0
        self._last: tuple[MappedFrame, Mapper] | None = None
        # Pictures are made next to the mapper, one frame behind it.
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="run")
        self._work: Future[None] | None = None

    # Called by the mapper

    def watch(self, seen: MappedFrame, mapper: Mapper) -> None:
        """Keep what a frame saw, or every n-th frame of a long run."""
        self._await_work()
        self._since_kept += 1
        self._last = seen, mapper
        if self._since_kept >= self._history.stride:
            self._keep()

    def progress(self, progress: Progress) -> None:
        """Take over how far mapping has come."""
        with self._lock:
            self._done, self._objects = progress.done, progress.objects
            self._counts = progress.counts
            self.event_count += 1

    def finish(self, message: str, map_url: str | None = None) -> None:
        """Take over that the map is saved.

        Args:
            message: says so, and where.
            map_url: address of the page that shows the map, if there is one.
        """
        self._await_work()
        self._keep(is_last=True)
        self._await_work()
        self._map_url = map_url
        self._end("saved", message)

    def fail(self, message: str) -> None:
        """Take over why there is no map."""
        self._end("failed", message)

    def close(self) -> None:
        """End the work in the background."""
        self._worker.shutdown()

    # Called for windows

    def update_for(self, client: ClientState) -> tuple[dict[str, Any], ClientState]:
        """Return what is new for a window, and its state afterward."""
        with self._lock:
            steps, thinned = self._history.steps, self._history.thinned
            first = client.steps if client.thinned == thinned else 0
            update: dict[str, Any] = {
                "state": self._state,
                "message": self._message,
                "map_url": self._map_url,
                "total": self._total,
                "done": self._done,
                "objects": self._objects,
                "counts": self._counts.as_metadata(),
                "stride": self._history.stride,
                "steps": {
                    "first": first,
                    "numbers": [step.number for step in steps[first:]],
                    "stamps": [step.stamp for step in steps[first:]],
                    "places": [step.position for step in steps[first:]],
                    "objects": [step.objects for step in steps[first:]],
                },
            }
            if client.colors != len(self._colors):
                update["colors"] = dict(self._colors)
            return update, ClientState(self.event_count, len(steps), thinned, len(self._colors))

    def step(self, number: int, since: int | None) -> bytes:
        """Return a step as JSON: what its frame saw, and the objects of the map then.

        Args:
            number: of the step; of those that were dropped, the one before answers.
            since: number of another step; the objects come as the difference to that, and if it
                is no longer there, as the difference to none. The answer says which.

        Raises:
            NoSuchStep: If there is no step that old.
        """
        with self._lock:
            number = self._history.number_at(number)
            since = since if since is not None and since in self._history else None
            before = {} if since is None else self._history.objects(since)
            changes = difference(before, self._history.objects(number))
            objects = json_bytes({"since": since, **changes})
            return b'{"observation":%b,"objects":%b}' % (self._history.observation(number), objects)

    def picture(self, number: int) -> bytes:
        """Return the camera's picture of a step as JPEG.

        Raises:
            NoSuchStep: If there is no such step.
        """
        with self._lock:
            return self._history.picture(number)

    def grid(self, number: int) -> bytes:
        """Return a picture of the grid as PNG.

        Raises:
            NoSuchStep: If none was made at that step.
        """
        with self._lock:
            return self._history.grid(number)

    # Parts of the above

    def _keep(self, is_last: bool = False) -> None:
        """Keep the last frame that was seen; if it is kept already, the present grid."""
        if self._last is None or not self._is_kept:
            return
        seen, mapper = self._last
        grid = self._grids.due(mapper.occupancy, at_once=is_last)
        is_new = self._since_kept > 0
        if is_new:  # what the mapper changes next is taken now
            self._objects_now.look(mapper.evidence)
            self._since_kept = 0
        number = mapper.counts.frames if is_new else None
        self._work = self._worker.submit(
            self._write, seen, mapper.config, number, self._objects_now.states, grid
        )

    def _write(
        self,
        seen: MappedFrame,
        config: MappingConfig,
        number: int | None,
        things: ObjectStates,
        grid: OccupancyLayer | None,
    ) -> None:
        """Write a step of this number; with None, the newest one's grid."""
        try:
            drawn = None if grid is None else self._grids.draw(grid)
            if number is None:
                if drawn is not None:
                    with self._lock:
                        self._history.renew_grid(drawn)
                return
            picture = picture_of(seen.frame)
            observation = describe_observation(seen, picture, config)
            with self._lock:
                self._color([*seen.detections.names, *(thing.name for thing in things.values())])
                self._history.add(number, observation, picture.content, things, drawn)
                self.event_count += 1
        except OSError as error:
            self._is_kept = False
            _log.warning("the rest of the run cannot be recorded: %s", error)
            with self._lock:
                self._message = f"the rest of the run cannot be recorded: {error.strerror}"
                self.event_count += 1

    def _await_work(self) -> None:
        if self._work is not None:
            self._work.result()

    def _color(self, names: Iterable[str]) -> None:
        """Give every class that was ever seen a color."""
        known = {*self._colors, *map(str, names)}
        if len(known) > len(self._colors):
            colors = class_colors(known)
            self._colors = {name: hex_color(color) for name, color in sorted(colors.items())}

    def _end(self, state: State, message: str) -> None:
        with self._lock:
            self._state, self._message = state, message
            self.event_count += 1
