"""Closed triangle meshes of simple bodies about the origin, with faces that look outwards."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Mesh: TypeAlias = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices [m], shape (V, 3), and rows of them, counter-clockwise from outside, shape (F, 3)."""


def box(size: ArrayLike) -> Mesh:
    """Return a box with its sides along the axes; its faces are two triangles each."""
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    # Counter-clockwise from outside: -x, +x, -y, +y, -z, +z. The number of a corner is 4x + 2y + z.
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))]
    return signs * np.asarray(size), np.array(faces)


def revolved(profile: Sequence[tuple[float, float]], sections: int) -> Mesh:
    """Return a round body about z.

    Args:
        profile: (radius, z) from bottom to top, all radii above 0; it is closed by a flat bottom
            and top.
        sections: number of sides.
    """
    angles = 2 * np.pi * np.arange(sections) / sections
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    rings = [np.column_stack([radius * circle, np.full(sections, z)]) for radius, z in profile]
    poles = [(0.0, 0.0, profile[0][1]), (0.0, 0.0, profile[-1][1])]
    here = np.arange(sections)
    ahead = (here + 1) % sections
    bottom, top = np.zeros_like(here), np.ones_like(here)
    first, last = 2, 2 + (len(profile) - 1) * sections  # where the lowest and highest ring begin
    faces = [np.column_stack([bottom, first + ahead, first + here])]
    for low in range(first, last, sections):
        high = low + sections
        faces.append(np.column_stack([low + here, low + ahead, high + ahead]))
        faces.append(np.column_stack([low + here, high + ahead, high + here]))
    faces.append(np.column_stack([top, last + here, last + ahead]))
    return np.concatenate([poles, *rings]), np.concatenate(faces)


@cache
def sphere(subdivisions: int) -> Mesh:
    """Return a ball of radius 1: an icosahedron whose faces are divided in four some times.

    It is made once, for each person that moves has several; nobody may change it.
    """
    golden = (1 + 5**0.5) / 2
    corners = [np.roll((0, a, b), k) for k in range(3) for a in (-1, 1) for b in (-golden, golden)]
    vertices = np.array(corners) / np.hypot(1, golden)
    edge = np.linalg.norm(vertices[:, np.newaxis] - vertices, axis=2)
    is_edge = (edge > 0) & (edge < 1.1 * edge[edge > 0].min())
    found = [
        (i, j, k) if np.linalg.det(vertices[[i, j, k]]) > 0 else (i, k, j)
        for i, j, k in itertools.combinations(range(12), 3)
        if is_edge[i, j] and is_edge[j, k] and is_edge[i, k]
    ]
    faces = np.array(found)
    for _ in range(subdivisions):
        vertices, faces = _divided(vertices, faces)
    for array in (vertices, faces):
        array.flags.writeable = False
    return vertices, faces


def _divided(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Mesh:
    """Return four triangles for each on a ball, with new corners at the middles of its sides."""
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, places = np.unique(sides, axis=0, return_inverse=True)
    middles = vertices[edges].mean(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    a, b, c = faces.T
    ab, bc, ca = len(vertices) + places.reshape(-1, 3).T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    divided = np.concatenate([np.column_stack(part) for part in parts])
    return np.concatenate([vertices, middles]), divided
