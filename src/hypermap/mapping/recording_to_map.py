"""The map of a whole recording: frame by frame, without unusable ones."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.counts import Counts
from hypermap.mapping.mapper import BadFrame, MappedFrame, Mapper
from hypermap.mapping.perceived import Perceived, Perceiver
from hypermap.mapping.preflight import Preflight
from hypermap.mapping.same_place import PlaceCheck
from hypermap.perception.embedders.embedder import Embedder
from hypermap.perception.frame import DetectionSource, RgbdFrame
from hypermap.perception.recording import Recording
from hypermap.text import counted

MAX_BAD = 0.5
"""Share of a recording's frames that may fail before mapping gives up."""
_MAX_FAILED_FIRST = 100  # frames that may fail before the first usable one
_COUNTED_EVERY = (
    20  # frames; to count objects, those of earlier drives are compared with all of this one
)


@dataclass(frozen=True)
class Progress:
    """The progress of mapping.

    Attributes:
        done: frames so far.
        total: frames of the recording, at most.
        objects: objects in the map so far.
        counts: frame counts so far.
    """

    done: int
    total: int
    objects: int
    counts: Counts


class Ahead(Protocol):
    """Perceives the frames of a recording before they are mapped."""

    def begin(self, mapper: Mapper) -> None:
        """Perceive frames with the settings of this mapper."""

    def perceive(self, frame: RgbdFrame, perceiver: Perceiver) -> Perceived:
        """Return what a frame shows; see `Mapper.perceive`."""
        ...


def map_recording(
    recording: Recording,
    source: DetectionSource | None,
    config: MappingConfig,
    occupancy: OccupancyLayer | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    watch: Callable[[MappedFrame, Mapper], None] | None = None,
    preflight: Preflight | None = None,
    max_bad: float = MAX_BAD,
    onto: Hypermap | None = None,
    embedder: Embedder | None = None,
    ahead: Ahead | None = None,
    same_place: bool = False,
    prepare: Callable[[Mapper], None] | None = None,
) -> Hypermap:
    """Return the map of a recording.

    To stop early and keep the map so far, as the command line does on Ctrl-C, pass a recording
    whose `frames` end early, or call `Mapper` in your own loop.

    Frames that cannot be read, and those for which the source of detections fails, are skipped,
    counted and logged.

    Args:
        recording: where the frames come from.
        source: returns the detections of a frame; None for a map without objects.
        config: the settings.
        occupancy: the map's first layer, instead of the recording's own map or one made from
            depth.
        on_progress: called after each frame.
        watch: called after each mapped frame.
        preflight: checks whether the recording meets the assumptions of mapping, such as a level
            floor at z = 0; by default problems are logged.
        max_bad: share of the recording's frames that may fail; 0 stops at the first.
        onto: a map to continue, as by `Mapper.onto`; its occupancy layer is continued, too, and
            that of the recording ignored.
        embedder: encodes what frames show of objects; None for no embeddings.
        ahead: perceives the frames of this recording before they are mapped.
        same_place: whether it is known that the poses are in the frame of `onto`, by whatever name;
            otherwise what the frames show is compared with it.
        prepare: called with the mapper before the first frame.

    Raises:
        OtherPlace: If the recording does not show the place of `onto`.
        HypermapError: If the recording or the source fails too often, no frame is usable, or
            mapping cannot continue the map.
        ValueError: If both `occupancy` and `onto` are given.
    """
    mapper = _mapper_for(recording, source, config, occupancy, onto, same_place)
    mapper.watch = watch
    mapper.embed_with(embedder)
    if ahead is not None:
        mapper.perceive = ahead.perceive
        ahead.begin(mapper)
    if onto is not None and not same_place:
        cameras_xy = mapper.logged_poses()[1][:, :2, 3]
        layer = mapper.occupancy().name
        mapper.place = PlaceCheck(onto, mapper.config.occupancy, layer, cameras_xy)
    if prepare is not None:
        prepare(mapper)
    preflight = preflight or Preflight(max_depth=config.perception.max_depth)
    bad = _BadFrames(mapper, recording, max_bad)
    objects = 0
    for frame in recording.frames(bad.add):
        unusable = mapper.counts.unusable
        try:
            is_mapped = mapper.add(frame) is not None
        except BadFrame as error:
            bad.add(frame.stamp, error)
            is_mapped = False
        if mapper.place is not None:
            mapper.place.check(recording.path.name)
        if mapper.counts.unusable == unusable:
            preflight.add(frame)
        if is_mapped:
            preflight.add_mapped(frame)
        if on_progress is not None:
            counts = mapper.counts
            if onto is None or counts.frames % _COUNTED_EVERY == 1:
                objects = len(mapper.evidence)
            on_progress(Progress(counts.frames, len(recording), objects, counts))
    bad.finish()
    if mapper.place is not None:
        mapper.place.check(recording.path.name, is_last=True)
    mapper.intake.tell_left_out()
    preflight.finish()
    hypermap = mapper.hypermap()
    hypermap.metadata["recording"] = _name_of(recording)
    return hypermap


def _name_of(recording: Recording) -> str:
    """Return its name, with a replacement character for what is not Unicode in its path."""
    return os.fsencode(recording.path.name).decode(errors="replace")


def _mapper_for(
    recording: Recording,
    source: DetectionSource | None,
    config: MappingConfig,
    occupancy: OccupancyLayer | None,
    onto: Hypermap | None,
    same_place: bool,
) -> Mapper:
    """Return a mapper for a new map, or to continue one."""
    name = _name_of(recording)
    if onto is None:
        occupancy = recording.occupancy() if occupancy is None else occupancy
        return Mapper(config, source, occupancy, recording.frame_id, name)
    if occupancy is not None:
        raise ValueError("a map to continue already has an occupancy layer")
    frame_id = None if same_place else recording.frame_id
    return Mapper.onto(onto, source, config, name, frame_id)


class _BadFrames:
    """Counts the frames of a recording that fail, and gives up if there are too many."""

    def __init__(self, mapper: Mapper, recording: Recording, most: float) -> None:
        self._mapper = mapper
        self._recording = recording
        self._most = most
        self._count = 0

    def add(self, stamp: float, error: HypermapError) -> None:
        """Count a frame.

        Raises:
            HypermapError: If there are too many.
        """
        if self._most == 0:
            raise error
        self._count += 1
        self._mapper.intake.leave_out(stamp, str(error))
        total, used = len(self._recording), self._mapper.counts.used
        if self._count > self._most * total or (used == 0 and self._count >= _MAX_FAILED_FIRST):
            raise HypermapError(
                f"{self._recording.path}: {self._count} of {counted(total, 'frame')} cannot be "
                f"used, which is too many; the first one: {self._mapper.intake.first_reason}"
            )

    def finish(self) -> None:
        """Check that a frame was mapped.

        Raises:
            HypermapError: If none was.
        """
        counts = self._mapper.counts
        if counts.used == counts.repeated == 0:
            reason = self._mapper.intake.first_reason
            why = f"; the first one: {reason}" if reason else ""
            raise HypermapError(
                f"{self._recording.path}: nothing to map: no frame of {counts.frames} "
                f"can be used{why}"
            )
