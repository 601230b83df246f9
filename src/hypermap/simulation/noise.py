"""The errors of a real depth camera and of localization; each can be set to zero."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.simulation.render import Rendering

# The disparity [pixels] of a Kinect at 1 m: focal length times baseline of its infrared pair.
FOCAL_BASELINE = 580.0 * 0.075
_JUMP = 0.04  # relative step in depth between neighbors that counts as an edge


@dataclass(frozen=True)
class DepthNoise:
    """How a structured-light camera errs.

    Attributes:
        min_range: nothing is measured nearer than this [m].
        max_range: nothing is measured beyond this [m].
        axial: scale of the noise along the optical axis; 1 is a Kinect, 0 none.
        disparity_step: disparity is measured in steps of this many pixels; 0 for no steps.
        edge_loss: probability that a pixel next to a jump in depth has no return.
        max_incidence_deg: surfaces that the ray meets at a flatter angle than this from their
            normal give no return.

    Source: axial noise: Nguyen, Izadi, Lovell, "Modeling Kinect sensor noise for improved 3D
    reconstruction and tracking", 3DIMPVT 2012, eq. 2 and 3. Steps of disparity: Khoshelham,
    Elberink, "Accuracy and resolution of Kinect depth data", Sensors 12(2), 2012.
    """

    min_range: float = 0.4
    max_range: float = 8.0
    axial: float = 1.0
    disparity_step: float = 1 / 8
    edge_loss: float = 0.5
    max_incidence_deg: float = 82.0

    def __post_init__(self) -> None:
        if not 0 <= self.min_range < self.max_range:
            raise ValueError(f"min_range must be below max_range, got {self}")
        check_not_negative(self, "axial", "disparity_step", "edge_loss", "max_incidence_deg")

    def measure(self, view: Rendering, rng: np.random.Generator) -> NDArray[np.float32]:
        """Return the depth that the camera measures, float32, NaN for no return, shape (H, W)."""
        true = view.depth
        z = true.copy()
        if self.axial:
            z += self.axial * axial_sigma(true, view.incidence) * _normal(rng, true.shape)
        if self.disparity_step:
            z = quantized(z, self.disparity_step)
        lost = view.incidence > math.radians(self.max_incidence_deg)
        if self.edge_loss:
            lost |= _beside_jump(true) & (rng.random(true.shape) < self.edge_loss)
        with np.errstate(invalid="ignore"):  # NaN compares as false, and stays NaN
            lost |= (z < self.min_range) | (z > self.max_range)
        z[lost] = np.nan
        return z


def axial_sigma(depth: NDArray[np.float32], incidence: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the standard deviation of the noise along the optical axis [m].

    Args:
        depth: meters.
        incidence: angle between ray and normal [rad].

    Source: Nguyen et al. 2012, eq. 2 below 60 degrees, eq. 3 above.

    >>> axial_sigma(np.array([1.0, 3.0]), np.zeros(2)).round(6)
    array([0.001884, 0.014044])
    """
    sigma = 0.0012 + 0.0019 * (depth - 0.4) ** 2
    flat = incidence > math.radians(60)
    theta = np.minimum(incidence[flat], math.radians(85))
    sigma[flat] += 0.0001 / np.sqrt(depth[flat]) * theta**2 / (math.pi / 2 - theta) ** 2
    return sigma


def quantized(depth: NDArray[np.float32], step: float) -> NDArray[np.float32]:
    """Return depth as it is known from disparity measured in steps of `step` pixels.

    Neighboring steps lie about step * z**2 / FOCAL_BASELINE apart: 1.1 cm at 2 m.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        disparity = np.round(FOCAL_BASELINE / depth / step) * step
        return np.asarray(FOCAL_BASELINE / disparity, dtype=np.float32)


@dataclass(frozen=True)
class PoseNoise:
    """How localization errs. Not at all by default.

    Attributes:
        position: standard deviation in x and in y of what changes from frame to frame [m].
        yaw_deg: likewise of the heading [degrees].
        drift: standard deviation in x and in y of an error that changes slowly [m].
        drift_yaw_deg: likewise of the heading [degrees].
        drift_time: after how many seconds it has mostly changed.
        jump_interval: seconds between jumps to another such error, in the mean, as when a robot
            finds its place again; 0 for no jumps.

    The slow error is an Ornstein-Uhlenbeck process: it wanders, but stays bounded, as that of a
    localization in a known map does.
    """

    position: float = 0.0
    yaw_deg: float = 0.0
    drift: float = 0.0
    drift_yaw_deg: float = 0.0
    drift_time: float = 20.0
    jump_interval: float = 0.0

    def __post_init__(self) -> None:
        check_not_negative(self, *(f.name for f in fields(self)))
        if self.drift_time == 0:
            raise ValueError("drift_time must be positive")

    def estimate(
        self, stamps: NDArray[np.float64], poses: NDArray[np.float64], rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """Return x, y, yaw as localization reports them, shape (N, 3).

        Args:
            stamps: seconds, ascending, shape (N,).
            poses: true x, y, yaw [m, m, rad], shape (N, 3).
            rng: all chance comes from here.
        """
        sigma = [self.position, self.position, math.radians(self.yaw_deg)]
        estimated = poses + rng.normal(size=poses.shape) * sigma
        if self.drift or self.drift_yaw_deg:
            estimated += self._slow_errors(stamps, rng)
        return estimated

    def _slow_errors(
        self, stamps: NDArray[np.float64], rng: np.random.Generator
    ) -> NDArray[np.float64]:
        steps = np.diff(stamps)
        kept = np.exp(-steps / self.drift_time)
        if self.jump_interval:
            kept[rng.random(len(steps)) < -np.expm1(-steps / self.jump_interval)] = 0.0
        new = rng.normal(size=(len(stamps), 3))
        errors = new.copy()
        for i, share in enumerate(kept, start=1):
            errors[i] = share * errors[i - 1] + math.sqrt(1 - share**2) * new[i]
        return errors * [self.drift, self.drift, math.radians(self.drift_yaw_deg)]


def _beside_jump(depth: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return the pixels on both sides of a jump in depth, or of the end of what was hit."""
    z = np.nan_to_num(depth, nan=1e6)
    jump = np.zeros(z.shape, dtype=bool)
    across = np.abs(np.diff(z, axis=1)) > _JUMP * np.minimum(z[:, 1:], z[:, :-1])
    down = np.abs(np.diff(z, axis=0)) > _JUMP * np.minimum(z[1:], z[:-1])
    jump[:, 1:] |= across
    jump[:, :-1] |= across
    jump[1:] |= down
    jump[:-1] |= down
    return jump


def _normal(rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.float32]:
    return rng.standard_normal(shape, dtype=np.float32)


def check_not_negative(noise: Any, *names: str) -> None:
    """Raise a ValueError unless the named attributes are finite numbers of at least 0."""
    for name in names:
        value = getattr(noise, name)
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be a number of at least 0, got {value}")


EXACT_DEPTH = DepthNoise(axial=0, disparity_step=0, edge_loss=0, max_incidence_deg=90)
