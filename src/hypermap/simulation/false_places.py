"""Places where a detector has a false positive whenever it looks from one side."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera
from hypermap.simulation.render import Rendering

_TRIES = 20  # pixels that are tried for each place
_SIZES = (0.1, 0.5)  # of what is seen there [m]
_NEAR, _FAR = 0.8, 4.0  # from where it is seen [m]
_WITHIN = math.cos(math.radians(40))  # of the direction from which it looks like a thing
_SURFACE = 0.1  # meters by which the surface seen may be off the place; more is something else

Pose = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FalsePlace:
    """A shadow on the floor, a picture on a wall, a cable: from one side it looks like a thing.

    Attributes:
        xyz: where it is, map frame [m], shape (3,).
        toward: unit vector to where it looks like a thing from, shape (3,).
        size: of that thing [m].
        name: its class.
    """

    xyz: NDArray[np.float64]
    toward: NDArray[np.float64]
    size: float
    name: str


def draw_false_places(
    count: int,
    poses: Pose,
    render: Callable[[Pose], Rendering],
    camera: Camera,
    names: Sequence[str],
    rng: np.random.Generator,
) -> list[FalsePlace]:
    """Draw places on walls and floors that a drive sees.

    Args:
        count: how many; fewer if a drive hardly sees any wall or floor.
        poses: `map_T_camera` of the frames, shape (N, 4, 4).
        render: what is seen from a pose.
        camera: intrinsics of what is seen.
        names: classes to choose from.
        rng: random number generator.
    """
    places = []
    for _ in range(count if names else 0):
        pose = poses[rng.integers(len(poses))]
        name, size = names[int(rng.integers(len(names)))], float(rng.uniform(*_SIZES))
        rows = rng.integers(camera.height, size=_TRIES)
        columns = rng.integers(camera.width, size=_TRIES)
        view = render(pose)
        z = view.depth[rows, columns]
        fits = (view.instances[rows, columns] < 0) & (z > _NEAR) & (z < _FAR)
        if fits.any():
            k = int(np.argmax(fits))
            ray = np.linalg.solve(camera.K, [columns[k], rows[k], 1.0]) * z[k]
            xyz = pose[:3, :3] @ ray + pose[:3, 3]
            toward = pose[:3, 3] - xyz
            places.append(FalsePlace(xyz, toward / np.linalg.norm(toward), size, name))
    return places


def detect_false_places(
    places: Sequence[FalsePlace],
    map_T_camera: Pose,
    view: Rendering,
    camera: Camera,
    rate: float,
    rng: np.random.Generator,
) -> Detections:
    """Return what a frame shows of them, each with a probability of `rate`."""
    boxes, names = [], []
    is_seen = rng.random(len(places)) < rate
    scores = rng.uniform(0.5, 0.95, len(places))
    for place, chance in zip(places, is_seen.tolist(), strict=True):
        box = _box(place, map_T_camera, view, camera) if chance else None
        boxes.append(box)
        names.append(place.name)
    kept = [i for i, box in enumerate(boxes) if box is not None]
    return Detections.of([boxes[i] for i in kept], [names[i] for i in kept], scores[kept])


def _box(
    place: FalsePlace, map_T_camera: Pose, view: Rendering, camera: Camera
) -> list[float] | None:
    """Return the box of a place in a frame; None if it is not seen, or from another side."""
    offset = map_T_camera[:3, 3] - place.xyz
    x, y, z = -offset @ map_T_camera[:3, :3]
    if z < _NEAR / 2 or offset @ place.toward < _WITHIN * np.linalg.norm(offset):
        return None
    u, v = camera.K[0, 0] * x / z + camera.K[0, 2], camera.K[1, 1] * y / z + camera.K[1, 2]
    column, row = round(u), round(v)
    if z > _FAR or not (0 <= column < camera.width and 0 <= row < camera.height):
        return None
    if not abs(view.depth[row, column] - z) < _SURFACE:  # also where nothing was hit
        return None
    half_width, half_height = camera.K[[0, 1], [0, 1]] * place.size / 2 / z
    return [u - half_width, v - half_height, u + half_width, v + half_height]
