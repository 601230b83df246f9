"""Which frames can be mapped."""

from __future__ import annotations

import numpy as np

from hypermap.formats.limits import MAX_PLACE
from hypermap.mapping.depth_check import why_implausible
from hypermap.perception.frame import RgbdFrame

FARTHEST_POSE = 0.9 * MAX_PLACE
"""Meters from the origin; farther away, a camera could see places that no map can contain."""


def why_unusable(frame: RgbdFrame) -> str | None:
    """Return why a frame cannot be mapped; None if it can."""
    if not np.isfinite(frame.stamp):
        return "its stamp is not finite"
    if not np.isfinite(frame.map_T_camera).all():
        return "its pose is not finite"
    if np.abs(frame.map_T_camera[:3, 3]).max() > FARTHEST_POSE:
        return f"its pose is more than {FARTHEST_POSE:g} m away"
    rotation = frame.map_T_camera[:3, :3]
    is_rotation = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3)
    if not is_rotation or np.linalg.det(rotation) < 0:  # mirrored
        return "its pose is not a rigid transform"
    if not np.isfinite(frame.depth).any():
        return "its depth image is empty"
    return why_implausible(frame)
