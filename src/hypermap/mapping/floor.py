"""Floor detection: the floor of a recording should be level and at z = 0 of the map.

Otherwise the map is useless, and nothing else would reveal it: walls become floor, and the floor
becomes a wall.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hypermap.perception.frame import RgbdFrame

_COLUMNS = 40  # columns of an image that are sampled
_FEWEST_FRAMES = 5  # because a single image may mislead
_MOST_FRAMES = 64  # kept; then every other frame is dropped, and only every other one added
_SAME_NORMAL = math.cos(math.radians(12))  # least cosine between two normals of one surface
_TRIED = 100  # points whose normals are candidates for that of the floor
_SHIFTED = 8000  # normals, of which the modes are searched
_LEAST_SHARE = 0.02  # of all points that must be on a floor
_LEAST_SHARE_TILTED = 0.03
_MOST_BELOW = 0.03  # of all points that may be more than `_DEEP` below a floor
_DEEP = 0.12  # meters
_THICK = 0.05  # meters; points nearer to a plane than this are on it
_UPRIGHT = 0.3  # least mean cosine between a floor's normal and the images' upward axis
_LEVEL = math.cos(math.radians(10))
_LEVEL_SHARE = 0.3  # of the points of the best floor; with so many, a level one is preferred
_WIDE = 3.0  # meters; no table is that long
_TILT_DEG, _HEIGHT = 4.0, 0.15  # meters; a floor that is off by more is wrong
_UNITS = (
    0.001,
    0.1,
    0.2,
    5.0,
    10.0,
    1000.0,
)  # errors of depth with a wrong scale
_UNIT_TOLERANCE = 0.1
_LOWEST_CAMERA = 0.3  # meters; below it, such a factor looks the same as a wrong height
_TURNED = 0.7  # least mean cosine between z and another axis of the images than the upward one
_BENT = 0.05  # meters; depth errors may lift one side of the visible floor by so much
_FAR = 100.0  # meters from the origin; farther away, a rotation about it would carry the map off


@dataclass(frozen=True, eq=False)
class Floor:
    """A measured floor.

    Attributes:
        normal: its upward normal in the map, shape (3,).
        offset: its distance from `about` along the normal [m].
        span: length and width of the visible part [m].
        camera_z: height of the camera in the map, mean of all frames [m].
        about: the point of the plane z = 0 at which its height is measured, shape (3,) [m]: at the
            cameras, as at the origin a slight tilt would be meters of height. Of a floor that is
            not nearly level, it is the origin, unless that is far away.
    """

    normal: NDArray[np.float64]
    offset: float
    span: tuple[float, float]
    camera_z: float = 0.0
    about: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))

    @property
    def tilt_deg(self) -> float:
        """The angle between the floor and the plane z = 0 [degrees], 0..180."""
        return math.degrees(math.acos(float(np.clip(self.normal[2], -1.0, 1.0))))

    @property
    def is_level(self) -> bool:
        """Whether a map can be made: the floor is level and at z = 0, as far as is visible.

        A level surface above z = 0 may be a table, unless it is long.
        """
        if self._is_tilted:
            return False
        return abs(self.offset) <= _HEIGHT or (self.offset > 0 and self.span[0] < _WIDE)

    @property
    def is_as_it_should_be(self) -> bool:
        """Whether it is level and at z = 0, and so large that it is no table."""
        return not self._is_tilted and abs(self.offset) <= _HEIGHT and self.span[0] >= _WIDE

    @property
    def _is_tilted(self) -> bool:
        """Whether the tilt is larger than depth errors can explain."""
        explained = math.degrees(math.atan2(_BENT, self.span[1]))
        return self.tilt_deg > _TILT_DEG + explained

    def level_T_map(self, *, lifts: bool = True) -> NDArray[np.float64]:  # noqa: N802
        """Return the smallest rotation and lift that put the floor at z = 0, shape (4, 4).

        The rotation is about the origin, or about the floor at the cameras if these are far away.

        Args:
            lifts: whether it is lifted, too.
        """
        up, z = self.normal, np.array([0.0, 0.0, 1.0])
        axis, cosine = np.cross(up, z), float(up[2])
        sine = float(np.linalg.norm(axis))
        if sine < 1e-12:
            rotation = np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
        else:  # Rodrigues' formula
            x, y, w = axis
            K = np.array([[0, -w, y], [w, 0, -x], [-y, x, 0]])
            share = 1 / (1 + cosine) if cosine > 0 else (1 - cosine) / sine**2  # equal, but stable
            rotation = np.eye(3) + K + K @ K * share
        pivot = self.about if is_far(self.about) else np.zeros(3)
        pose = np.eye(4)
        pose[:3, :3] = rotation
        pose[:3, 3] = pivot - rotation @ pivot
        if lifts:
            pose[2, 3] -= self.offset + up @ (self.about - pivot)
        return pose

    def __str__(self) -> str:
        if self._is_tilted:
            nearest = int(np.argmax(np.abs(self.normal)))
            axis = ("-" if self.normal[nearest] < 0 else "") + "xyz"[nearest]
            off = math.degrees(math.acos(min(abs(float(self.normal[nearest])), 1.0)))
            side = "below" if self.offset < 0 else "above"
            place = "z = 0 under the camera" if self.about.any() else "its origin"
            return (
                f"the world of the recording is not level: its floor is tilted by {off:.0f} "
                f"degrees against its {axis} axis, though z has to point up, and is "
                f"{abs(self.offset):.2f} m {side} {place}"
            )
        return (
            f"the floor of the recording is at z = {self.offset:.2f} m instead of z = 0"
            f"{self._depth_is_off}"
        )

    @property
    def _depth_is_off(self) -> str:
        """A hint if the floor would lie at z = 0 with depth in another common unit."""
        if self.camera_z < _LOWEST_CAMERA:
            return ""
        ratio = (self.camera_z - self.offset) / self.camera_z
        for unit in _UNITS:
            if abs(ratio / unit - 1) < _UNIT_TOLERANCE:
                return (
                    f" (as if all depth were {unit:g} times what it is: are the units per meter "
                    "right, --depth-scale?)"
                )
        return ""


def is_far(place: NDArray[np.float64]) -> bool:
    """Return whether a place is far from the origin, as in coordinates of a whole country."""
    return float(np.hypot(place[0], place[1])) > _FAR


class FloorSampler:
    """Samples points from frames throughout a recording, and finds the floor in them."""

    def __init__(self) -> None:
        self._frames: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]
        self._frames = []  # points and their normals, (N, 3) each, and the camera's pose, (4, 4)
        self._heights: list[float] = []  # of the cameras
        self._every, self._seen = 1, 0

    def add(self, frame: RgbdFrame) -> None:
        """Sample a frame with depth and a valid pose."""
        self._seen += 1
        if (self._seen - 1) % self._every:
            return
        points, normals = _points_and_normals(frame)
        self._frames.append((points, normals, frame.map_T_camera))
        self._heights.append(float(frame.map_T_camera[2, 3]))
        if len(self._frames) > _MOST_FRAMES:
            self._frames, self._every = self._frames[::2], 2 * self._every
            self._heights = self._heights[::2]

    @property
    def axes(self) -> NDArray[np.float64]:
        """The mean camera axes in the map, as columns: right, down, forward; shape (3, 3)."""
        axes = [pose[:3, :3] for _, _, pose in self._frames] or [np.zeros((3, 3))]
        return np.asarray(np.mean(axes, axis=0))

    @property
    def _says_turned(self) -> bool:
        """Whether, by the poses, the images are sideways or upside down."""
        right, down, _ = self.axes[2]
        return bool(max(abs(right), down) > _TURNED)

    def is_upside_down(self, floor: Floor | None) -> bool:
        """Return whether a floor as it should be is visible only if the images are turned around.

        A camera halfway up to the ceiling takes that for such a floor, but sees the true one, too.

        Args:
            floor: what `floor` returns.
        """
        if floor is not None and floor.is_level:
            return False
        turned = self._upside_down().floor()
        return turned is not None and turned.is_as_it_should_be

    def _upside_down(self) -> FloorSampler:
        """Return what was sampled, as it is if the images are upside down, but not their poses."""
        other = FloorSampler()
        for points, normals, pose in self._frames:
            turn = pose[:3, :3] * (-1, -1, 1) @ pose[:3, :3].T  # half a turn about the optical axis
            place = pose[:3, 3]
            other._frames.append(((points - place) @ turn + place, normals @ turn, pose))
        other._heights = self._heights
        return other

    def floor(self) -> Floor | None:
        """Return the floor; None if too little of it is visible."""
        if len(self._frames) < _FEWEST_FRAMES:
            return None
        points = np.concatenate([points for points, _, _ in self._frames])
        normals = np.concatenate([normals for _, normals, _ in self._frames])
        up = -self.axes[:, 1]
        if len(points) < _TRIED:
            return None
        about = np.mean([pose[:3, 3] for _, _, pose in self._frames], axis=0) * (1, 1, 0)
        points = points - about
        camera_z = float(np.mean(self._heights))
        floors = []
        for normal in _directions(normals, up):
            found = _lowest_plane(points, normals, normal)
            if found is not None:
                floor = _measured_at(found[0], about, camera_z)
                found = floor, found[1]
                if floor.normal[2] >= _LEVEL or floor.normal @ up > _UPRIGHT:
                    floors.append(found)
        if not floors:
            return None
        most = max(count for _, count in floors)
        for floor, count in sorted(floors, key=_count, reverse=True):
            is_upright = floor.normal @ up > _UPRIGHT or self._says_turned
            is_likely = floor.normal[2] >= _LEVEL and is_upright
            if is_likely and count >= _LEVEL_SHARE * most:
                return floor
        floor, count = max(floors, key=_count)
        return floor if count >= _LEAST_SHARE_TILTED * len(points) else None


def _measured_at(floor: Floor, about: NDArray[np.float64], camera_z: float) -> Floor:
    """Return a floor, given by points relative to the place of the cameras, as in the map."""
    if floor.normal[2] >= _LEVEL or is_far(about):
        return replace(floor, about=about, camera_z=camera_z)
    return replace(floor, offset=floor.offset + float(floor.normal @ about), camera_z=camera_z)


def _count(found: tuple[Floor, int]) -> int:
    return found[1]


def _points_and_normals(
    frame: RgbdFrame,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points of smooth surfaces [m] and their normals toward the camera, (N, 3) each."""
    step = max(1, round(frame.camera.width / _COLUMNS))
    points = frame.points(step).astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):  # depth may be NaN or infinite
        across, down = points[1:-1, 2:] - points[1:-1, :-2], points[2:, 1:-1] - points[:-2, 1:-1]
        middle = points[1:-1, 1:-1]
        bends = [
            np.abs(points[1:-1, 2:, 2] + points[1:-1, :-2, 2] - 2 * middle[..., 2]),
            np.abs(points[2:, 1:-1, 2] + points[:-2, 1:-1, 2] - 2 * middle[..., 2]),
        ]
        normals = np.cross(down, across)
        lengths = np.linalg.norm(normals, axis=2)
        smooth = np.maximum(*bends) < 0.02 + 0.06 * middle[..., 2]
        smooth &= np.isfinite(lengths) & (lengths > 1e-9) & (middle[..., 2] > 0)
    middle, normals = middle[smooth], normals[smooth] / lengths[smooth, np.newaxis]
    normals *= np.where(np.sum(normals * middle, axis=1) > 0, -1.0, 1.0)[:, np.newaxis]
    rotation, position = frame.map_T_camera[:3, :3], frame.map_T_camera[:3, 3]
    return middle @ rotation.T + position, normals @ rotation.T


