"""One RGB-D image with the pose from which it was taken."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray
from hypermap.perception.detections import Detections
from hypermap.perception.on_demand import OnDemand

_FLOATS = (np.dtype(np.float32), np.dtype(np.float64))  # that compiled loops can read


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera.

    Attributes:
        K: intrinsic matrix [pixels], shape (3, 3); pixel centers have whole coordinates.
        width: columns of its images.
        height: rows of its images.
    """

    K: NDArray[np.float64]
    width: int
    height: int

    def __post_init__(self) -> None:
        if self.K.shape != (3, 3) or not np.isfinite(self.K).all():
            raise ValueError(f"K must be a finite matrix of shape (3, 3), got {self.K.tolist()}")
        if self.K[0, 0] <= 0 or self.K[1, 1] <= 0:
            raise ValueError(f"focal lengths must be positive, got {self.K[0, 0]}, {self.K[1, 1]}")
        if self.width < 1 or self.height < 1:
            raise ValueError(f"an image needs pixels, got {self.width} x {self.height}")

    @classmethod
    def from_intrinsics(
        cls, fx: float, fy: float, cx: float, cy: float, width: int, height: int
    ) -> Camera:
        """Return a camera from its focal lengths and principal point [pixels]."""
        return cls(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], dtype=float), width, height)

    @property
    def has_center_on_image(self) -> bool:
        """Whether the principal point is on the images; if not, they likely have another size."""
        cx, cy = self.K[:2, 2]
        return bool(0 < cx < self.width and 0 < cy < self.height)

    def every(self, step: int) -> Camera:
        """Return the camera of the image that keeps every `step`-th row and column."""
        K = self.K / [[step], [step], [1]]
        return Camera(K, -(-self.width // step), -(-self.height // step))


@dataclass(frozen=True, eq=False)
class RgbdFrame:
    """A depth image with the camera's pose and, where recorded, color and detections.

    Attributes:
        stamp: time of the depth image [s].
        depth: meters along the optical axis, float32, NaN for no return, shape (H, W).
        camera: intrinsics of the depth image.
        map_T_camera: pose of the camera's optical frame (x right, y down, z forward) in the map,
            whose z is up, shape (4, 4).
        color: RGB, uint8, registered to the depth, shape (H, W, 3); None if not recorded. May be
            given as a function that returns it and checks its shape: it is called when the color
            is first read, which mapping with recorded detections never does.
        color_stamp: time of the color image [s], which may differ slightly from the depth image's;
            None if there is no color image.
        detections: detections recorded with the frame; None if there are none.
        cloud: organized points in the optical frame [m], float32, shape (H, W, 3), if the
            recording has points that differ from the pinhole projection of `depth`.
    """

    stamp: float
    depth: NDArray[np.float32]
    camera: Camera
    map_T_camera: NDArray[np.float64]
    color: OnDemand[NDArray[np.uint8] | None] = OnDemand()  # noqa: RUF009
    color_stamp: float | None = None
    detections: Detections | None = None
    cloud: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        shape = (self.camera.height, self.camera.width)
        if self.depth.shape != shape:
            raise ValueError(f"depth must have shape {shape}, got {self.depth.shape}")
        if self.depth.dtype not in _FLOATS:  # integers are unlikely to be meters
            raise ValueError(f"depth must be meters as float32, got {self.depth.dtype}")
        if self.map_T_camera.shape != (4, 4):
            raise ValueError(f"map_T_camera must be 4 x 4, got {self.map_T_camera.shape}")
        color = vars(self)["color"]  # without decoding it
        if isinstance(color, np.ndarray) and color.shape != (*shape, 3):
            raise ValueError(f"color must have shape {(*shape, 3)}, got {color.shape}")
        if self.cloud is not None and self.cloud.shape != (*shape, 3):
            raise ValueError(f"cloud must have shape {(*shape, 3)}, got {self.cloud.shape}")
        if self.cloud is not None and self.cloud.dtype not in _FLOATS:
            raise ValueError(f"cloud must be meters as float32, got {self.cloud.dtype}")

    def __getstate__(self) -> dict[str, Any]:  # to travel from one process to another
        return {name: value for name, value in vars(self).items() if name != "_points"}

    def moved_to(self, map_T_camera: NDArray[np.float64]) -> RgbdFrame:
        """Return the same images as taken from another pose, shape (4, 4)."""
        moved = copy.copy(self)  # `dataclasses.replace` would decode the color
        vars(moved)["map_T_camera"] = map_T_camera
        return moved

    def points(self, step: int = 1) -> NDArray[np.float32]:
        """Return the organized cloud in the optical frame, float32, shape (H, W, 3).

        It is computed once and read-only.

        Args:
            step: every n-th row and column of the image is in it.
        """
        if self.cloud is not None:
            # The same kind of array as below, so that loops are compiled only once.
            every = np.ascontiguousarray(self.cloud[::step, ::step]).view()
            every.flags.writeable = False
            return every
        if step not in self._points:
            # Imported here: numba is slow to load, and not all users of frames need points.
            from hypermap.perception.projection import project

            points = project(self.depth, self.camera.K, step)
            points.flags.writeable = False
            self._points[step] = points
        return self._points[step]

    @property
    def z(self) -> NDArray[np.float32]:
        """Depth of the points along the optical axis [m], shape (H, W)."""
        return self.depth if self.cloud is None else np.ascontiguousarray(self.cloud[..., 2])

    def points_of(self, pixels: IntArray) -> NDArray[np.float32]:
        """Return the points of some pixels, the same as in `points`, float32, shape (N, 3).

        Args:
            pixels: row-major indices, shape (N,).
        """
        if self.cloud is not None:
            return self.cloud.reshape(-1, 3)[pixels]
        from hypermap.perception.projection import project_pixels

        return project_pixels(self.depth, self.camera.K, pixels)

    @cached_property
    def _points(self) -> dict[int, NDArray[np.float32]]:
        return {}


DetectionSource: TypeAlias = Callable[[RgbdFrame], Detections]
"""Returns the detections of a frame: by a detector, from a file, or from the recording."""
