"""Convex bodies of one color, of which models are built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import ImageColor

from hypermap.core.frames import Pose2D
from hypermap.simulation import meshes
from hypermap.simulation.meshes import Mesh

_SECTIONS = 24  # sides of a round part


@dataclass(frozen=True, eq=False)
class Part:
    """A convex body of one color.

    Attributes:
        vertices: meters, shape (V, 3).
        faces: rows of `vertices`, counter-clockwise seen from outside, shape (F, 3).
        color: RGB, 0..1, shape (3,).
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    color: NDArray[np.float64]


def rgb(color: str) -> NDArray[np.float64]:
    """Return a color such as "#b5835a" or "teal" as numbers from 0 to 1, shape (3,)."""
    try:
        return np.array(ImageColor.getrgb(color)[:3]) / 255
    except ValueError:
        raise ValueError(f"{color!r} is not a color; write it like '#b5835a' or 'teal'") from None


def box(size: Sequence[float], center: Sequence[float], color: str) -> Part:
    """Return a box with its sides along the axes.

    Raises:
        ValueError: If a side is not positive, as when a seat lies above the chair's back.
    """
    if min(size) <= 0:
        raise ValueError("these sizes do not work together: a part would have no extent")
    return _part(meshes.box(size), center, color)


def turned(profile: Sequence[tuple[float, float]], center: Sequence[float], color: str) -> Part:
    """Return a round body: a convex profile of (radius, z), from bottom to top, turned about z."""
    return _part(meshes.revolved(profile, _SECTIONS), center, color)


def cylinder(radius: float, height: float, base: Sequence[float], color: str) -> Part:
    """Return an upright cylinder that stands on `base`."""
    return turned([(radius, 0.0), (radius, height)], base, color)


def disc(radius: float, thickness: float, center: Sequence[float], color: str) -> Part:
    """Return a round plate that faces along x."""
    vertices, faces = meshes.revolved(
        [(radius, -thickness / 2), (radius, thickness / 2)], _SECTIONS
    )
    x, y, z = vertices.T
    return _part((np.column_stack([z, y, -x]), faces), center, color)


def ellipsoid(radii: Sequence[float], center: Sequence[float], color: str) -> Part:
    """Return an ellipsoid with its axes along x, y and z."""
    vertices, faces = meshes.sphere(subdivisions=3)
    return _part((vertices * np.asarray(radii), faces), center, color)


def _part(mesh: Mesh, center: Sequence[float], color: str) -> Part:
    vertices, faces = mesh
    return Part(vertices + np.asarray(center), faces, rgb(color))


def moved(part: Part, pose: Pose2D, z: float) -> Part:
    """Return a part at a pose on the floor, raised by z [m]."""
    xy = pose.apply(part.vertices[:, :2])
    return Part(np.column_stack([xy, part.vertices[:, 2] + z]), part.faces, part.color)


def fitted(parts: Sequence[Part], corners: ArrayLike, z: float) -> tuple[Part, ...]:
    """Return parts so that the rectangle around them fills a quadrilateral.

    Args:
        parts: a model at its origin.
        corners: of the quadrilateral [m], counter-clockwise from the one in front to the right
            (+x, -y), shape (4, 2).
        z: by how much they are raised [m].

    A bilinear map does it: it keeps the straight sides of bodies that lie along the axes.
    """
    front_right, front_left, back_left, back_right = np.asarray(corners, dtype=np.float64)
    every = np.concatenate([part.vertices[:, :2] for part in parts])
    low, high = every.min(axis=0), every.max(axis=0)
    result = []
    for part in parts:
        u, v = ((part.vertices[:, :2] - low) / (high - low)).T[:, :, np.newaxis]
        back, front = (1 - v) * back_right + v * back_left, (1 - v) * front_right + v * front_left
        xy = (1 - u) * back + u * front
        result.append(Part(np.column_stack([xy, part.vertices[:, 2] + z]), part.faces, part.color))
    return tuple(result)
