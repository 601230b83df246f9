"""ROS bags as recordings."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path

from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.recording import (
    OnBadFrame,
    PendingFrame,
    RecordingInfo,
    Stream,
    or_report,
)
from hypermap.recordings.bag.contents import read_contents
from hypermap.recordings.bag.file import BagFile
from hypermap.recordings.bag.parts import first_part
from hypermap.recordings.bag.plan import BagPlan
from hypermap.recordings.bag.reader import FrameMessages, MessageReader
from hypermap.recordings.bag.stream import stream_frames
from hypermap.recordings.bag.topics import (
    COMPRESSED,
    IMAGE,
    ChosenTopics,
    choose_topics,
    may_hold_depth,
)
from hypermap.recordings.messages.compressed_depth import is_png
from hypermap.recordings.messages.header import as_seconds
from hypermap.recordings.messages.images import DEPTH_ENCODINGS
from hypermap.recordings.messages.occupancy import occupancy_of_grid
from hypermap.recordings.options import RecordingOptions

_log = logging.getLogger(__name__)


class BagRecording:
    """A ROS 1 or ROS 2 bag with depth images or organized clouds, and tf up to the map.

    A first pass over the bag reads times, tf and detections, and plans the frames. `frames` is
    a second pass, which keeps only a few messages at a time.
    """

    def __init__(self, path: Path, options: RecordingOptions) -> None:
        self._path = path
        self._options = options
        self._bag = BagFile(path)
        self._has_warned = False  # once is enough where the poses are corrected in a pass before

    @property
    def path(self) -> Path:
        """The bag."""
        return self._path

    @property
    def frame_id(self) -> str:
        """The tf frame of the map."""
        return self._plan.map_frame

    def __len__(self) -> int:
        """Return the number of frames.

        Raises:
            FormatError: If something that mapping needs is missing or broken.
        """
        self._require_no_problems()
        return len(self._plan.frames)

    def frames(self, on_bad: OnBadFrame | None = None) -> Iterator[RgbdFrame]:
        """Yield the frames in order of time; see `Recording.frames`.

        Raises:
            FormatError: If something that mapping needs is missing or broken.
        """
        for pending in self.pending(on_bad):
            if (frame := or_report(pending.load, pending.stamp, on_bad)) is not None:
                yield frame

    def pending(self, on_bad: OnBadFrame | None = None) -> Iterator[PendingFrame]:
        """Yield the frames before they are decoded; see `PendingRecording.pending`.

        Raises:
            FormatError: If something that mapping needs is missing or broken.
        """
        self._require_no_problems()
        plan = self._plan
        notes = (
            ()
            if self._has_warned
            else (*self._bag.cut_off, *plan.map_frame_notes, *plan.left_out())
        )
        for note in notes:
            _log.warning("%s: %s", self._path, note)
        self._has_warned = True
        for log_time, damage in plan.damaged:
            if on_bad is None:
                raise damage
            on_bad(as_seconds(log_time), damage)
        reader = MessageReader.of(self._path, plan, self._options.rotate)
        names = [topic.name for topic in reader.topics]
        for i, messages in enumerate(stream_frames(self._bag, names, plan.stamps)):
            parts = FrameMessages(
                tuple(messages), plan.stamps[i], plan.frames.map_T_camera[i], plan.detections[i]
            )
            pose = reader.pose(parts)
            yield PendingFrame(as_seconds(parts.stamps[0]), pose, partial(reader.frame, parts))

    def info(self) -> RecordingInfo:
        """Return what is in the bag and what is missing."""
        missing: list[str] = []
        notes: list[str] = []
        streams: tuple[Stream, ...] = ()
        frames, duration, image_size = 0, 0.0, None
        try:
            streams = self._streams(ChosenTopics())
            notes += self._bag.cut_off
            streams = self._streams(self._topics)
            missing += self._problems()
            if not missing:
                plan = self._plan
                frames = len(plan.frames)
                duration = as_seconds(plan.stamps[-1][0] - plan.stamps[0][0])
                image_size = self._options.turned_size(plan.frame_camera)
                notes += plan.notes()
                if not plan.has_color and self._topics.detections is None:
                    missing.append(
                        "there are neither color images nor recorded detections, and so no "
                        "objects; name one with --color-topic or --detections-topic if it is there"
                    )
                missing += plan.detections_elsewhere()
            notes += self._occupancy_note()
        except HypermapError as error:
            missing.append(str(error))
        return RecordingInfo(
            self._path,
            self._bag.format,
            duration,
            frames,
            image_size,
            streams,
            tuple(missing),
            tuple(notes),
        )

    def occupancy(self) -> OccupancyLayer | None:
        """Return the last occupancy map recorded, if there is one in the map frame.

        Raises:
            FormatError: If the map is broken.
        """
        topic, last = self._topics.occupancy, None
        if topic is None or self._options.map_T_world is not None:
            return None
        for _, _, message in self._bag.messages([topic.name]):
            last = message
        try:
            layer = occupancy_of_grid(last)
        except FormatError as error:
            raise FormatError(str(error), path=self._path, key=topic.name) from None
        return layer if layer.frame_id == self._plan.map_frame else None

    def _occupancy_note(self) -> list[str]:
        if self._topics.occupancy is None:
            return []
        name = self._topics.occupancy.name
        try:
            usable = self.occupancy() is not None
        except FormatError as error:
            return [str(error)]
        if usable:
            return []
        if self._options.map_T_world is not None:
            return [
                f"the map on {name} is left out, because the world is moved (--world-transform)"
            ]
        return [f"the map on {name} is left out: it is not in frame {self._plan.map_frame!r}"]

    def _streams(self, chosen: ChosenTopics) -> tuple[Stream, ...]:
        return tuple(
            Stream(topic.name, topic.type, topic.count, chosen.use_of(topic))
            for topic in self._bag.topics
        )

    def _require_no_problems(self) -> None:
        if problems := self._problems():
            raise FormatError("\n".join(problems), path=self._path)

    def _problems(self) -> list[str]:
        problems = self._plan.problems()
        first = first_part(self._path) if problems else None
        if first is not None:
            problems.append(
                f"if this is a part of the bag that begins with {first.name}, give a folder with "
                "these parts alone: only the first one has /tf_static and other latched messages"
            )
        return problems

    @cached_property
    def _topics(self) -> ChosenTopics:
        topics = self._bag.topics
        try:
            chosen = choose_topics(topics, self._options)
            if chosen.geometry is None and (found := self._depth_by_encoding()):
                name, encoding = found
                chosen = choose_topics(topics, replace(self._options, depth_topic=name))
                note = f"{name} is taken as depth, because of its encoding {encoding}"
                chosen = replace(chosen, notes=(note, *chosen.notes))
            return chosen
        except FormatError as error:
            raise FormatError(str(error), path=self._path) from None

    def _depth_by_encoding(self) -> tuple[str, str] | None:
        """Return the first topic whose first image is depth, as of OAK-D's stereo, and how.

        Or one of PNGs of depth, as of the Kinect 2.
        """
        for topic in filter(may_hold_depth, self._bag.topics):
            for _, _, message in self._bag.messages([topic.name], on_damaged=lambda *_: None):
                if topic.type == COMPRESSED and is_png(message):
                    return topic.name, message.format.strip()
                if topic.type == IMAGE and message.encoding in DEPTH_ENCODINGS:
                    return topic.name, message.encoding
                break
        return None

    @cached_property
    def _plan(self) -> BagPlan:
        return BagPlan(self._topics, read_contents(self._bag, self._topics), self._options)
