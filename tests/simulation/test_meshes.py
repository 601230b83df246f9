"""Bodies of triangles: closed, and of the size that geometry says."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from hypermap.simulation.meshes import Mesh, box, revolved, sphere

# A ring of n sides has the area n / 2 sin(2 pi / n).
RING = 12 * np.sin(2 * np.pi / 24)


@pytest.mark.parametrize(
    ("mesh", "volume", "vertices", "faces"),
    [
        (box((1, 2, 3)), 6.0, 8, 12),
        (revolved([(0.5, 1.0), (0.5, 3.0)], 24), 0.25 * RING * 2, 50, 96),
        # a frustum: height / 3 times (top + bottom + the root of their product)
        (revolved([(1.0, 0.0), (2.0, 1.0)], 24), RING * (1 + 4 + 2) / 3, 50, 96),
        (revolved([(1, 0), (2, 1), (1, 2)], 24), 2 * RING * (1 + 4 + 2) / 3, 74, 144),
        # of an icosahedron in a ball of radius 1
        (sphere(0), (5 / 12) * (3 + 5**0.5) * (4 / (10 + 2 * 5**0.5) ** 0.5) ** 3, 12, 20),
        (sphere(3), 4 / 3 * np.pi, 642, 1280),
    ],
)
def test_a_body_is_closed_looks_outwards_and_has_its_volume(
    mesh: Mesh, volume: float, vertices: int, faces: int
) -> None:
    assert (len(mesh[0]), len(mesh[1])) == (vertices, faces)
    body = trimesh.Trimesh(*mesh, process=False)
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.volume == pytest.approx(volume, rel=0.02 if vertices == 642 else 1e-9)


def test_all_corners_of_a_ball_lie_on_it() -> None:
    assert np.linalg.norm(sphere(3)[0], axis=1) == pytest.approx(1.0, abs=1e-12)
