"""Maps for Foxglove and Lichtblick: as a file `.mcap`, or live over a WebSocket."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hypermap.core.errors import HypermapError, MissingExtra
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.mapping.mapper import MappedFrame
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.viewer.logs.images import jpeg, millimeters
from hypermap.viewer.logs.scene import (
    MapScene,
    SceneShapes,
    Surface,
    class_rgb,
    seen_area,
    seen_shapes,
)
from hypermap.web.gate import Gate, hidden_address

try:
    import foxglove
    from foxglove import channels
    from foxglove import messages as fox
except ImportError:
    raise MissingExtra("a log for Foxglove", "foxglove") from None

_CAMERA = "camera"  # frame of the camera's optical axes
_LINE, _OUTLINE = 2.0, 1.5  # pixels
_NAME_SIZE = 14.0  # pixels
_LIFT = 0.1  # meters by which names are above their shapes
_GREY = fox.Color(r=0.6, g=0.6, b=0.6, a=1.0)
_INK = fox.Color(r=0.1, g=0.1, b=0.1, a=1.0)
_WHITE = fox.Color(r=1.0, g=1.0, b=1.0, a=0.8)
_BYTE = fox.PackedElementFieldNumericType.Uint8
_LIST = fox.LinePrimitiveLineType.LineList
_STRIP = fox.LinePrimitiveLineType.LineStrip
_NANOSECONDS = 1_000_000_000


class FoxgloveLog:
    """A map, and how it is made, as Foxglove's own messages; no website reads along.

    Topics are `/map/LAYER`, `/tf`, `/camera/calibration`, `/camera/color`, `/camera/depth`,
    `/camera/detections` and `/seen`, what the camera's last frame says about the floor. What
    never changes has the time 0.
    """

    def __init__(
        self, path: Path | None, name: str, frame_id: str = "map", port: int = 8765
    ) -> None:
        """Begin a log.

        Args:
            path: the file to write; None to be a WebSocket server on this machine.
            name: what the apps call the server.
            frame_id: frame of the cameras' poses.
            port: of the server; 0 for any that is free.

        Raises:
            HypermapError: If the file cannot be written, or the port is in use.
        """
        self._frame_id = frame_id
        self._context = foxglove.Context()
        self._channels: dict[str, Any] = {}
        self._sink: Any
        self._gate: Gate | None = None
        try:
            if path is None:
                hidden = hidden_address()
                self._sink = foxglove.start_server(
                    name=name, host=hidden, port=0, context=self._context
                )
                self._gate = Gate("127.0.0.1", port, (hidden, self._sink.port))
            else:
                self._sink = foxglove.open_mcap(path, allow_overwrite=True, context=self._context)
        except (OSError, RuntimeError) as error:
            where = f"port {port}" if path is None else path
            raise HypermapError(f"{where}: cannot log there: {error}") from None
        self.url = None if self._gate is None else f"ws://127.0.0.1:{self._gate.port}"

    def add_map(self, hypermap: Hypermap, stamp: float | None = None) -> None:
        """Log some or all layers of a map as they are at a time; None if they never change."""
        scene = MapScene.of(hypermap)
        for surface in scene.surfaces:
            self._log(f"/map/{surface.layer}", _grid(surface, scene.base_frame, stamp), stamp)
        for shapes in scene.shapes:
            entities = [_entity(shapes, scene.base_frame, stamp)]
            self._log(f"/map/{shapes.layer}", fox.SceneUpdate(entities=entities), stamp)
        if scene.frames:
            frames = [_planar(scene.base_frame, f, pose, stamp) for f, pose in scene.frames.items()]
            self._log("/tf", fox.FrameTransforms(transforms=frames), stamp)

    def add_frame(self, mapped: MappedFrame) -> None:
        """Log what the camera saw, from where, and what that says about the floor."""
        frame, stamp = mapped.frame, mapped.frame.stamp
        pose = _spatial(self._frame_id, _CAMERA, frame.map_T_camera, stamp)
        self._log("/tf", fox.FrameTransforms(transforms=[pose]), stamp)
        self._log("/camera/calibration", _calibration(frame), stamp)
        if frame.color is not None:
            color = fox.CompressedImage(
                timestamp=_time(stamp), frame_id=_CAMERA, data=jpeg(frame.color), format="jpeg"
            )
            self._log("/camera/color", color, stamp)
        self._log("/camera/depth", _depth_image(frame), stamp)
        self._log("/camera/detections", _annotations(mapped.detections, stamp), stamp)
        seen = _entity(seen_shapes(mapped.observation), self._frame_id, stamp)
        area = fox.SceneEntity(
            timestamp=_time(stamp),
            frame_id=self._frame_id,
            id="area",
            lines=[
                fox.LinePrimitive(
                    type=_STRIP,
                    thickness=_LINE,
                    scale_invariant=True,
                    points=_points(seen_area(mapped.observation)),
                    color=_GREY,
                )
            ],
        )
        self._log("/seen", fox.SceneUpdate(entities=[seen, area]), stamp)

    def close(self) -> None:
        """Finish the file, or end the server."""
        if self._gate is None:
            self._sink.close()
        else:
            self._sink.stop()
            self._gate.close()

    def _log(self, topic: str, message: Any, stamp: float | None) -> None:
        if topic not in self._channels:
            channel = getattr(channels, f"{type(message).__name__}Channel")
            self._channels[topic] = channel(topic, context=self._context)
        self._channels[topic].log(message, log_time=round((stamp or 0.0) * _NANOSECONDS))


def _calibration(frame: RgbdFrame) -> fox.CameraCalibration:
    camera = frame.camera
    return fox.CameraCalibration(
        timestamp=_time(frame.stamp),
        frame_id=_CAMERA,
        width=camera.width,
        height=camera.height,
        K=camera.K.ravel().tolist(),
        R=np.eye(3).ravel().tolist(),
        P=np.column_stack([camera.K, np.zeros(3)]).ravel().tolist(),
    )


def _depth_image(frame: RgbdFrame) -> fox.RawImage:
    """Return the depth in whole millimeters."""
    return fox.RawImage(
        timestamp=_time(frame.stamp),
        frame_id=_CAMERA,
        width=frame.camera.width,
        height=frame.camera.height,
        encoding="16UC1",
        step=2 * frame.camera.width,
        data=millimeters(frame.depth).astype("<u2").tobytes(),
    )


def _time(stamp: float | None) -> fox.Timestamp:
    seconds, nanoseconds = divmod(round((stamp or 0.0) * _NANOSECONDS), _NANOSECONDS)
    return fox.Timestamp(seconds, nanoseconds)


def _grid(surface: Surface, frame_id: str, stamp: float | None) -> fox.Grid:
    width = surface.rgba.shape[1]
    colors = ("red", "green", "blue", "alpha")
    return fox.Grid(
        timestamp=_time(stamp),
        frame_id=frame_id,
        pose=fox.Pose(
            position=fox.Vector3(x=surface.pose.x, y=surface.pose.y, z=surface.z),
            orientation=_quaternion(Rotation.from_euler("z", surface.pose.yaw)),
        ),
        column_count=width,
        cell_size=fox.Vector2(x=surface.resolution, y=surface.resolution),
        row_stride=4 * width,
        cell_stride=4,
        fields=[
            fox.PackedElementField(name=color, offset=offset, type=_BYTE)
            for offset, color in enumerate(colors)
        ],
        data=np.ascontiguousarray(surface.rgba).tobytes(),
    )


def _entity(shapes: SceneShapes, frame_id: str, stamp: float | None) -> fox.SceneEntity:
    """Return shapes as one entity, which takes the place of the one before it."""
    fills = fox.TriangleListPrimitive(
        points=_points(shapes.corners), colors=[_color(*rgba) for rgba in shapes.corner_colors]
    )
    lines = fox.LinePrimitive(
        type=_LIST,
        thickness=_OUTLINE,
        scale_invariant=True,
        points=_points(shapes.segments.reshape(-1, 3)),
        colors=[_color(*rgb) for rgb in np.repeat(shapes.segment_colors, 2, axis=0)],
    )
    names = [
        fox.TextPrimitive(
            pose=fox.Pose(position=fox.Vector3(x=float(x), y=float(y), z=float(z) + _LIFT)),
            billboard=True,
            font_size=_NAME_SIZE,
            scale_invariant=True,
            color=_INK,
            text=str(name),
        )
        for name, (x, y, z) in zip(shapes.names, shapes.places, strict=True)
    ]
    return fox.SceneEntity(
        timestamp=_time(stamp),
        frame_id=frame_id,
        id=shapes.layer,
        triangles=[fills],
        lines=[lines],
        texts=names,
    )


def _annotations(found: Detections, stamp: float) -> fox.ImageAnnotations:
    """Return boxes with names and scores on the camera's image."""
    time, boxes, texts = _time(stamp), [], []
    for box, name, score, rgb in zip(
        found.xyxy.tolist(), found.names, found.scores, class_rgb(found.names), strict=True
    ):
        xmin, ymin, xmax, ymax = box
        corners = [(xmin, ymin), (xmax, ymin), (xmax, ymax), (xmin, ymax)]
        boxes.append(
            fox.PointsAnnotation(
                timestamp=time,
                type=fox.PointsAnnotationType.LineLoop,
                points=[fox.Point2(x=x, y=y) for x, y in corners],
                outline_color=_color(*rgb),
                thickness=_LINE,
            )
        )
        texts.append(
            fox.TextAnnotation(
                timestamp=time,
                position=fox.Point2(x=xmin, y=ymin),
                text=f"{name} {score:.2f}",
                font_size=_NAME_SIZE,
                text_color=_color(*rgb),
                background_color=_WHITE,
            )
        )
    return fox.ImageAnnotations(timestamp=time, points=boxes, texts=texts)


