"""Presets of depth cameras, with their published errors."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.simulation.depth_noise import DepthNoise

# A D435's depth image of 848 x 480 pixels is 90 degrees wide, and its baseline is 50 mm.
_D435_FOCAL_BASELINE = 424.0 * 0.05

SENSORS: Mapping[str, DepthNoise] = MappingProxyType(
    {
        # Structured light. Nguyen et al. 2012 for the noise, Khoshelham and Elberink 2012 for the
        # steps. Wasenmueller and Stricker, "Comparison of Kinect v1 and v2 depth images in terms
        # of accuracy and precision", ACCV Workshops 2016, see flying pixels with the v2 alone.
        "kinect_v1": DepthNoise(),
        # Active stereo. Keselman et al., "Intel RealSense stereoscopic depth cameras", CVPR
        # Workshops 2017, and Intel's tuning guide (2020) for the noise; its white paper on subpixel
        # linearity (2019) for steps of 1/32 pixel; its data sheet for the range.
        "realsense_d435": DepthNoise(
            principle="stereo",
            min_range=0.28,
            max_range=10.0,
            disparity_step=1 / 32,
            focal_baseline=_D435_FOCAL_BASELINE,
            edge_loss=0.2,
            flying=0.3,
        ),
        # Time of flight, as a Kinect v2. Fankhauser et al. 2015 for the noise, Sarbolandi et al.
        # 2015 and Wasenmueller and Stricker 2016 for flying pixels; Microsoft for the range.
        "tof": DepthNoise(
            principle="tof",
            min_range=0.5,
            max_range=4.5,
            disparity_step=0.0,
            edge_loss=0.1,
            flying=0.3,
        ),
    }
)
"""The shares of pixels at edges that are lost or fly are ours: no source counts them."""


def sensor_of(name: str) -> DepthNoise:
    """Return the errors of a depth camera.

    Args:
        name: "kinect_v1", "realsense_d435" or "tof".

    Raises:
        HypermapError: If there is no such preset.
    """
    if name not in SENSORS:
        hint = did_you_mean(name, SENSORS)
        raise HypermapError(f"there is no preset of a depth camera {name!r}; {hint}")
    return SENSORS[name]
