"""Maps for Rerun: as a file `.rrd`, or live in its viewer."""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path
from uuid import NAMESPACE_URL, uuid4, uuid5

import numpy as np

from hypermap.core.errors import HypermapError, MissingExtra
from hypermap.core.hypermap import Hypermap
from hypermap.mapping.mapper import MappedFrame
from hypermap.viewer.logs.images import MILLIMETRES, jpeg, millimeters
from hypermap.viewer.logs.scene import (
    MapScene,
    SceneShapes,
    Surface,
    class_rgb,
    seen_area,
    seen_shapes,
)

try:
    import rerun
    import rerun.blueprint as layout
except ImportError:
    raise MissingExtra("a log for Rerun", "rerun") from None

_STALLED = 15.0  # seconds in which a file that is being written grows
_WALL_CLOCK = 1e8  # seconds; smaller stamps count from the start of a recording
_LINE, _THIN_LINE, _POINT = 0.012, 0.006, 0.015  # radii [m]
_GREY = (150, 150, 150)


class RerunLog:
    """A map, and how it is made, as Rerun's entities.

    They are `map/LAYER`, `map/frames/NAME`, `camera` and what is on its images, and `seen`, what
    the camera's last frame says about the floor. Times are on the timeline `stamp`.
    """

    def __init__(self, path: Path | None, name: str) -> None:
        """Begin a log.

        Args:
            path: the file to write; None to start Rerun's viewer and show everything there.
            name: what the viewer calls it.

        Raises:
            HypermapError: If the file cannot be written, or the viewer cannot be started.
        """
        recording_id = uuid4() if path is None else uuid5(NAMESPACE_URL, f"hypermap:{name}")
        self._log = rerun.RecordingStream("hypermap", recording_id=recording_id)
        self._path = path
        self._has_camera = False
        try:
            if path is None:
                _find_viewer_of_this_environment()
                self._log.spawn()
            else:
                self._log.save(path)
        except (OSError, RuntimeError) as error:
            where = "Rerun's viewer" if path is None else path
            raise HypermapError(f"{where}: cannot log there: {error}") from None
        self._log.send_recording_name(name)
        self._log.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def add_map(self, hypermap: Hypermap, stamp: float | None = None) -> None:
        """Log some or all layers of a map as they are at a time; None if they never change."""
        self._set_time(stamp)
        scene, is_static = MapScene.of(hypermap), stamp is None
        if is_static and not self._has_camera and (bounds := scene.bounds()) is not None:
            self._log.send_blueprint(_map_alone(bounds))
        for surface in scene.surfaces:
            self._log.log(["map", surface.layer], _grid_map(surface), static=is_static)
        for shapes in scene.shapes:
            self._add_shapes(["map", shapes.layer], shapes, is_static)
        for frame, pose in scene.frames.items():
            turned = rerun.RotationAxisAngle([0, 0, 1], radians=pose.yaw)
            place = rerun.Transform3D(translation=[pose.x, pose.y, 0], rotation=turned)
            axes = rerun.TransformAxes3D(0.5)
            self._log.log(["map", "frames", frame], place, axes, static=True)

    def add_frame(self, mapped: MappedFrame) -> None:
        """Log what the camera saw, from where, and what that says about the floor."""
        if not self._has_camera:
            self._has_camera = True
            self._log.send_blueprint(_map_beside_camera(mapped.frame.color is not None))
        frame, camera, pose = mapped.frame, mapped.frame.camera, mapped.frame.map_T_camera
        self._set_time(frame.stamp)
        self._log.log("camera", rerun.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        pinhole = rerun.Pinhole(
            image_from_camera=camera.K,
            resolution=[camera.width, camera.height],
            camera_xyz=rerun.ViewCoordinates.RDF,
            image_plane_distance=0.3,
        )
        self._log.log("camera/image", pinhole)
        if frame.color is not None:
            color = rerun.EncodedImage(contents=jpeg(frame.color), media_type="image/jpeg")
            self._log.log("camera/image/color", color)
        depth = rerun.DepthImage(millimeters(frame.depth), meter=MILLIMETRES)
        self._log.log("camera/image/depth", depth)
        found = mapped.detections
        boxes = rerun.Boxes2D(
            array=found.xyxy,
            array_format=rerun.Box2DFormat.XYXY,
            labels=[f"{n} {s:.2f}" for n, s in zip(found.names, found.scores, strict=True)],
            colors=class_rgb(found.names),
        )
        self._log.log("camera/image/detections", boxes)
        self._add_shapes(["seen", "objects"], seen_shapes(mapped.observation), False)
        area = rerun.LineStrips3D([seen_area(mapped.observation)], colors=[_GREY], radii=_LINE)
        self._log.log("seen/area", area)

    def close(self) -> None:
        """Finish the file, or hand the remaining data over to the viewer.

        Raises:
            RuntimeError: If not all could be written.
        """
        try:
            self._flush()
        except RuntimeError:
            # After a write that failed, Rerun may wait for good, also when the stream goes or
            # Python ends. So it never goes.
            rerun.unregister_shutdown()
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._log))
            raise
        self._log.disconnect()

    def _flush(self) -> None:
        """Wait until all is written; where a file does not grow meanwhile, not for good."""
        if self._path is None:
            self._log.flush()
            return
        while True:
            size = self._path.stat().st_size
            try:
                self._log.flush(timeout_sec=_STALLED)
                return
            except RuntimeError:
                if self._path.stat().st_size == size:
                    raise

    def _set_time(self, stamp: float | None) -> None:
        if stamp is not None and stamp > _WALL_CLOCK:
            self._log.set_time("stamp", timestamp=stamp)
        elif stamp is not None:
            self._log.set_time("stamp", duration=stamp)

    def _add_shapes(self, path: list[object], shapes: SceneShapes, is_static: bool) -> None:
        """Log shapes; those that were there before are gone."""
        fills = rerun.Mesh3D(vertex_positions=shapes.corners, vertex_colors=shapes.corner_colors)
        lines = rerun.LineStrips3D(shapes.segments, colors=shapes.segment_colors, radii=_THIN_LINE)
        names = rerun.Points3D(
            shapes.places,
            labels=[str(name) for name in shapes.names],
            colors=shapes.colors,
            radii=_POINT,
        )
        self._log.log([*path, "fills"], fills, static=is_static)
        self._log.log([*path, "outlines"], lines, static=is_static)
        self._log.log([*path, "names"], names, static=is_static)


