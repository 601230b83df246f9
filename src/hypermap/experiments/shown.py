"""What the frames of a drive show of a true world: its things, and things that are not there."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.objects import SemanticObject
from hypermap.core.trajectory import invert
from hypermap.perception.frame import Camera
from hypermap.simulation.days import Day
from hypermap.simulation.recording import SimulatedRecording
from hypermap.simulation.scene import Scene
from hypermap.simulation.sightings import LEAST_PIXELS
from hypermap.simulation.visibility import nearest_triangles
from hypermap.simulation.world import WorldObject

_SAME = 0.1  # [m] between surfaces that are one: a thing does not hide its own place
_HEIGHTS = (0.0, 1.0)  # [m] of an object whose heights are not known


class Shown:
    """What the frames of a drive show from near enough, and large enough to be detected.

    Attributes:
        visible: frames that show each thing, int64, shape (N,).
        detected: of these, frames with a detection of it by its own class, int64, shape (N,).
    """

    def __init__(self, day: Day, max_range: float) -> None:
        """Prepare to count; what is more than `max_range` [m] away does not count."""
        self._places = np.array([one.place for one in day.world.objects]).reshape(-1, 2)
        self._max_range = max_range
        self.visible, self.detected, *self._before = np.zeros((4, len(self._places)), np.int64)
        self._exact: list[tuple[Camera, NDArray[np.float64], NDArray[np.float16]]] = []

    def add(self, recording: SimulatedRecording) -> None:
        """Count the frame that a recording has yielded last."""
        pose, depth = recording.exact
        self._exact.append((recording.camera, pose, depth.astype(np.float16)))
        visible, detected = self._before
        is_near = np.hypot(*(self._places - pose[:2, 3]).T) <= self._max_range
        sightings = recording.sightings
        self.visible += is_near & (sightings.visible > visible)
        self.detected += is_near & (sightings.detected > detected)
        self._before = [sightings.visible.copy(), sightings.detected.copy()]

    def frames_that_show(self, body: WorldObject | SemanticObject) -> int:
        """Return how many frames show a body, or would show it if it were there.

        Its surface is compared with what stands in the true world: nothing may hide it.
        """
        triangles = _surface(body)
        middle = (triangles.min(axis=(0, 1)) + triangles.max(axis=(0, 1)))[:2] / 2
        count = 0
        for camera, pose, depth in self._exact:
            if np.hypot(*(middle - pose[:2, 3])) <= self._max_range:
                projection = camera.K @ invert(pose)[:3]
                own, _ = nearest_triangles(triangles, projection, *depth.shape)
                # Where there is nothing, the depth of the world is not a number.
                is_shown = np.isfinite(own) & ~(depth < own - _SAME)
                count += int(np.count_nonzero(is_shown) >= LEAST_PIXELS)
        return count


def _surface(body: WorldObject | SemanticObject) -> NDArray[np.float32]:
    """Return triangles around a body, shape (T, 3, 3): exact, or from its outline and heights."""
    if isinstance(body, WorldObject):
        return Scene.of_things([(0, body)]).triangles
    low, high = (
        body.attributes.get(k, z) for k, z in zip(("z_min", "z_max"), _HEIGHTS, strict=True)
    )
    outline = shapely.get_coordinates(shapely.convex_hull(body.footprint))
    ring, ahead = outline[:-1], outline[1:]
    bottom, top, next_bottom, next_top = (
        np.column_stack([xy, np.full(len(xy), z)]) for xy in (ring, ahead) for z in (low, high)
    )
    first = np.broadcast_to(top[:1], top.shape)
    sides = [(bottom, next_bottom, next_top), (bottom, next_top, top), (first, top, next_top)]
    return np.concatenate([np.stack(side, axis=1) for side in sides]).astype(np.float32)
