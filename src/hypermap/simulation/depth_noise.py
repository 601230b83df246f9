"""The errors of a depth camera; each can be set to zero."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray
from hypermap.simulation.ranges import check_not_negative, check_shares
from hypermap.simulation.render import Rendering

# The disparity [pixels] of a Kinect at 1 m: focal length times baseline of its infrared pair.
FOCAL_BASELINE = 580.0 * 0.075
_SUBPIXEL = 0.08  # standard deviation of the disparity that stereo finds [pixels]
_JUMP = 0.04  # relative step in depth between neighbors that counts as an edge

_PATCH = 6.0  # size of the patches without a return [pixels]

Depth = NDArray[np.float32]


@dataclass(frozen=True)
class DepthNoise:
    """The errors of a depth camera; the defaults are those of a Kinect.

    Attributes:
        principle: its measuring principle, which determines how noise grows with distance:
            "structured_light" [Nguyen et al. 2012], "stereo" [Intel 2020] or "tof", time of flight
            [Fankhauser et al. 2015].
        min_range: nothing is measured nearer than this [m].
        max_range: nothing is measured beyond this [m].
        axial: scale of the noise along the optical axis; 1 is as published, 0 none.
        correlated: share of that noise's variance that neighboring pixels share, because stereo and
            structured light match windows of pixels [Konolige, Mihelich 2011].
        correlation_length: about the size of such a window [pixels of the depth image].
        disparity_step: disparity is measured in steps of this many pixels; 0 for no steps.
        focal_baseline: disparity at 1 m, for the steps and for "stereo" [pixels].
        scale: share by which all depths are too large, as by a wrong calibration; may be negative.
        edge_loss: probability that a pixel next to a jump in depth has no return.
        flying: probability that a pixel next to a jump in depth has a depth anywhere between the
            two surfaces, which time of flight and stereo mix [Sarbolandi et al. 2015].
        max_incidence_deg: surfaces that the ray meets at a flatter angle than this from their
            normal give no return.
        dark_surfaces: share of the world's things that are dark or glossy; the seed chooses them.
        dark_loss: share of their pixels that have no return, in patches.
        missing: share of all pixels that have no return, in patches, as on glossy floors and in
            sunlight.
        glass_return: share of the pixels on glass that measure the glass; the others measure the
            surface behind it.

    Source: Nguyen, Izadi, Lovell, "Modeling Kinect sensor noise for improved 3D reconstruction and
    tracking", 3DIMPVT 2012, eq. 2 and 3. Khoshelham, Elberink, "Accuracy and resolution of Kinect
    depth data", Sensors 12(2), 2012: steps of disparity. Konolige, Mihelich, "Technical
    description of Kinect calibration", 2011: windows of 9 x 9 pixels at 640 x 480.
    Grunnet-Jepsen et al., "Tuning depth cameras for best performance", Intel 2020: stereo.
    Fankhauser et al., "Kinect v2 for mobile robot navigation", ICAR 2015: axial noise.
    Sarbolandi, Lefloch, Kolb, "Kinect range sensing: structured-light versus time-of-flight
    Kinect", CVIU 139, 2015: flying pixels, dark surfaces.
    """

    principle: Literal["structured_light", "stereo", "tof"] = "structured_light"
    min_range: float = 0.4
    max_range: float = 8.0
    axial: float = 1.0
    correlated: float = 0.0
    correlation_length: float = 4.0
    disparity_step: float = 1 / 8
    focal_baseline: float = FOCAL_BASELINE
    scale: float = 0.0
    edge_loss: float = 0.5
    flying: float = 0.0
    max_incidence_deg: float = 82.0
    dark_surfaces: float = 0.0
    dark_loss: float = 0.8
    missing: float = 0.0
    glass_return: float = 0.1

    def __post_init__(self) -> None:
        if not 0 <= self.min_range < self.max_range:
            raise ValueError(f"min_range must be below max_range, got {self}")
        check_not_negative(self, "axial", "disparity_step", "max_incidence_deg")
        check_not_negative(self, "correlation_length", "focal_baseline")
        shares = ("correlated", "edge_loss", "flying", "dark_surfaces", "dark_loss", "missing")
        check_shares(self, *shares, "glass_return")
        if not abs(self.scale) < 0.5:
            raise ValueError(f"scale must be between -0.5 and 0.5, got {self.scale}")
        if self.focal_baseline == 0 or self.correlation_length == 0:
            raise ValueError("focal_baseline and correlation_length must be positive")

    def draw_dark(self, count: int, rng: np.random.Generator) -> BoolArray:
        """Return which of the world's things are dark, shape (count,)."""
        return np.asarray(rng.random(count) < self.dark_surfaces)

    def measure(
        self, view: Rendering, rng: np.random.Generator, dark: BoolArray | None = None
    ) -> Depth:
        """Return the depth that the camera measures, float32, NaN for no return, shape (H, W).

        Args:
            view: the true scene, and the scene behind glass.
            rng: random number generator.
            dark: which things are dark, by their instance; None for none.
        """
        true = view.depth
        z = true.copy()
        if self.axial:
            z += self.axial * self._sigma(true, view.incidence) * self._deviations(true.shape, rng)
        if self.disparity_step:
            z = quantized(z, self.disparity_step, self.focal_baseline)
        lost = view.incidence > math.radians(self.max_incidence_deg)
        if self.edge_loss:
            lost |= _beside_jump(true) & (rng.random(true.shape) < self.edge_loss)
        if self.flying:
            flies = _beside_jump(true) & np.isfinite(true)
            flies &= rng.random(true.shape) < self.flying
            z[flies] = _between(true, rng)[flies]
            lost &= ~flies
        if self.scale:
            z *= np.float32(1 + self.scale)
        lost |= self._patches(view, rng, dark)
        with np.errstate(invalid="ignore"):  # NaN compares as false, and stays NaN
            lost |= (z < self.min_range) | (z > self.max_range)
        z[lost] = np.nan
        return z

    def _sigma(self, depth: Depth, incidence: Depth) -> Depth:
        if self.principle == "stereo":
            return stereo_sigma(depth, self.focal_baseline)
        return (tof_sigma if self.principle == "tof" else axial_sigma)(depth, incidence)

    def _deviations(self, shape: tuple[int, ...], rng: np.random.Generator) -> Depth:
        """Return the noise of each pixel in standard deviations."""
        own = rng.standard_normal(shape, dtype=np.float32)
        if not self.correlated:
            return own
        common = _smooth_noise(shape, self.correlation_length, rng)
        return np.asarray(
            math.sqrt(1 - self.correlated) * own + math.sqrt(self.correlated) * common,
            dtype=np.float32,
        )

    def _patches(
        self, view: Rendering, rng: np.random.Generator, dark: BoolArray | None
    ) -> BoolArray:
        """Return the pixels of dark things and elsewhere that have no return."""
        shape = view.depth.shape
        lost = np.zeros(shape, dtype=bool)
        if dark is not None and dark.any():
            # Instances from the number of things on are people who walk; -1 is the background.
            which = np.append(dark, [False, False])[np.minimum(view.instances, len(dark))]
            lost |= which & (_smooth_noise(shape, _PATCH, rng) < _quantile(self.dark_loss))
        if self.missing:
            lost |= _smooth_noise(shape, _PATCH, rng) < _quantile(self.missing)
        return lost


