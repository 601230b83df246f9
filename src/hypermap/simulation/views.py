"""What a camera looks at in a world of solid things, glass, and people who come and go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hypermap.perception.frame import Camera
from hypermap.simulation.render import Renderer, Rendering
from hypermap.simulation.scene import BACKGROUND, Scene
from hypermap.simulation.world import World

_TINT = 0.25  # share of a pane's own color in what is seen through it
_SAME = 1e-4  # meters; what is seen without the glass as near as with it is no glass


class Views:
    """Renders a world, and what depth cameras measure of it."""

    def __init__(self, world: World, camera: Camera) -> None:
        has_glass = any(wall.glass for wall in world.walls)
        has_glass |= any(thing.glass for thing in world.objects)
        self._whole = Renderer(Scene.of(world), camera)
        self._solid = Renderer(Scene.of(world, with_glass=False), camera) if has_glass else None

    def seen(self, map_T_camera: NDArray[np.float64], moving: Scene | None = None) -> Rendering:
        """Return what a color camera and a detector see, through glass too.

        The depth is that of the nearest surface, glass or not.
        """
        view = self._whole.render(map_T_camera, moving)
        if self._solid is None:
            return view
        behind = self._solid.render(map_T_camera, moving)
        is_glass = _glass(view, behind)
        color = view.color.copy()
        mixed = _TINT * view.color[is_glass] + (1 - _TINT) * behind.color[is_glass]
        color[is_glass] = np.round(mixed).astype(np.uint8)
        is_pane = is_glass & (view.instances == BACKGROUND)  # of a wall
        return replace(
            view, color=color, instances=np.where(is_pane, behind.instances, view.instances)
        )

    def measured(
        self,
        view: Rendering,
        map_T_camera: NDArray[np.float64],
        moving: Scene | None,
        glass_return: float,
        rng: np.random.Generator,
    ) -> Rendering:
        """Return what a depth camera measures where it does not err: mostly what is behind glass.

        Args:
            view: what is seen from the pose.
            map_T_camera: the pose of the optical frame, shape (4, 4).
            moving: what else is there just now.
            glass_return: share of the pixels on glass that measure the glass.
            rng: says which.
        """
        if self._solid is None:
            return view
        behind = self._solid.render(map_T_camera, moving)
        passes = _glass(view, behind) & (rng.random(view.depth.shape) >= glass_return)
        return replace(
            view,
            depth=np.where(passes, behind.depth, view.depth),
            incidence=np.where(passes, behind.incidence, view.incidence),
        )


def _glass(view: Rendering, behind: Rendering) -> NDArray[np.bool_]:
    with np.errstate(invalid="ignore"):  # where there is nothing, the comparison is false
        return np.isfinite(view.depth) & ~(behind.depth <= view.depth + _SAME)
