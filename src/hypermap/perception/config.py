"""How one frame is turned into an observation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

Method = Literal["enclosed", "organised", "unorganised"]


@dataclass(frozen=True)
class PerceptionConfig:
    """Settings of segmentation and footprints; the defaults are the best that we know.

    Attributes:
        method: "enclosed" takes the surfaces that end within the box; "organised" takes the largest
            smooth region, with neighbors looked up in the image; "unorganised" is the slow
            reference for it, which looks for them in a k-d tree of all points as PCL does.
        depth_noise: standard deviation of the depth divided by its square, for "enclosed" [1/m];
            a Kinect's is 0.0015 to 0.002.
        max_gap: jump in depth between neighboring pixels, noise apart, at which one thing ends
            and another begins, for "enclosed" [m].
        min_inside: share of a surface that must be within the box for it to belong to the object,
            for "enclosed"; boxes are seldom quite large enough.
        min_own_border: share of a surface's jumps in depth at which it must be the nearer side, for
            "enclosed"; what ends only behind other things is background.
        max_offset: how much nearer or farther an object's parts may be than its main part, as a
            multiple of the box's larger side, for "enclosed": things are about as deep as wide.
        max_cut: share of its outline at which a surface may run on past the box that cuts the
            object out of it, if the box encloses none, for "enclosed"; 0 cuts nothing out.
        min_support: neighbors in the image, of eight, that must be as far away as a pixel between a
            nearer and a farther one, for it not to be a flying pixel; 0 keeps all.
        min_top: what does not rise above the floor, z = 0, by more than this is a piece of the
            floor, as where a detector takes a shadow for a thing [m]; 0 keeps it.
        smoothing: pixels to each side over which the depth of an object's surfaces is averaged, for
            "enclosed"; 0 leaves the points as they were measured.
        normal_neighbors: nearest points that a surface normal is fitted to, the point included.
        region_neighbors: nearest points of the same object to which a region may grow from a
            point, the point included; up to `normal_neighbors`.
        smoothness_deg: largest angle between the normals of what joins: two points, or two planes
            for "enclosed" [degrees].
        curvature_threshold: a region does not grow on from a point above it, 0 flat .. 1/3.
        min_cluster: points below which a region is noise.
        max_cluster: points above which a region is no object.
        voxel_size: side of the floor's cells whose centroids make up a footprint [m].
        visible_step: every n-th row and column of the image makes up the visible area.
        min_score: detections below it are left out, 0..1.
        max_detections: detections of a frame; of more, those with the best scores count.
        min_depth: points nearer than this take no part [m].
        max_depth: points farther than this take no part, in the visible area neither [m].
    """

    method: Method = "enclosed"
    depth_noise: float = 0.002
    max_gap: float = 0.03
    min_inside: float = 0.8
    min_own_border: float = 0.2
    max_offset: float = 0.4
    max_cut: float = 0.5
    min_support: int = 4
    min_top: float = 0.05
    smoothing: int = 2
    normal_neighbors: int = 50
    region_neighbors: int = 30
    smoothness_deg: float = 20.0
    curvature_threshold: float = 1.0
    min_cluster: int = 50
    max_cluster: int = 1_000_000
    voxel_size: float = 0.01
    visible_step: int = 2
    min_score: float = 0.3
    max_detections: int = 200
    min_depth: float = 0.0
    max_depth: float = 5.0

    def __post_init__(self) -> None:
        if self.method not in get_args(Method):
            methods = ", ".join(get_args(Method))
            raise ValueError(f"method must be one of {methods}, got {self.method!r}")
        _check("depth_noise", self.depth_noise, 0, 1)
        _check("max_gap", self.max_gap, 0, math.inf)
        _check("min_inside", self.min_inside, 0, 1)
        _check("min_own_border", self.min_own_border, 0, 1)
        _check("max_offset", self.max_offset, 0, math.inf)
        _check("max_cut", self.max_cut, 0, 1)
        _check("min_support", self.min_support, 0, 8)
        _check("min_top", self.min_top, 0, math.inf)
        _check("smoothing", self.smoothing, 0, 20)
        _check("normal_neighbors", self.normal_neighbors, 3, 1000)
        _check("region_neighbors", self.region_neighbors, 2, self.normal_neighbors)
        _check("smoothness_deg", self.smoothness_deg, 0, 90)
        _check("curvature_threshold", self.curvature_threshold, 0, math.inf)
        _check("min_cluster", self.min_cluster, 1, math.inf)
        _check("max_cluster", self.max_cluster, self.min_cluster, math.inf)
        _check("voxel_size", self.voxel_size, 1e-4, 10)
        _check("visible_step", self.visible_step, 1, math.inf)
        _check("min_score", self.min_score, 0, 1)
        _check("max_detections", self.max_detections, 0, math.inf)
        _check("min_depth", self.min_depth, 0, math.inf)
        _check("max_depth", self.max_depth, self.min_depth, math.inf)

    @classmethod
    def thesis(cls) -> PerceptionConfig:
        """Return the settings of the first Hypermap program, with the fast form of its method.

        `method="unorganised"` is its method to the letter.
        """
        return cls(
            method="organised",
            min_support=0,
            min_top=0.0,
            visible_step=1,
            min_score=0.0,
            max_depth=math.inf,
        )


def _check(name: str, value: float, lowest: float, highest: float) -> None:
    if not lowest <= value <= highest:  # also false for NaN
        raise ValueError(f"{name} must be between {lowest:g} and {highest:g}, got {value!r}")
