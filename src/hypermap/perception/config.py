"""How one frame is turned into an observation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

Method = Literal["organised", "unorganised"]


@dataclass(frozen=True)
class PerceptionConfig:
    """Settings of segmentation and footprints; the defaults are the best that we know.

    Attributes:
        method: "organised" looks for neighbours in the image and is fast; "unorganised" is the
            slow reference, which looks for them in a k-d tree of all points as PCL does.
        normal_neighbors: nearest points that a surface normal is fitted to, the point included.
        region_neighbors: nearest points of the same object to which a region may grow from a
            point, the point included; up to `normal_neighbors`.
        smoothness_deg: largest angle between the normals of two points that join [degrees].
        curvature_threshold: a region does not grow on from a point above it, 0 flat .. 1/3.
        min_cluster: points below which a region is noise.
        max_cluster: points above which a region is no object.
        voxel_size: side of the floor's cells whose centroids make up a footprint [m].
        min_score: detections below it are left out, 0..1.
        min_depth: points nearer than this take no part [m].
        max_depth: points farther than this take no part, in the visible area neither [m].
    """

    method: Method = "organised"
    normal_neighbors: int = 50
    region_neighbors: int = 30
    smoothness_deg: float = 20.0
    curvature_threshold: float = 1.0
    min_cluster: int = 50
    max_cluster: int = 1_000_000
    voxel_size: float = 0.01
    min_score: float = 0.3
    min_depth: float = 0.0
    max_depth: float = 5.0

    def __post_init__(self) -> None:
        if self.method not in get_args(Method):
            raise ValueError(f"method must be organised or unorganised, got {self.method!r}")
        _check("normal_neighbors", self.normal_neighbors, 3, 1000)
        _check("region_neighbors", self.region_neighbors, 2, self.normal_neighbors)
        _check("smoothness_deg", self.smoothness_deg, 0, 90)
        _check("curvature_threshold", self.curvature_threshold, 0, math.inf)
        _check("min_cluster", self.min_cluster, 1, math.inf)
        _check("max_cluster", self.max_cluster, self.min_cluster, math.inf)
        _check("voxel_size", self.voxel_size, 1e-4, 10)
        _check("min_score", self.min_score, 0, 1)
        _check("min_depth", self.min_depth, 0, math.inf)
        _check("max_depth", self.max_depth, self.min_depth, math.inf)

    @classmethod
    def thesis(cls) -> PerceptionConfig:
        """Return the settings of the first Hypermap program, with PCL's method."""
        return cls(method="unorganised", min_score=0.0, max_depth=math.inf)


def _check(name: str, value: float, lowest: float, highest: float) -> None:
    if not lowest <= value <= highest:  # also false for NaN
        raise ValueError(f"{name} must lie between {lowest:g} and {highest:g}, got {value!r}")
