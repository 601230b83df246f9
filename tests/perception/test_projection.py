from __future__ import annotations

import numpy as np

from hypermap.core.trajectory import pose_from_rpy, transform_points
from hypermap.perception.projection import transform


def test_points_are_moved_as_everywhere_else() -> None:
    points = np.random.default_rng(3).normal(size=(100, 3)).astype(np.float32)
    pose = pose_from_rpy(3.0, -2.0, 1.0, 0.1, -0.2, 0.3)
    np.testing.assert_array_equal(transform(pose, points), transform_points(pose, points))
    assert transform(pose, points[:0]).shape == (0, 3)
