"""Samples in a ROS bag: numbers from a topic, and places from tf."""

from __future__ import annotations

import logging
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError, FrameError, HypermapError, did_you_mean
from hypermap.core.moving_frames import Chain, FixedPose, Motion, MovingFrames
from hypermap.recordings.bag.file import BagFile, DamagedMessage, Topic
from hypermap.recordings.bag.topics import TRANSFORMS, topics_of_tf
from hypermap.recordings.messages.header import as_seconds, clean_frame, nanoseconds
from hypermap.recordings.messages.transforms import TransformLog
from hypermap.recordings.samples.fields import reading_of
from hypermap.recordings.samples.measured import Measured, checked, sensor_positions

_log = logging.getLogger(__name__)

MAX_GAP = 1.0
"""Seconds between two poses across which none is interpolated."""


def read_bag(
    path: Path,
    topic: str,
    field: str | None = None,
    *,
    map_frame: str = "map",
    sensor_frame: str | None = None,
    censored_below: float | None = None,
    map_T_world: NDArray[np.float64] | None = None,
    max_gap: float = MAX_GAP,
    on_message: Callable[[], None] = lambda: None,
) -> Measured:
    """Return the numbers of a topic at the places where the sensor was.

    A sample's time is its header's stamp, or, without one, that of recording.

    Args:
        path: a ROS 1 or ROS 2 bag.
        topic: name of the topic.
        field: as `reading_of` takes it.
        map_frame: tf frame of the places.
        sensor_frame: frame of the sensor; None for that of each message's header, or `base_link`
            where there is none.
        censored_below: the limit below which nothing is heard; None where NaN says nothing.
        map_T_world: pose, (4, 4), of `map_frame` in the map, where it is not the map's own.
        max_gap: seconds between two poses across which none is interpolated.
        on_message: called after each message of the topic.

    Raises:
        FormatError: If the bag cannot be read, there is no such topic or field, or tf does not say
            where the sensor was.
    """
    bag = BagFile(path)
    for note in bag.cut_off:
        _log.warning("%s: %s", path, note)
    try:
        kind = _topic(bag, topic).type
        reading = reading_of(kind, field)
        log = _Log()
        tf = {one.name for one in topics_of_tf(bag.topics, topic)}
        for name, log_time, message in bag.messages({topic, *tf}, log.on_damaged, as_written=True):
            if name in tf:
                log.transforms.add(message, name.endswith("tf_static"), log_time)
                continue
            log.add(message, log_time, reading.read(message), sensor_frame)
            on_message()
        measured = checked(
            log.places(map_frame, max_gap, np.eye(4) if map_T_world is None else map_T_world),
            np.frombuffer(log.values),
            np.frombuffer(log.stamps),
            censored_below=censored_below,
            unit=reading.unit,
            quantity=reading.quantity,
        )
    except FormatError as error:
        if error.path is not None:
            raise
        raise FormatError(str(error), path=path) from None
    except HypermapError as error:
        raise FormatError(str(error), path=path, key=topic) from None
    if log.damaged:
        measured.left_out["in damaged messages"] = log.damaged
    return measured


def motion_in_bag(path: Path, map_frame: str, sensor_frame: str | None) -> Motion:
    """Return the motion of a sensor in the map, by a bag's tf; for the arguments see `read_bag`.

    Raises:
        FormatError: If the bag cannot be read, or tf does not say where the sensor was.
    """
    bag = BagFile(path)
    for note in bag.cut_off:
        _log.warning("%s: %s", path, note)
    log = TransformLog()
    for name, log_time, message in bag.messages(
        _transform_topics(bag), lambda *_: None, as_written=True
    ):
        log.add(message, name.endswith("tf_static"), log_time)
    try:
        return _motion(_tree(log, MAX_GAP), map_frame, clean_frame(sensor_frame or "base_link"))
    except HypermapError as error:
        raise FormatError(str(error), path=path) from None


def message_count(path: Path, topic: str) -> int:
    """Return how many messages a topic has.

    Raises:
        FormatError: If the bag cannot be read, or there are none on the topic.
    """
    return _topic(BagFile(path), topic).count


class _Log:
    """What a pass over a bag finds; a flat array for each column, as there may be very many."""

    def __init__(self) -> None:
        self.transforms = TransformLog()
        self.values, self.stamps = array("d"), array("d")
        self.damaged = 0
        self._frames: list[str] = []
        self._frame_of = array("q")

    def on_damaged(self, _: int, __: DamagedMessage) -> None:
        self.damaged += 1

    def add(self, message: Any, log_time: int, value: float, frame: str | None) -> None:
        header = getattr(message, "header", None)
        stamp = 0 if header is None else nanoseconds(header.stamp)
        named = "" if header is None else header.frame_id
        frame = clean_frame(frame or named or "base_link")
        if frame not in self._frames:
            self._frames.append(frame)
        self.values.append(value)
        self.stamps.append(as_seconds(stamp or log_time))
        self._frame_of.append(self._frames.index(frame))

    def places(
        self, map_frame: str, max_gap: float, map_T_world: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return where the sensor was at each sample, (N, 2); NaN if unknown."""
        stamps, frame_of = np.frombuffer(self.stamps), np.frombuffer(self._frame_of, np.int64)
        points = np.full((len(stamps), 2), np.nan)
        if len(stamps) == 0:
            raise HypermapError("no message can be read")
        tree = _tree(self.transforms, max_gap)
        for number, frame in enumerate(self._frames):
            here = frame_of == number
            motion = Chain((FixedPose(map_T_world), _motion(tree, map_frame, frame)))
            points[here] = sensor_positions(motion, stamps[here])
        return points


def _topic(bag: BagFile, name: str) -> Topic:
    found = next((topic for topic in bag.topics if topic.name == name and topic.count), None)
    if found is None:
        names = [topic.name for topic in bag.topics if topic.count]
        raise FormatError(
            f"there are no messages on topic {name!r} (--topic); {did_you_mean(name, names)}",
            path=bag.path,
        )
    return found


def _transform_topics(bag: BagFile) -> set[str]:
    return {topic.name for topic in bag.topics if topic.type in TRANSFORMS}


def _tree(log: TransformLog, max_gap: float) -> MovingFrames:
    tree, _ = log.frames(max_gap)
    if not tree.frames:
        raise HypermapError(
            "there is no tf, so the poses of the sensor are unknown; record /tf and /tf_static"
        )
    return tree


def _motion(tree: MovingFrames, map_frame: str, frame: str) -> Motion:
    for name, option in ((frame, "--sensor-frame"), (clean_frame(map_frame), "--map-frame")):
        if name not in tree.frames:
            known = ", ".join(tree.frames)
            raise HypermapError(f"tf has no frame {name!r}; it has {known}; name one with {option}")
    try:
        return tree.motion(clean_frame(map_frame), frame)
    except FrameError as error:
        raise HypermapError(f"tf has no pose of the sensor: {error}") from None
