"""Plans the frames of a bag, and lists what is missing for them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError, FrameError
from hypermap.core.moving_frames import Motion
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera
from hypermap.perception.pose_convention import optical_offset
from hypermap.recordings.bag.camera_motion import CameraMotion
from hypermap.recordings.bag.contents import Contents, seconds
from hypermap.recordings.bag.decode import (
    Geometry,
    check_color,
    decode_color,
    decode_geometry,
)
from hypermap.recordings.bag.file import Topic
from hypermap.recordings.bag.topics import ChosenTopics
from hypermap.recordings.messages.camera import camera_of_info, rectification_of_info
from hypermap.recordings.messages.clouds import fit_camera
from hypermap.recordings.messages.header import as_seconds
from hypermap.recordings.messages.topic_names import names_rectified
from hypermap.recordings.options import RecordingOptions
from hypermap.recordings.pairing import FramePlan, associate, plan_frames
from hypermap.recordings.problems import problems_of
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.perception.rectification import Rectification
    from hypermap.perception.registration import Registration

DEPTH_SCALE = 1000.0  # units per meter, REP 118
_Image = TypeVar("_Image", Geometry, NDArray[np.uint8])


class BagPlan:
    """Combines the results of the first pass over a bag.

    Every property raises a FormatError if something that it needs is missing; `problems` lists all.
    """

    def __init__(self, topics: ChosenTopics, contents: Contents, options: RecordingOptions) -> None:
        self._topics = topics
        self._contents = contents
        self._options = options
        self._camera_motion = CameraMotion(contents, options)

    def problems(self) -> list[str]:
        """Return a sentence for everything missing without which there are no frames."""
        needs = ("geometry_topic", "camera", "motion", "frames", "color_topic", "registration")
        return problems_of(self, *needs)

    def notes(self) -> list[str]:
        """Return sentences on what was skipped, assumed or chosen, for a plan without problems."""
        contents = self._contents
        notes = [*self._topics.notes, *self.map_frame_notes, *self.left_out()]
        if self.damaged:
            count, (_, first) = len(self.damaged), self.damaged[0]
            notes.append(f"messages that cannot be read: {count}, the first: {first}")
        is_elsewhere = contents.color.frame_id != contents.geometry.frame_id
        if self.color_topic and is_elsewhere and self.registration is None:
            notes.append(
                f"color comes from frame {contents.color.frame_id!r}, depth from "
                f"{contents.geometry.frame_id!r}: if the driver has not registered them, objects "
                "are cut out next to where they are (--register)"
            )
        notes += dict.fromkeys(said for _, said in (self._rectified, self._color_rectified) if said)
        return [*notes, *self._notes_on_detections()] if self._topics.detections else notes

    def _notes_on_detections(self) -> list[str]:
        matched = sum(found is not None for found in self.detections)
        notes = [f"recorded detections in {matched} of {counted(len(self.frames), 'frame')}"]
        stamps = self._contents.detections.keys()
        if matched and self.color_topic and not stamps & self._contents.color.stamps.keys():
            notes.append(
                "no recorded detections have exactly the stamp of a color image: if they were "
                "stamped after the image, objects are next to where they are"
            )
        names = [name for found in self.detections if found is not None for name in found.names]
        if names and all(name.isdigit() for name in names):
            notes.append("the recorded detections name classes by number, and so will the map")
        return notes

    def left_out(self) -> list[str]:
        """Return sentences on parts of the bag that can be read, but give no frame."""
        where = self._camera_motion
        notes = [*where.left_out, *self.frames.notes, *where.least_known(), *where.leaps()]
        if repeated := self._contents.geometry.repeated + self._contents.color.repeated:
            notes.append(f"{counted(repeated, 'image')} left out: with the stamp of another")
        return notes

    def detections_elsewhere(self) -> list[str]:
        """Return a sentence if there are recorded detections, but none of any frame."""
        topic = self._topics.detections
        if topic is None or any(found is not None for found in self.detections):
            return []
        limit = self._options.max_time_difference
        return [
            f"none of the recorded detections on {topic.name} has the stamp of a frame's image, or "
            f"one up to {limit:g} s beside it (--max-time-difference): record them with the stamp "
            "of the image in which they were detected, or give --detector"
        ]

    @property
    def damaged(self) -> list[tuple[int, FormatError]]:
        """Messages that cannot be decoded, by their times of recording [ns]."""
        return self._contents.damaged

    @cached_property
    def geometry_topic(self) -> Topic:
        """The topic of depth images or clouds."""
        if self._topics.geometry is not None and not self._contents.geometry.firsts:
            for _, error in self.damaged[:1]:
                raise error
        if self._topics.geometry is None or not self._contents.geometry.firsts:
            raise FormatError(
                "there are no depth images (sensor_msgs/Image with 'depth' in the topic's name, or "
                "compressedDepth) and no clouds; name the topic with --depth-topic if it is there, "
                "or record it"
            )
        return self._topics.geometry

    @cached_property
    def color_topic(self) -> Topic | None:
        """The topic of the color images; None if there is none, or clouds have color."""
        if self._topics.color is None or self._first.color is not None:
            return None
        topic = self._topics.color
        if not self._contents.color.firsts:  # there are some, but none can be read
            for _, error in self.damaged:
                if error.key == topic.name:
                    raise error
            return None
        if not self._options.register:
            check_color(self._first_color, self._first.size, topic, self.geometry_topic)
        return topic

    @cached_property
    def _first_color(self) -> NDArray[np.uint8]:
        """One of the first color images, of the most common size."""
        topic = self._topics.color
        if topic is None:
            raise FormatError("there are no color images")
        colors = _readable(partial(decode_color, topic), self._contents.color.firsts)
        return _usual(colors, lambda color: color.shape)

    @property
    def has_color(self) -> bool:
        """Whether the frames have color."""
        return self.color_topic is not None or self._first.color is not None

    @property
    def depth_scale(self) -> float:
        """Units of integer depth per meter."""
        return self._options.depth_scale or DEPTH_SCALE

    @cached_property
    def camera(self) -> Camera:
        """The intrinsics: from the user, the camera info, or fitted to a cloud."""
        width, height = self._first.size
        given = self._options.camera(width, height)
        if given is not None:
            return given
        if self._first.cloud is not None:
            return fit_camera(self._first.cloud)
        if self._contents.camera_info is None:
            raise FormatError(
                "there is no camera info (sensor_msgs/CameraInfo) for the depth images; "
                "record it, or give --intrinsics"
            )
        if self.rectification is not None:
            return self.rectification.camera
        return camera_of_info(self._contents.camera_info, width, height, self._is_rectified)

    @property
    def rectification(self) -> Rectification | None:
        """How to rectify depth images; None where there is nothing to do."""
        return self._rectified[0]

    @property
    def color_rectification(self) -> Rectification | None:
        """How to rectify color images, and what was detected in them; None for not at all."""
        return self._color_rectified[0]

    @property
    def frame_camera(self) -> Camera:
        """The camera of the frames: the color camera where depth is registered to it."""
        return self.camera if self.registration is None else self.registration.camera

    @cached_property
    def registration(self) -> Registration | None:
        """The registration of depth to color; None unless requested."""
        if not self._options.register:
            return None
        if self.color_topic is None:
            raise FormatError(
                "depth cannot be registered to color (--register): there are no color images, or "
                "clouds that have color already"
            )
        from hypermap.perception.registration import Registration

        height, width, _ = self._first_color.shape
        camera = self._options.color_camera(width, height)
        if self.color_rectification is not None:
            camera = self.color_rectification.camera
        if camera is None:
            if self._contents.color_info is None:
                raise FormatError(
                    "there is no camera info for the color images, which --register needs; "
                    "record it, or give --color-intrinsics"
                )
            is_rectified = names_rectified(self.color_topic.name)
            camera = camera_of_info(self._contents.color_info, width, height, is_rectified)
        return Registration(camera, self._depth_pose())

    def _depth_pose(self) -> NDArray[np.float64]:
        """Return `color_T_depth`, the pose of the depth camera in the color camera, (4, 4)."""
        if self._options.color_T_depth is not None:
            return self._options.depth_pose()
        color_frame = self._contents.color.frame_id
        try:
            pose = self._camera_motion.pose_in(color_frame)
            return optical_offset(pose, self._options.pose_convention)
        except FrameError as error:
            raise FormatError(
                f"tf has no transform to the color camera ({color_frame!r}), to which depth is to "
                f"be registered (--register): {error}; give --depth-transform"
            ) from None

    @cached_property
    def motion(self) -> Motion:
        """The motion of the camera in the map."""
        self._camera_motion.check_recorded()  # which is said also if there are no images
        _ = self.geometry_topic
        return self._camera_motion.motion

    @property
    def map_frame(self) -> str:
        """The frame of the map: from the user, or `map`, or else the root above the camera."""
        return self._camera_motion.map_frame

    @property
    def map_frame_notes(self) -> list[str]:
        """A sentence on the map's frame, if the user gave none and it is not `map`."""
        return self._camera_motion.map_frame_notes

    @cached_property
    def frames(self) -> FramePlan:
        """Which images form a frame, and their poses."""
        color = self._contents.color.seconds() if self.color_topic else None
        depth, span = self._contents.geometry.seconds(), self._contents.transforms.span()
        motion = self.motion
        try:
            return plan_frames(depth, color, motion, span, self._options)
        except FormatError as error:
            where = self._camera_motion
            said = [str(error), *where.left_out, *where.least_known()]
            raise FormatError("; ".join(said)) from None

    @cached_property
    def stamps(self) -> list[tuple[int, ...]]:
        """For each frame the stamps of its messages [ns]: geometry, and color if from a topic."""
        geometry, color = list(self._contents.geometry.stamps), list(self._contents.color.stamps)
        pairs = zip(self.frames.depth, self.frames.color, strict=True)
        return [(geometry[g], color[c]) if c >= 0 else (geometry[g],) for g, c in pairs]

    @cached_property
    def detections(self) -> list[Detections | None]:
        """The recorded detections of each frame, matched by the stamp of the color image."""
        found = self._contents.detections
        matched: list[Detections | None] = [None] * len(self.frames)
        image_stamps = np.array([as_seconds(stamps[-1]) for stamps in self.stamps])
        in_order = list(found.values())
        pairs = associate(image_stamps, seconds(found), self._options.max_time_difference)
        for frame, detections in zip(*pairs, strict=True):
            matched[frame] = in_order[detections]
        return matched

    @cached_property
    def _first(self) -> Geometry:
        """One of the first depth images or clouds, of the most common size."""
        topic, scale = self.geometry_topic, self.depth_scale
        read = partial(decode_geometry, topic, units_per_meter=scale)
        return _usual(_readable(read, self._contents.geometry.firsts), lambda found: found.size)

    @cached_property
    def _rectified(self) -> tuple[Rectification | None, str]:
        """How to rectify depth images, and what is to be said of it."""
        return self._by_depth_info(self._is_rectified)

    @cached_property
    def _color_rectified(self) -> tuple[Rectification | None, str]:
        """How to rectify color images, and what is to be said of it."""
        topic, info = self._topics.color, self._contents.color_info
        is_rectified = self._is_rectified if topic is None else names_rectified(topic.name)
        if not self._options.register:
            return self._by_depth_info(is_rectified)
        if info is None or self._options.color_intrinsics is not None:
            return None, ""
        height, width, _ = self._first_color.shape
        return rectification_of_info(info, width, height, is_rectified)

    def _by_depth_info(self, is_rectified: bool) -> tuple[Rectification | None, str]:
        """Return how to rectify images of the depth camera, or those to which it is registered."""
        info = self._contents.camera_info
        if info is None or self._options.intrinsics is not None or self._first.cloud is not None:
            return None, ""
        return rectification_of_info(info, *self._first.size, is_rectified)

    @property
    def _is_rectified(self) -> bool:
        return names_rectified(self.geometry_topic.name)


def _readable(read: Callable[[Any], _Image], messages: Sequence[Any]) -> list[_Image]:
    """Return the content of those messages that are not damaged.

    Raises:
        FormatError: If all are damaged; describes the first.
    """
    good: list[_Image] = []
    first: FormatError | None = None
    for message in messages:
        try:
            good.append(read(message))
        except FormatError as error:  # noqa: PERF203
            first = first or error
    if not good and first is not None:
        raise first
    return good


def _usual(images: Sequence[_Image], size_of: Callable[[_Image], Any]) -> _Image:
    """Return the first image of the most common size."""
    (size, _), *_others = Counter(map(size_of, images)).most_common()
    return next(image for image in images if size_of(image) == size)
