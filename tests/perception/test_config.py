from __future__ import annotations

import math
from typing import Any

import pytest

from hypermap.perception.config import PerceptionConfig


def test_the_thesis_profile_takes_all_detections_and_depths_and_grows_regions() -> None:
    thesis = PerceptionConfig.thesis()
    assert thesis == PerceptionConfig(
        method="organised",
        min_support=0,
        min_top=0.0,
        visible_step=1,
        normal_neighbors=50,
        region_neighbors=30,
        smoothness_deg=20.0,
        curvature_threshold=1.0,
        min_cluster=50,
        max_cluster=1_000_000,
        voxel_size=0.01,
        min_score=0.0,
        min_depth=0.0,
        max_depth=math.inf,
    )


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            {"method": "fast"},
            "method must be one of enclosed, organised, unorganised, got 'fast'",
        ),
        ({"depth_noise": -1}, "depth_noise must be between 0 and 1, got -1"),
        ({"max_gap": math.nan}, "max_gap must be between 0 and inf, got nan"),
        ({"min_inside": 1.1}, "min_inside must be between 0 and 1, got 1.1"),
        ({"min_own_border": -0.1}, "min_own_border must be between 0 and 1, got -0.1"),
        ({"max_offset": -1}, "max_offset must be between 0 and inf, got -1"),
        ({"min_fit": -1}, "min_fit must be between 0 and 1, got -1"),
        ({"max_cut": 2}, "max_cut must be between 0 and 1, got 2"),
        ({"visible_step": 0}, "visible_step must be between 1 and inf, got 0"),
        ({"normal_neighbors": 2}, "normal_neighbors must be between 3 and 1000, got 2"),
        ({"region_neighbors": 51}, "region_neighbors must be between 2 and 50, got 51"),
        ({"smoothness_deg": 91.0}, "smoothness_deg must be between 0 and 90, got 91.0"),
        ({"curvature_threshold": -1}, "curvature_threshold must be between 0 and inf, got -1"),
        ({"min_cluster": 0}, "min_cluster must be between 1 and inf, got 0"),
        ({"max_cluster": 49}, "max_cluster must be between 50 and inf, got 49"),
        ({"voxel_size": 0.0}, "voxel_size must be between 0.0001 and 10, got 0.0"),
        ({"min_score": 1.5}, "min_score must be between 0 and 1, got 1.5"),
        ({"min_depth": math.nan}, "min_depth must be between 0 and inf, got nan"),
        ({"min_depth": 2, "max_depth": 1}, "max_depth must be between 2 and inf, got 1"),
    ],
)
def test_a_setting_out_of_range_is_named(setting: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError) as error:
        PerceptionConfig(**setting)
    assert str(error.value) == message
