"""Settings for turning one frame into an observation."""

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
            smooth region, with neighbors looked up in the image; "unorganised" is its slow
            reference, which finds neighbors in a k-d tree of all points as PCL does.
        depth_noise: standard deviation of the depth divided by its square, for "enclosed" [1/m];
            a Kinect's is 0.0015 to 0.002.
        max_gap: jump in depth between neighboring pixels, in addition to noise, at which one
            object ends and another begins, for "enclosed" [m]; less where the surface would be
            steeper than any that is seen well.
        min_inside: share of a surface that must be within the box for it to belong to the object,
            for "enclosed"; boxes are often a little too small.
        min_own_border: share of a surface's depth edges at which it must be the nearer side, for
            "enclosed"; a surface that ends only behind others is background.
        max_offset: how much nearer or farther an object's parts may be than its main part, as a
            multiple of the box's larger side, for "enclosed": objects are about as deep as wide.
            Parts of solid ones, as of a bowl, may be farther apart.
        max_cut: share of its outline at which a surface may continue past the box that cuts the
            object out of it, if the box encloses none, for "enclosed"; 0 cuts nothing out.
        min_fit: share of its box that the extent of an object must fill, for "enclosed", unless
            less than half of the box is measured; 0 accepts any.
        min_support: of the eight neighbors of a pixel between a nearer and a farther one, how many
            must be at its depth, for it not to be a flying pixel; 0 keeps all.
        min_top: an object whose top is within this of the floor, z = 0, is a piece of the floor and
            dropped, as where a detector takes a shadow for an object [m]; 0 keeps it.
        smoothing: pixels to each side over which the depth of an object's surfaces is averaged, for
            "enclosed"; 0 leaves the points as measured.
        normal_neighbors: nearest points that a surface normal is fitted to, including the point.
        region_neighbors: nearest points of the same object to which a region may grow from a
            point, including the point; up to `normal_neighbors`.
        smoothness_deg: largest angle between the normals of two points that join, or of two planes
            for "enclosed" [degrees].
        curvature_threshold: a region does not grow from a point above it, 0 flat .. 1/3.
        min_cluster: fewer points are noise.
        max_cluster: more points are not an object.
        voxel_size: side of the cells on the floor whose centroids form a footprint [m].
        visible_step: every n-th row and column of the image counts for the visible area.
        min_score: detections with a lower score are dropped, 0..1.
        max_detections: of more detections in a frame, only those with the best scores are used.
        min_depth: nearer points are ignored [m].
        max_depth: farther points are ignored, also for the visible area [m].
    """

    method: Method = "enclosed"
    depth_noise: float = 0.002
    max_gap: float = 0.03
    min_inside: float = 0.8
    min_own_border: float = 0.2
    max_offset: float = 0.4
    max_cut: float = 0.5
    min_fit: float = 0.25
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
        _check("min_fit", self.min_fit, 0, 1)
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
        """Return the settings of the first Hypermap program, with the fast version of its method.

        `method="unorganised"` is exactly its method.
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