def axial_sigma(depth: Depth, incidence: Depth) -> Depth:
    """Return the standard deviation of a Kinect's noise along the optical axis [m].

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


def stereo_sigma(depth: Depth, focal_baseline: float) -> Depth:
    """Return the standard deviation of the noise of stereo along the optical axis [m].

    Source: Grunnet-Jepsen et al., Intel 2020: RMS error = depth^2 * subpixel / (focal length *
    baseline), with a subpixel error of 0.08 on a well textured surface.

    >>> stereo_sigma(np.array([1.0, 2.0]), 20.0)
    array([0.004, 0.016])
    """
    return np.asarray(_SUBPIXEL / focal_baseline * depth**2)


def tof_sigma(depth: Depth, incidence: Depth) -> Depth:
    """Return the standard deviation of a Kinect v2's noise along the optical axis [m].

    Args:
        depth: meters.
        incidence: angle between ray and normal [rad].

    Source: Fankhauser et al. 2015, the model for indoors.

    >>> tof_sigma(np.array([1.0, 3.0]), np.zeros(2)).round(6)
    array([0.0013, 0.0027])
    """
    theta = np.minimum(incidence, math.radians(85))
    flat = theta**2 / (math.pi / 2 - theta) ** 2
    millimeters = 1.5 - 0.5 * depth + 0.3 * depth**2 + 0.1 * depth**1.5 * flat
    return np.asarray(1e-3 * millimeters, dtype=depth.dtype)


def quantized(depth: Depth, step: float, focal_baseline: float = FOCAL_BASELINE) -> Depth:
    """Return depth as it is known from disparity measured in steps of `step` pixels.

    Neighboring steps lie about step * z**2 / focal_baseline apart: a Kinect's 1.1 cm at 2 m.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        disparity = np.round(focal_baseline / depth / step) * step
        return np.asarray(focal_baseline / disparity, dtype=np.float32)


def _beside_jump(depth: Depth) -> BoolArray:
    """Return the pixels on both sides of a depth edge, or of the border of what was hit."""
    z = np.nan_to_num(depth, nan=1e6)
    jump = np.zeros(z.shape, dtype=bool)
    across = np.abs(np.diff(z, axis=1)) > _JUMP * np.minimum(z[:, 1:], z[:, :-1])
    down = np.abs(np.diff(z, axis=0)) > _JUMP * np.minimum(z[1:], z[:-1])
    jump[:, 1:] |= across
    jump[:, :-1] |= across
    jump[1:] |= down
    jump[:-1] |= down
    return jump


def _between(depth: Depth, rng: np.random.Generator) -> Depth:
    """Return a depth for each pixel between the nearest and farthest of its 3 x 3 neighbors."""
    near = scipy.ndimage.minimum_filter(np.nan_to_num(depth, nan=np.inf), 3)
    far = scipy.ndimage.maximum_filter(np.nan_to_num(depth, nan=-np.inf), 3)
    share = rng.random(depth.shape, dtype=np.float32)
    with np.errstate(invalid="ignore"):  # nothing is near where nothing was hit
        return np.asarray(near + share * (far - near), dtype=np.float32)


def _smooth_noise(shape: tuple[int, ...], length: float, rng: np.random.Generator) -> Depth:
    """Return noise with a standard deviation of 1, correlated over about `length` pixels."""
    sigma = length / 2
    white = rng.standard_normal(shape, dtype=np.float32)
    smooth = scipy.ndimage.gaussian_filter(white, sigma, mode="wrap", truncate=3)
    return np.asarray(smooth * np.float32(2 * math.sqrt(math.pi) * sigma), dtype=np.float32)


def _quantile(share: float) -> float:
    """Return the quantile of the normal distribution for a share."""
    return float(scipy.special.ndtri(share))


EXACT_DEPTH = DepthNoise(axial=0, disparity_step=0, edge_loss=0, max_incidence_deg=90)
