"""Levels of error: what a simulated camera, localization and detector get wrong."""

from __future__ import annotations

from dataclasses import dataclass, field

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.simulation.detector import EXACT_DETECTOR, DetectorNoise
from hypermap.simulation.noise import EXACT_DEPTH, DepthNoise, PoseNoise


@dataclass(frozen=True)
class Errors:
    """All errors of a simulated recording.

    Attributes:
        depth: of the camera.
        poses: of localization.
        detector: of the detections.
    """

    depth: DepthNoise = field(default_factory=DepthNoise)
    poses: PoseNoise = field(default_factory=PoseNoise)
    detector: DetectorNoise = field(default_factory=DetectorNoise)


LEVELS = {
    "none": Errors(EXACT_DEPTH, PoseNoise(), EXACT_DETECTOR),
    "fair": Errors(),
    "robot": Errors(
        DepthNoise(),
        PoseNoise(position=0.005, yaw_deg=0.2, drift=0.03, drift_yaw_deg=0.8, jump_interval=60.0),
        DetectorNoise(
            miss=0.15,
            flicker=0.03,
            looseness=0.08,
            shift=0.03,
            confusion=0.04,
            false_positives=0.05,
            walls=0.05,
        ),
    ),
}


def errors_of_level(name: str) -> Errors:
    """Return a level of error.

    Args:
        name: "none"; "fair", a Kinect with exact poses and a fair detector; or "robot", which adds
            localization that drifts and jumps and a detector that takes walls for trains.

    Raises:
        HypermapError: If there is no such level.
    """
    if name not in LEVELS:
        raise HypermapError(f"there is no level of errors {name!r}; {did_you_mean(name, LEVELS)}")
    return LEVELS[name]
