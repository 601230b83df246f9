"""The pre-flight check: whether a recording meets the assumptions of mapping.

Mapping assumes that the floor is level at z = 0, that depth is in meters and registered to color,
that poses are those of the camera's optical frame, that they share one clock with the images, and
that the camera is upright. Otherwise the map is wrong.
So this checks the first frames, and some later ones, and reports each problem once: what was
measured, its effect on the map, and the remedy.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.trajectory import compose, rpy_from_pose
from hypermap.mapping.consistency import Consistency
from hypermap.mapping.depth_check import DepthCheck
from hypermap.mapping.floor import Floor, FloorSampler
from hypermap.mapping.registration_check import ColorCamera, RegistrationCheck
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.pose_convention import CONVENTIONS, OPTICAL

_log = logging.getLogger(__name__)

_FIRST = 24  # mapped frames before the first check; the next ones after eight times as many, ...
_AGAIN = 8
_LEAST_OFFSET = 0.035  # seconds; less may be the exposure of images, or how poses are interpolated
_LEAST_MOVE = 0.02  # meters
_TOO_FAR, _TOO_FAST = 3.0, 20.0  # meters from frame to frame, and m/s; no robot does both
_LEAST_SCALE = math.log(1.25)  # a smaller error of depth does not come from a wrong unit
_UPSIDE_DOWN = -0.5  # mean cosine between the images' upward axis and the z axis
_SIDEWAYS = 0.7  # the same for the images' horizontal axis
_LIE = {90: "lie on their side", 180: "are upside down", 270: "lie on their side"}
_UNDECIDED = {
    "scale": "the camera hardly moves, so nothing tells the unit of depth",
    "clock": "frames too far apart, or too even a motion, to compare clocks",
}
_WRONG_TILT, _WRONG_HEIGHT = 1.0, 0.05  # degrees and meters that leveling corrects


@dataclass(frozen=True)
class Finding:
    """The result of checking one assumption of mapping.

    Attributes:
        check: "level", "depth", "scale", "registration", "clock", "upright" or "poses".
        measured: what was measured, or that it could not be.
        effect: what that does to the map; empty if nothing is wrong.
        remedy: how to fix it; empty if nothing is wrong.
    """

    check: str
    measured: str
    effect: str = ""
    remedy: str = ""

    @property
    def is_wrong(self) -> bool:
        """Whether it makes the map worse."""
        return bool(self.effect)

    def __str__(self) -> str:
        return "; ".join(filter(None, (self.measured, self.effect, self.remedy)))


class Preflight:
    """Checks frames, and reports each problem once, as soon as it is clear.

    Args:
        report: called with each problem.
        max_depth: depth beyond which objects are ignored [m].
        map_T_world: pose of the recording's world frame given by its options, shape (4, 4); the
            leveling pose is composed with it.
        pose_convention: by which the poses were read.
    """

    def __init__(
        self,
        report: Callable[[Finding], None] | None = None,
        max_depth: float = 5.0,
        map_T_world: NDArray[np.float64] | None = None,
        pose_convention: str = OPTICAL,
    ) -> None:
        self._pose_convention = pose_convention
        self._report = report or _warn
        self._map_T_world = np.eye(4) if map_T_world is None else map_T_world
        self._floor = FloorSampler()
        self._depth = DepthCheck(max_depth)
        self._consistency = Consistency()
        self._registration = RegistrationCheck()
        self._frames, self._next = 0, _FIRST
        self._reported: set[str] = set()
        self._settled: dict[str, Finding] = {}

    def add(self, frame: RgbdFrame) -> None:
        """Check a usable frame; frames must come in order of time."""
        self._consistency.add(frame)

    def add_mapped(self, frame: RgbdFrame) -> None:
        """Check a mapped frame in more detail, and report new problems."""
        self._floor.add(frame)
        self._depth.add(frame)
        self._registration.add(frame)
        self._frames += 1
        if self._frames == self._next:
            self._next *= _AGAIN
            self.finish()

    def finish(self) -> None:
        """Report the remaining problems."""
        for finding in self.findings():
            if finding.is_wrong and finding.check not in self._reported:
                self._reported.add(finding.check)
                self._report(finding)

    def findings(self) -> list[Finding]:
        """Return the result of each check, whether right or wrong."""
        floor = self._floor.floor()
        reading = self._consistency.reading()
        is_upside_down = self._floor.is_upside_down(floor)
        if is_upside_down or reading.convention != OPTICAL:
            floor = None  # what seems to be one is something else
        for check, measure in (
            ("scale", self._scale),
            ("registration", self._color),
            ("clock", self._clock),
        ):
            # Color is only sampled at the beginning; the other checks may improve with more frames.
            before = self._settled.get(check)
            if before is None or not (before.is_wrong or check == "registration"):
                finding = measure()
                if finding is not None:
                    self._settled[check] = finding
        settled = list(self._settled.values())
        if reading.convention != OPTICAL:  # so what else the poses tell is wrong
            settled = [one for one in settled if not (one.is_wrong and one.check in _UNDECIDED)]
        is_late = any(one.is_wrong and one.check == "clock" for one in settled)
        found = (self._level(floor, is_late), self._odd_depth(), *settled)
        undecided = [
            Finding(check, text) for check, text in _UNDECIDED.items() if check not in self._settled
        ]
        mounted = (
            self._upright(floor, is_upside_down, reading.turn_deg)
            if reading.convention == OPTICAL
            else _other_convention(reading.convention, self._pose_convention)
        )
        return [f for f in (*found, *undecided, mounted) if f is not None]

    def _level(self, floor: Floor | None, is_late: bool) -> Finding:
        """Return whether the floor is level; poses of other times let a level one seem tilted."""
        if floor is None:
            return Finding("level", "no floor is visible, so it is unknown whether it is at z = 0")
        if floor.is_level:
            said = f"tilted by {floor.tilt_deg:.1f} degrees, at z = {floor.offset:.2f} m"
            return Finding("level", f"the lowest level surface is {said}")
        if is_late:
            unknown = "so it is unknown whether the floor is level at z = 0"
            return Finding("level", f"poses and images have different clocks, {unknown}")
        numbers = option_text(compose(floor.level_T_map(), self._map_T_world), floor)
        return Finding(
            "level",
            str(floor),
            "the floor must be level at z = 0; otherwise it becomes a wall, and objects on it are "
            "lost",
            f"give --level auto, or --world-transform={numbers}",
        )

    def _odd_depth(self) -> Finding | None:
        why = self._depth.why_odd()
        if why is None:
            return None
        remedy = "if the unit is wrong, give the units of depth per meter with --depth-scale"
        return Finding("depth", why, "no objects are mapped from such depth", remedy)

    def _scale(self) -> Finding | None:
        step, speed = self._consistency.usual_step()
        if step > _TOO_FAR and speed > _TOO_FAST:
            return Finding(
                "scale",
                f"the camera moves by {step:.3g} m from one frame to the next",
                "no two images show the same place, and each thing is mapped many times",
                "if the poses are in another unit, such as millimeters, convert them to meters",
            )
        fit = self._consistency.depth_scale()
        if fit is None:
            return None
        if abs(math.log(fit.value)) < _LEAST_SCALE:
            return Finding("scale", "depth and poses are in the same unit")
        if not fit.is_sure:
            return Finding(
                "scale",
                "it is unclear whether depth and poses are in the same unit: images agree best "
                f"if all depth is multiplied by {fit.value:.2g}, but poses that drift may be the "
                "cause",
            )
        return Finding(
            "scale",
            f"depth images agree with each other if all depth is multiplied by {fit.value:.2g}",
            "everything is too near or too far, and too small or too large",
            f"divide --depth-scale by {fit.value:.2g}, if the poses are in meters",
        )

    def _color(self) -> Finding | None:
        camera = self._registration.color_camera()
        if camera is None:
            return None
        if not camera.is_other:
            return Finding("registration", "depth edges match color edges")
        return _unregistered(camera)

    def _clock(self) -> Finding | None:
        fit = self._consistency.time_offset()
        if fit is None:
            return None
        is_off = abs(fit.value) >= _LEAST_OFFSET and fit.moves >= _LEAST_MOVE
        if not fit.is_sure or not is_off:
            return Finding("clock", f"poses and images agree within {abs(fit.value) + 0.02:.2f} s")
        side = "later" if fit.value > 0 else "earlier"
        return Finding(
            "clock",
            f"images match each other best with the poses of {abs(fit.value):.2f} s {side}",
            f"things 2 m ahead of the moving camera are mapped {fit.moves:.2f} m off, and "
            "may appear twice",
            f"give --time-offset auto, or {fit.value:.2f} (live: the parameter time_offset)",
        )

    def _upright(self, floor: Floor | None, is_upside_down: bool, turn: int) -> Finding:
        up = np.array([0.0, 0.0, 1.0]) if floor is None else floor.normal
        right, down, _ = up @ self._floor.axes
        if turn or is_upside_down:
            why = "images match" if turn else "the floor is level at z = 0"
            return Finding(
                "upright",
                f"{why} only if the camera is rotated by {turn or 180} degrees about its "
                "optical axis",
                "objects are mapped in different places from each image",
                "if the camera is mounted upside down or on its side, correct its poses, in a bag "
                "those in tf"
                + ("" if turn else "; or give --pose-convention mirrored (ICL-NUIM), or another"),
            )
        turned = 180 if -down < _UPSIDE_DOWN else 270 if right > _SIDEWAYS else 0
        turned = 90 if right < -_SIDEWAYS else turned
        if floor is None:
            return _unseen_floor(turned)
        if not turned:
            return Finding("upright", "the images are upright")
        return Finding(
            "upright",
            f"the images {_LIE[turned]}",
            "the map is correct, but detectors find little in such images",
            f"give --rotate {turned}",
        )


def leveling_pose(frames: Iterable[RgbdFrame]) -> tuple[NDArray[np.float64], Floor | None]:
    """Return the pose that moves the visible floor to z = 0, and the floor.

    The pose has shape (4, 4). It is the identity if no floor is visible, as when images are upside
    down, or it is already level at z = 0, or if the surface above z = 0 may be a table.
    """
    sampler = FloorSampler()
    for frame in frames:
        sampler.add(frame)
    floor = sampler.floor()
    if floor is None or sampler.is_upside_down(floor):
        return np.eye(4), None
    is_off = abs(floor.offset) > _WRONG_HEIGHT or floor.tilt_deg > _WRONG_TILT
    may_be_table = floor.is_level and floor.offset > _WRONG_HEIGHT
    if not is_off or (may_be_table and floor.tilt_deg <= _WRONG_TILT):
        return np.eye(4), floor
    return floor.level_T_map(lifts=not may_be_table), floor


def option_text(pose: NDArray[np.float64], floor: Floor) -> str:
    """Return a pose that levels a floor as --world-transform takes it: x,y,z,roll,pitch,yaw.

    The farther from the origin the floor is, the more decimals the angles have, for a centimeter.
    """
    *position, roll, pitch, yaw = rpy_from_pose(pose)
    away = float(np.linalg.norm(floor.about))
    decimals = max(4, math.ceil(math.log10(max(100 * away, 1.0))))
    angles = (f"{angle:.{decimals}f}" for angle in (roll, pitch, yaw))
    return ",".join([*(f"{x:.3f}" for x in position), *angles])


def clock_offset(frames: Iterable[RgbdFrame]) -> float | None:
    """Return the delay from an image's stamp to the stamp of its pose [s].

    0 if no other delay is clearly better; None if that is unknown.
    """
    consistency = Consistency()
    for frame in frames:
        consistency.add(frame)
    fit = consistency.time_offset()
    if fit is None:
        return None
    return fit.value if fit.is_sure else 0.0


def _unseen_floor(turned: int) -> Finding:
    """Return whether images are upright, where only their poses say so."""
    if not turned:
        return Finding("upright", "by their poses, the images are upright; no floor shows it")
    return Finding(
        "upright",
        f"by their poses, the images {_LIE[turned]}; no floor shows it",
        "if so, detectors find little in such images; if not, the map makes no sense",
        f"give --rotate {turned} if they do, or else the --pose-convention of the poses",
    )


def _other_convention(convention: str, given: str) -> Finding:
    measured = f"images match only if the recorded poses are {CONVENTIONS[convention]}"
    remedy = f"give --pose-convention {convention}"
    if given != OPTICAL:
        measured = f"images do not match if the recorded poses are {CONVENTIONS[given]}"
        remedy = "leave --pose-convention out: the check then says which one fits"
    effect = "each image puts things in another place, and the map makes no sense"
    return Finding("poses", measured, effect, remedy)


def _unregistered(camera: ColorCamera) -> Finding:
    fx, fy, cx, cy = camera.intrinsics
    pixels = camera.shift * camera.camera.width
    return Finding(
        "registration",
        f"depth is not registered to color: they are {pixels:.0f} pixels apart; "
        f"the color camera seems to have {camera.scale:.2f} times the focal length of the depth "
        f"camera, and to be {1000 * abs(camera.x):.0f} mm next to it",
        "boxes cut the wrong part out of the depth image: small objects are lost, or mapped in the "
        "wrong places",
        "give --register with a bag that has camera info and tf of the color camera; otherwise "
        f"--register --color-intrinsics={fx:.1f},{fy:.1f},{cx:.1f},{cy:.1f} "
        f"--depth-transform={camera.x:.3f},{camera.y:.3f},0,0,0,0",
    )


def _warn(finding: Finding) -> None:
    _log.warning("%s", finding)