def _points(points_xyz: NDArray[np.float32]) -> list[fox.Point3]:
    return [fox.Point3(x=x, y=y, z=z) for x, y, z in points_xyz.tolist()]


def _color(red: int, green: int, blue: int, alpha: int = 255) -> fox.Color:
    return fox.Color(r=red / 255, g=green / 255, b=blue / 255, a=alpha / 255)


def _planar(parent: str, child: str, pose: Pose2D, stamp: float | None) -> fox.FrameTransform:
    matrix = np.eye(4)
    matrix[:2, 3] = pose.x, pose.y
    matrix[:3, :3] = Rotation.from_euler("z", pose.yaw).as_matrix()
    return _spatial(parent, child, matrix, stamp)


def _spatial(
    parent: str, child: str, parent_T_child: NDArray[np.float64], stamp: float | None
) -> fox.FrameTransform:
    x, y, z = parent_T_child[:3, 3].tolist()
    return fox.FrameTransform(
        timestamp=_time(stamp),
        parent_frame_id=parent,
        child_frame_id=child,
        translation=fox.Vector3(x=x, y=y, z=z),
        rotation=_quaternion(Rotation.from_matrix(parent_T_child[:3, :3])),
    )


def _quaternion(rotation: Rotation) -> fox.Quaternion:
    x, y, z, w = rotation.as_quat().tolist()
    return fox.Quaternion(x=x, y=y, z=z, w=w)