def _find_viewer_of_this_environment() -> None:
    """Let the viewer that came with the SDK be found where the environment is not activated."""
    programs, path = Path(sys.executable).parent, os.environ.get("PATH", "")
    os.environ["PATH"] = f"{programs}{os.pathsep}{path}"


def _grid_map(surface: Surface) -> rerun.GridMap:
    height, width = surface.rgba.shape[:2]
    pose, rgb = surface.pose, surface.rgba[::-1, :, :3]  # images begin at the top
    return rerun.GridMap(
        data=np.ascontiguousarray(rgb).tobytes(),
        format=rerun.components.ImageFormat(
            width=width, height=height, color_model="RGB", channel_datatype="U8"
        ),
        cell_size=surface.resolution,
        translation=[pose.x, pose.y, surface.z],
        rotation_axis_angle=rerun.RotationAxisAngle([0, 0, 1], radians=pose.yaw),
    )


def _map_alone(bounds: tuple[float, float, float, float]) -> layout.Blueprint:
    """Return a view of the whole map from above and a little from the south."""
    xmin, ymin, xmax, ymax = bounds
    x, y, size = (xmin + xmax) / 2, (ymin + ymax) / 2, max(xmax - xmin, ymax - ymin)
    eye = layout.EyeControls3D(
        position=[x, y - 0.5 * size, 1.1 * size], look_target=[x, y, 0], eye_up=[0, 0, 1]
    )
    return layout.Blueprint(
        layout.Spatial3DView(origin="/", name="map", eye_controls=eye), collapse_panels=True
    )


def _map_beside_camera(has_color: bool) -> layout.Blueprint:
    image = "camera/image/color" if has_color else "camera/image/depth"
    return layout.Blueprint(
        layout.Horizontal(
            layout.Spatial3DView(origin="/", name="map"),
            layout.Spatial2DView(
                origin="camera/image", contents=[image, "camera/image/detections"], name="camera"
            ),
            column_shares=[2, 1],
        ),
        collapse_panels=True,
    )
