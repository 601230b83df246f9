"""Lens distortion: where a lens shows what a pinhole camera would show elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hypermap.core.arrays import BoolArray, FloatArray

PLUMB_BOB, RATIONAL, EQUIDISTANT = "plumb_bob", "rational_polynomial", "equidistant"
MODELS = (PLUMB_BOB, RATIONAL, EQUIDISTANT)
"""Models of distortion, as in ROS (`sensor_msgs/distortion_models.hpp`)."""

_OPENCV = (4, 5, 8, 12, 14)  # by their number, OpenCV and ROS know which ones they are
_LENGTHS = {PLUMB_BOB: _OPENCV, RATIONAL: _OPENCV, EQUIDISTANT: (4,)}
_ITERATIONS = 20
_STEP = 1e-6  # for derivatives
_ANGLES = 1000  # at which it is looked whether a lens shows points in their order


@dataclass(frozen=True)
class Lens:
    """A lens. Points are x and y on the plane at z = 1 before it, shape (..., 2).

    Attributes:
        model: one of `MODELS`.
        coefficients: of `equidistant` k1 to k4; of the others k1, k2, p1, p2 and further ones in
            the order of OpenCV.

    Raises:
        ValueError: If the model is unknown, or has another number of coefficients.

    Source: Brown 1966; OpenCV's documentation of `calib3d` for the order, the rational form and
        thin prisms; Kannala and Brandt 2006 for `equidistant`.
    """

    model: str
    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise ValueError(f"the known models are {', '.join(MODELS)}, got {self.model!r}")
        if len(self.coefficients) not in _LENGTHS[self.model]:
            expected = " or ".join(map(str, _LENGTHS[self.model]))
            raise ValueError(
                f"{self.model} has {expected} coefficients, got {len(self.coefficients)}"
            )
        if not np.isfinite(self.coefficients).all() or any(self.coefficients[12:]):
            raise ValueError("the coefficients must be finite, and sensors not tilted (tau is 0)")

    def distorted(self, points_xy: FloatArray) -> FloatArray:
        """Return where the lens shows points, shape (..., 2); NaN where it shows others there.

        Far from the center, a polynomial may turn back, so that two points are shown at one place;
        the lens shows the nearer one.
        """
        x, y = points_xy[..., 0], points_xy[..., 1]
        with np.errstate(all="ignore"):
            shown = np.stack(_shown(self, x, y), axis=-1)
            shown[~_are_in_order(self, x, y)] = np.nan
        return shown

    def undistorted(self, points_xy: FloatArray) -> FloatArray:
        """Return the points that the lens shows at places, shape (..., 2); NaN where it shows none.

        By Newton's method, with derivatives from differences.
        """
        x, y = (points_xy[..., axis].copy() for axis in (0, 1))
        with np.errstate(all="ignore"):
            for _ in range(_ITERATIONS):
                u, v = _shown(self, x, y)
                (u_x, v_x), (u_y, v_y) = _shown(self, x + _STEP, y), _shown(self, x, y + _STEP)
                slopes = (u_x - u) / _STEP, (v_x - v) / _STEP, (u_y - u) / _STEP, (v_y - v) / _STEP
                du, dv = points_xy[..., 0] - u, points_xy[..., 1] - v
                area = slopes[0] * slopes[3] - slopes[2] * slopes[1]
                x += (slopes[3] * du - slopes[2] * dv) / area
                y += (slopes[0] * dv - slopes[1] * du) / area
            found = np.stack([x, y], axis=-1)
            off = np.hypot(*np.moveaxis(self.distorted(found) - points_xy, -1, 0))
            found[~(off < _STEP)] = np.nan  # also those that are shown elsewhere
        return found


def _are_in_order(lens: Lens, x: FloatArray, y: FloatArray) -> BoolArray:
    """Return for which points all that are nearer to the center are shown nearer to it, too.

    This is looked at in steps of angles: steps of lengths would miss where a lens turns back, if
    one of the points is far away.
    """
    radius = np.hypot(x, y)
    farthest = np.max(radius, initial=0.0, where=np.isfinite(radius))
    along = np.tan(np.linspace(0, np.arctan(farthest), _ANGLES))
    shown, _ = _shown(lens, along, np.zeros_like(along))
    turns = np.flatnonzero(np.diff(shown) <= 0)
    in_order: BoolArray = radius <= (along[turns[0]] if len(turns) else farthest)
    return in_order


def _shown(lens: Lens, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where the model says that the lens shows points."""
    k = lens.coefficients
    r2 = x * x + y * y
    if lens.model == EQUIDISTANT:
        r = np.sqrt(r2)
        angle = np.arctan(r)
        a2 = angle * angle
        bent = angle * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))))
        scale = np.where(r > 0, bent / np.where(r > 0, r, 1), 1.0)
        return x * scale, y * scale
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = _twelve(k)
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4)
    return u, v


def _twelve(coefficients: Sequence[float]) -> Sequence[float]:
    return [*coefficients[:12], *[0.0] * (12 - len(coefficients))]