def _directions(
    normals: NDArray[np.float64], up: NDArray[np.float64]
) -> Iterator[NDArray[np.float64]]:
    """Yield the modes of the normals that may be those of a floor."""
    likely = normals[(normals @ up > _UPRIGHT / 2) | (normals[:, 2] > _LEVEL)]
    some = np.ascontiguousarray(normals[:: max(1, len(normals) // _SHIFTED)].T)
    found: list[NDArray[np.float64]] = []
    for normal in likely[:: max(1, len(likely) // _TRIED)]:
        for _ in range(4):  # mean shift
            mean = normal + some @ (normal @ some > _SAME_NORMAL).astype(np.float64)  # never zero
            normal = mean / np.linalg.norm(mean)
        if all(normal @ other < 0.999 for other in found):
            found.append(normal)
            yield normal


def _principal_axes(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the directions in which points about the origin spread, most first, as rows (3, 3)."""
    return np.linalg.eigh(points.T @ points)[1].T[::-1]


def _lowest_plane(
    points: NDArray[np.float64], normals: NDArray[np.float64], normal: NDArray[np.float64]
) -> tuple[Floor, int] | None:
    """Return the lowest surface with this normal and its number of points, if it is a floor."""
    needed = _LEAST_SHARE * len(points)
    heights = np.sort(points[normals @ normal > _SAME_NORMAL] @ normal)
    if len(heights) < needed:
        return None
    reaches = np.searchsorted(heights, heights + 2 * _THICK) - np.arange(len(heights))
    enough = np.flatnonzero(reaches >= needed)
    if len(enough) == 0:
        return None
    first = int(enough[0])
    offset = float(np.median(heights[first : first + int(reaches[first])]))
    before = None
    for _ in range(5):
        on = (normals @ normal > _SAME_NORMAL) & (np.abs(points @ normal - offset) < _THICK)
        if np.count_nonzero(on) < needed:
            return None
        if before is not None and np.array_equal(on, before):
            break
        before, there = on, points[on]
        center = there.mean(axis=0)
        axes = _principal_axes(there - center)
        normal = axes[2] if axes[2] @ normal > 0 else -axes[2]
        offset = float(center @ normal)
    if np.mean(points @ normal < offset - _DEEP) > _MOST_BELOW:
        return None
    length, width = np.ptp(np.percentile((there - center) @ axes[:2].T, [2, 98], axis=0), axis=0)
    return Floor(normal, offset, (float(length), float(width))), int(np.count_nonzero(on))
