"""The results of a first pass over a bag: times, transforms and detections, but no images."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.perception.detections import Detections
from hypermap.recordings.bag.file import BagFile
from hypermap.recordings.bag.topics import ChosenTopics
from hypermap.recordings.messages.detections import detections_of
from hypermap.recordings.messages.header import as_seconds, clean_frame, nanoseconds
from hypermap.recordings.messages.transforms import TransformLog

_FIRSTS = 5  # messages of a topic used to find the size of its images


@dataclass(eq=False)
class ImageStream:
    """The times of the images of a topic.

    Attributes:
        firsts: its first messages, one of which may be damaged.
        stamps: the messages' stamps [ns], each once, in the order of recording.
        repeated: number of messages skipped because of a repeated stamp.
    """

    firsts: list[Any] = field(default_factory=list)
    stamps: dict[int, None] = field(default_factory=dict)
    repeated: int = 0

    def add(self, message: Any, stamp: int) -> None:
        """Count a message."""
        if len(self.firsts) < _FIRSTS:
            self.firsts.append(message)
        self.repeated += stamp in self.stamps
        self.stamps[stamp] = None

    @property
    def frame_id(self) -> str:
        """The frame of its first message; empty if it names none, or there is no message."""
        return clean_frame(self.firsts[0].header.frame_id) if self.firsts else ""

    def seconds(self) -> NDArray[np.float64]:
        """Return the stamps in seconds, shape (N,)."""
        return seconds(self.stamps)


@dataclass(eq=False)
class Contents:
    """The contents of a bag, before its images are read.

    Attributes:
        geometry: depth images or clouds.
        color: color images.
        camera_info: the first message of the intrinsics.
        color_info: the same for the color images, if depth is to be registered to them.
        transforms: all of tf.
        detections: by the stamp of the image [ns].
        damaged: messages that cannot be decoded, by their times of recording [ns].
    """

    geometry: ImageStream = field(default_factory=ImageStream)
    color: ImageStream = field(default_factory=ImageStream)
    camera_info: Any = None
    color_info: Any = None
    transforms: TransformLog = field(default_factory=TransformLog)
    detections: dict[int, Detections] = field(default_factory=dict)
    damaged: list[tuple[int, FormatError]] = field(default_factory=list)


def read_contents(bag: BagFile, topics: ChosenTopics) -> Contents:
    """Return what a pass over the bag finds; of images, it reads only the stamps.

    Raises:
        FormatError: If the bag cannot be read.
    """
    contents = Contents()
    transforms = {topic.name for topic in topics.transforms}
    single = (topics.geometry, topics.color, topics.camera_info, topics.detections)
    geometry, color, info, detections = (topic.name if topic else None for topic in single)
    color_info = topics.color_info.name if topics.color_info else None
    names = transforms | {name for name in (geometry, color, info, color_info, detections) if name}

    def on_damaged(log_time: int, error: FormatError) -> None:
        damaged = FormatError(str(error), path=bag.path)
        damaged.key = error.key  # its text already names the old one
        contents.damaged.append((log_time, damaged))

    for name, log_time, message in bag.messages(names, on_damaged, as_written=True):
        if name in transforms:
            contents.transforms.add(
                message, is_static=name.endswith("tf_static"), log_time=log_time
            )
        elif name == geometry:
            contents.geometry.add(message, stamp_of(message, log_time))
        elif name == color:
            contents.color.add(message, stamp_of(message, log_time))
        elif name in (info, color_info):
            if name == info and contents.camera_info is None:
                contents.camera_info = message
            if name == color_info and contents.color_info is None:
                contents.color_info = message
        elif name == detections:
            stamp, found = _detections(name, message)
            contents.detections[stamp] = found
    return contents


def stamp_of(message: Any, log_time: int) -> int:
    """Return a message's stamp [ns], or the time of recording if the stamp is zero."""
    return nanoseconds(message.header.stamp) or log_time


def seconds(stamps: dict[int, Any]) -> NDArray[np.float64]:
    """Return the keys of a dictionary, given in nanoseconds, in seconds, shape (N,)."""
    return np.array([as_seconds(stamp) for stamp in stamps])


def _detections(topic: str, message: Any) -> tuple[int, Detections]:
    try:
        return detections_of(message)
    except (FormatError, AttributeError, ValueError) as error:
        raise FormatError(f"the detections cannot be read: {error}", key=topic) from None
