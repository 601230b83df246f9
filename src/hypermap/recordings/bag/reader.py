"""Makes a frame of its messages in a bag, in this process or in another one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.turning import turned
from hypermap.recordings.bag.decode import (
    Geometry,
    check_color,
    check_depth,
    decode_color,
    decode_geometry,
)
from hypermap.recordings.bag.file import Topic
from hypermap.recordings.messages.header import as_seconds

if TYPE_CHECKING:
    from hypermap.perception.rectification import Rectification
    from hypermap.perception.registration import Registration
    from hypermap.recordings.bag.plan import BagPlan


@dataclass(frozen=True, eq=False)
class FrameMessages:
    """What a bag contains of one frame.

    Attributes:
        messages: one for each topic of the reader.
        stamps: of these messages [ns].
        map_T_camera: pose of the camera whose depth was recorded, shape (4, 4).
        detections: those recorded with the frame; None if there are none.
    """

    messages: tuple[Any, ...]
    stamps: tuple[int, ...]
    map_T_camera: NDArray[np.float64]
    detections: Detections | None

    def __getstate__(self) -> dict[str, Any]:  # to travel from one process to another
        # Another process does not know the classes that were made of the bag's definitions.
        return {**vars(self), "messages": tuple(map(_plain, self.messages))}


@dataclass(frozen=True, eq=False)
class MessageReader:
    """Decodes the messages of frames.

    Attributes:
        path: of the bag.
        topics: that of the depth images or clouds, and that of color images if they have their own.
        camera: of the depth images.
        units_per_meter: of integer depth.
        rectification: of the depth images; None if there is nothing to do.
        color_rectification: of the color images and what was detected in them, likewise.
        registration: of depth to color; None unless requested.
        rotate: degrees by which to rotate the images clockwise.
    """

    path: Path
    topics: tuple[Topic, ...]
    camera: Camera
    units_per_meter: float
    rectification: Rectification | None
    color_rectification: Rectification | None
    registration: Registration | None
    rotate: int

    @classmethod
    def of(cls, path: Path, plan: BagPlan, rotate: int) -> MessageReader:
        """Return the reader of the frames of a plan."""
        topics = tuple(topic for topic in (plan.geometry_topic, plan.color_topic) if topic)
        return cls(
            path,
            topics,
            plan.camera,
            plan.depth_scale,
            plan.rectification,
            plan.color_rectification,
            plan.registration,
            rotate,
        )

    def pose(self, parts: FrameMessages) -> NDArray[np.float64]:
        """Return `map_T_camera` of a frame, shape (4, 4), before its images are rotated."""
        pose = parts.map_T_camera
        return pose if self.registration is None else self.registration.pose(pose)

    def frame(self, parts: FrameMessages) -> RgbdFrame:
        """Return a frame.

        Raises:
            FormatError: If its depth is damaged, or of another size.
        """
        geometry = self._geometry(parts)
        color: NDArray[np.uint8] | Callable[[], NDArray[np.uint8]] | None = geometry.color
        if len(self.topics) > 1:
            color = partial(self._color, parts)
        if self.registration is not None:
            depth = self.registration.depth(geometry.depth, self.camera, geometry.cloud)
            geometry = Geometry(depth)
        frame = RgbdFrame(
            stamp=as_seconds(parts.stamps[0]),
            depth=geometry.depth,
            camera=self._frame_camera,
            map_T_camera=self.pose(parts),
            color=color,
            color_stamp=None if color is None else as_seconds(parts.stamps[-1]),
            detections=self._detections(parts),
            cloud=geometry.cloud,
        )
        return turned(frame, self.rotate)

    @property
    def _frame_camera(self) -> Camera:
        return self.camera if self.registration is None else self.registration.camera

    def _geometry(self, parts: FrameMessages) -> Geometry:
        with self._naming(parts.stamps[0]):
            geometry = decode_geometry(self.topics[0], parts.messages[0], self.units_per_meter)
            check_depth(geometry, self.camera)
        if self.rectification is not None:
            return Geometry(self.rectification.depth(geometry.depth))
        return geometry

    def _color(self, parts: FrameMessages) -> NDArray[np.uint8]:
        with self._naming(parts.stamps[0]):
            color = decode_color(self.topics[1], parts.messages[1])
            size = self._frame_camera.width, self._frame_camera.height
            check_color(color, size, self.topics[1], self.topics[0])
        rectification = self.color_rectification
        return color if rectification is None else rectification.color(color)

    def _detections(self, parts: FrameMessages) -> Detections | None:
        found, rectification = parts.detections, self.color_rectification
        if found is None or rectification is None:
            return found
        return rectification.detections(found)

    @contextmanager
    def _naming(self, stamp: int) -> Iterator[None]:
        """Add the position in the bag to an error."""
        try:
            yield
        except FormatError as error:
            names = " and ".join(topic.name for topic in self.topics)
            key = f"{names} at {as_seconds(stamp):.3f} s"
            raise FormatError(str(error), path=self.path, key=key) from None


def _plain(value: Any) -> Any:
    """Return a message, or a part of one, as objects that every process knows."""
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if fields := getattr(value, "__dataclass_fields__", None):
        return SimpleNamespace(**{name: _plain(getattr(value, name)) for name in fields})
    return value
