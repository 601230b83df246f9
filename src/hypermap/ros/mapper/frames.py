"""Messages that belong together become frames."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.pose_convention import optical_offset, optical_poses
from hypermap.perception.rectification import Rectification
from hypermap.perception.registration import Registration
from hypermap.perception.turning import turned
from hypermap.recordings.messages.camera import camera_of_info, rectification_of_info
from hypermap.recordings.messages.clouds import fit_camera, points_of_cloud
from hypermap.recordings.messages.compressed_depth import depth_of_compressed
from hypermap.recordings.messages.header import as_seconds, clean_frame
from hypermap.recordings.messages.images import (
    color_of_compressed,
    color_of_image,
    depth_of_image,
)
from hypermap.ros.mapper.settings import CLOUD, COMPRESSED, LiveSettings
from hypermap.ros.mapper.synchronizer import MatchedMessages
from hypermap.ros.port import Level


class FrameMaker:
    """Makes frames of messages; only what mapping needs is decoded.

    Attributes:
        camera_info: the last `sensor_msgs/CameraInfo`; None while there was none.
        color_info: that of the color images, where depth is to be registered to them.

    Args:
        settings: of the node.
        log: takes a level and a line for the node's log.
    """

    def __init__(self, settings: LiveSettings, log: Callable[[Level, str], None]) -> None:
        self.camera_info: Any = None
        self.color_info: Any = None
        self._settings, self._log = settings, log
        self._fitted: Camera | None = None
        self._said: set[str] = set()

    @property
    def lacks_camera_info(self) -> bool:
        """Whether the intrinsics are not known yet."""
        lacks_color = bool(self._settings.color_info_topic) and self.color_info is None
        return lacks_color or (bool(self._settings.info_topic) and self.camera_info is None)

    def frame_id(self, geometry: Any) -> str:
        """Return the optical frame of a depth message."""
        return clean_frame(self._settings.camera_frame or geometry.header.frame_id)

    def frame(
        self,
        match: MatchedMessages,
        geometry: Any,
        map_T_camera: NDArray[np.float64],
        color_T_depth: NDArray[np.float64] | None = None,
    ) -> RgbdFrame:
        """Return a frame.

        Args:
            match: color and detections, and the stamps of all.
            geometry: the depth image or cloud.
            map_T_camera: pose of its frame as tf says, shape (4, 4).
            color_T_depth: its pose in the color camera's frame as tf says, if depth is to be
                registered to color; else None.

        Raises:
            FormatError: If a message is damaged, or they do not fit each other.
        """
        convention = self._settings.pose_convention
        map_T_camera = optical_poses(map_T_camera, convention)
        depth, cloud, color = self._geometry(geometry)
        depth, camera, rectification = self._rectified(depth, cloud)
        if color_T_depth is not None:
            pose = optical_offset(color_T_depth, convention)
            color_camera, rectification = self._color_camera(match.items["color"])
            registration = Registration(color_camera, pose)
            depth, map_T_camera = registration.depth(depth, camera), registration.pose(map_T_camera)
            camera = color_camera
        if "color" in match.items and self._settings.detector:
            message = match.items["color"]
            is_compressed = self._settings.color_type == COMPRESSED
            color = (color_of_compressed if is_compressed else color_of_image)(message)
        if color is not None and color.shape[:2] != depth.shape:
            raise FormatError(
                f"color images have {color.shape[1]} x {color.shape[0]} pixels, but depth has "
                f"{depth.shape[1]} x {depth.shape[0]}; take depth that is registered to color"
            )
        if self._settings.detector and color is None:
            raise FormatError("the clouds have no color for the detector; give color_topic")
        detections: Detections | None = match.items.get("detections")
        if rectification is not None:
            color = None if color is None else rectification.color(color)
            detections = None if detections is None else rectification.detections(detections)
        frame = RgbdFrame(
            stamp=as_seconds(match.stamp),
            depth=depth,
            camera=camera,
            map_T_camera=map_T_camera,
            color=color,
            color_stamp=as_seconds(match.stamps.get("color", match.stamp)),
            detections=detections,
            cloud=cloud,
        )
        return turned(frame, self._settings.rotate)

    def _rectified(
        self, depth: NDArray[np.float32], cloud: NDArray[np.float32] | None
    ) -> tuple[NDArray[np.float32], Camera, Rectification | None]:
        """Return rectified depth, its camera, and how color that goes with it is to be rectified.

        Raises:
            FormatError: If the camera info does not fit the depth.
        """
        settings, camera = self._settings, self._camera(depth, cloud)
        if cloud is not None:
            return depth, camera, None
        size = camera.width, camera.height
        of_depth, of_color = (
            self._rectification(self.camera_info, size, is_rectified)
            for is_rectified in (settings.is_rectified, settings.is_color_rectified)
        )
        if of_depth is None:
            return depth, camera, of_color
        return of_depth.depth(depth), of_depth.camera, of_color

    def _color_camera(self, color: Any) -> tuple[Camera, Rectification | None]:
        """Return the camera of a color image, once it is rectified, and how to do that.

        If the image is compressed, only the camera info has its size.

        Raises:
            FormatError: If that says nothing of use.
        """
        info, is_rectified = self.color_info, self._settings.is_color_rectified
        size = getattr(color, "width", info.width), getattr(color, "height", info.height)
        found = self._rectification(info, size, is_rectified)
        return (camera_of_info(info, *size, is_rectified) if found is None else found.camera), found

    def _rectification(
        self, info: Any, size: tuple[int, int], is_rectified: bool
    ) -> Rectification | None:
        """Return how to rectify images; what is to be said of it is logged once."""
        found, said = rectification_of_info(info, *size, is_rectified)
        if said and said not in self._said:
            self._said.add(said)
            self._log("warning" if found is None else "info", said)
        return found

    def _geometry(
        self, message: Any
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None, NDArray[np.uint8] | None]:
        """Return depth, cloud and color of a message, the latter two where it has them."""
        if self._settings.geometry_type == CLOUD:
            points, color = points_of_cloud(message)
            return points[..., 2].copy(), points, color
        is_compressed = self._settings.geometry_type == COMPRESSED
        decode = depth_of_compressed if is_compressed else depth_of_image
        return decode(message, self._settings.depth_scale), None, None

    def _camera(self, depth: NDArray[np.float32], cloud: NDArray[np.float32] | None) -> Camera:
        height, width = depth.shape
        if self.camera_info is not None:
            return camera_of_info(self.camera_info, width, height, self._settings.is_rectified)
        fitted = self._fitted
        if fitted is None or (fitted.width, fitted.height) != (width, height):
            fitted = self._fitted = fit_camera(cloud)  # type: ignore[arg-type] # it is a cloud
        return fitted
