"""Levels of error: what a simulated camera, localization and detector get wrong."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.simulation.depth_noise import EXACT_DEPTH, DepthNoise
from hypermap.simulation.detector import EXACT_DETECTOR, DetectorNoise
from hypermap.simulation.map_noise import MapNoise
from hypermap.simulation.pose_noise import PoseNoise
from hypermap.simulation.sensors import sensor_of

LEVELS = ("none", "fair", "robot", "drift", "rough", "harsh")


@dataclass(frozen=True)
class Errors:
    """All errors of a simulated recording.

    Attributes:
        depth: of the camera.
        poses: of localization, clocks and mounting.
        detector: of the detections.
        map: of the occupancy map that comes with the recording.
        people: how many walk through the world meanwhile; they are not in the true map.
    """

    depth: DepthNoise = field(default_factory=DepthNoise)
    poses: PoseNoise = field(default_factory=PoseNoise)
    detector: DetectorNoise = field(default_factory=DetectorNoise)
    map: MapNoise = field(default_factory=MapNoise)
    people: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.people <= 100:
            raise ValueError(f"people must be between 0 and 100, got {self.people}")


_ROBOT_POSES = PoseNoise(
    position=0.005, yaw_deg=0.2, drift=0.03, drift_yaw_deg=0.8, jump_interval=60.0
)
_ODOMETRY_POSES = PoseNoise(odometry=0.01, odometry_yaw_deg=0.1, odometry_turn=0.01)
_ROBOT_DETECTOR = DetectorNoise(
    miss=0.15,
    flicker=0.03,
    looseness=0.08,
    shift=0.03,
    confusion=0.04,
    false_positives=0.05,
    walls=0.05,
)


def errors_of_level(name: str, sensor: str = "kinect_v1") -> Errors:
    """Return a level of error.

    Args:
        name: "none"; "fair", exact poses and a fair detector; "robot", which adds localization that
            drifts and jumps and a detector that mistakes walls for trains; "drift", the same with
            odometry instead of localization; "rough", which adds to "robot" small lasting errors
            of calibration, surfaces, detector and map; or "harsh", twice these.
        sensor: the depth camera, a key of `SENSORS`.

    Raises:
        HypermapError: If there is no such level or sensor.
    """
    if name not in LEVELS:
        raise HypermapError(f"there is no level of errors {name!r}; {did_you_mean(name, LEVELS)}")
    depth = sensor_of(sensor)
    if name == "none":
        return Errors(EXACT_DEPTH, PoseNoise(), EXACT_DETECTOR)
    if name == "fair":
        return Errors(depth)
    if name == "drift":
        return Errors(depth, _ODOMETRY_POSES, _ROBOT_DETECTOR)
    robot = Errors(depth, _ROBOT_POSES, _ROBOT_DETECTOR)
    return robot if name == "robot" else _rougher(robot, 1 if name == "rough" else 2)


def _rougher(errors: Errors, times: int) -> Errors:
    """Add small lasting errors, some times as large."""
    return Errors(
        depth=replace(
            errors.depth,
            correlated=0.4 * times,
            scale=0.01 * times,
            flying=min(1.0, errors.depth.flying * times),
            dark_surfaces=0.2 * times,
        ),
        poses=replace(
            errors.poses,
            time_offset=0.03 * times,
            mounting_deg=0.5 * times,
            mounting=0.01 * times,
        ),
        detector=replace(
            errors.detector,
            lasting_misses=0.3 * times,
            false_places=4 * times,
            lasting_confusion=0.1 * times,
        ),
        map=MapNoise(source="laser", bend=0.02 * times),
    )
