"""The settings of each stage of mapping, with their ranges, and all their defaults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True)
class KeyframeConfig:
    """When a frame is a keyframe: the camera has moved or rotated enough since the last one.

    Attributes:
        min_distance: distance between camera positions [m].
        min_angle_deg: angle between camera orientations [degrees].
        look_again: after how long a camera at rest gives the next keyframe [s]; then after twice
            as long, and so on up to a minute; 0 for never.
    """

    min_distance: float = 0.05
    min_angle_deg: float = 2.0
    look_again: float = 1.0

    def __post_init__(self) -> None:
        _check(self, "min_distance", low=0)
        _check(self, "min_angle_deg", low=0, high=180)
        _check(self, "look_again", low=0)


@dataclass(frozen=True)
class AlignmentConfig:
    """How poses are corrected by an occupancy map that is known from the start; see `Aligner`.

    Attributes:
        enabled: whether poses are corrected.
        position: standard deviation of the error of a pose in x and in y [m].
        yaw_deg: standard deviation of the error of its heading [degrees].
        max_distance: points farther than this from a border of the map's free space are not in the
            map, and ignored [m].
        min_height: lowest height of used points above the floor [m].
        max_height: highest height of used points above the floor [m].
        max_range: greatest depth of used points [m].
    """

    enabled: bool = True
    position: float = 0.05
    yaw_deg: float = 1.5
    max_distance: float = 0.1
    min_height: float = 0.1
    max_height: float = 1.8
    max_range: float = 5.0

    def __post_init__(self) -> None:
        for amount in ("position", "yaw_deg", "max_distance", "max_range"):
            _check(self, amount, low=0.001)
        _check(self, "min_height")
        _check(self, "max_height")


@dataclass(frozen=True)
class PictureConfig:
    """Whether pictures of the objects are kept: at most 3 of each, of at most 20 kB.

    Attributes:
        enabled: whether pictures are kept.
        people: whether pictures of people are kept, too.
    """

    enabled: bool = True
    people: bool = False


@dataclass(frozen=True)
class EvidenceConfig:
    """How observed shapes become objects; see `EvidenceMap`.

    Attributes:
        class_sizes: "usual" ignores observed shapes that are smaller, larger or higher up than
            usual for their class; "any" does not.
        association: how to find the tracks that an observed shape belongs to: "overlap", "jaccard"
            or "radius".
        min_overlap: least overlap coefficient, for "overlap": shared area over the smaller area.
        slack: tolerance for "overlap": how far the larger of two shapes is buffered, at most a
            quarter of its size [m].
        min_jaccard: least Jaccard index, for "jaccard".
        radius: half the side of the square around the observed centroid, for "radius" [m].
        combine: "matches" merges all tracks that one observed shape matches; "overlapping" adds the
            evidence to the best match, and merges tracks whose fused shapes match.
        exclusive: whether two observed shapes of a class in one frame are two objects: they are
            never associated with one track, and tracks that many frames show together are not
            merged, nor do their published shapes by "votes" share floor.
        max_growth: with `exclusive`, tracks that any frame shows together are merged only if both
            are at most this times as long as the longest view of them, or as most views of their
            class, and likewise their area (by its square). Published parts of one object are joined
            if both are at most this times as large as most of their class. Infinite turns it off.
        fusion: how an object's shape is fused from its evidence: "votes", "best_shape" or
            "convex_hull".
        vote_share: share of the votes that a cell needs to belong to the object, for "votes".
        abstain: where a view does not vote, for "votes": on the floor "outside" its visible area,
            or also on what is "hidden" from it behind walls.
        half_weight: distance at which a view's vote has half its weight [m].
        align: footprints are aligned with the others before they vote if they are off by at most
            this [m]; 0 turns it off.
        vote_resolution: side of a voting cell [m]; coarser for objects above 128 cells.
        landmarks: whether, for the published shapes by "votes", each frame's footprints are first
            moved so that frames agree on where the objects are.
        completion: "class_depth" extends the published shape of an object seen from one side to the
            usual depth of its class, away from the cameras; "none" does not.
        class_depths: such depths by class [m], in addition to those of `completion.CLASS_DEPTHS`
            or in their place; 0 for a class that is not to be extended.
        renewal: an object's shape is fused again when its evidence has grown by this share; 0 means
            every time. Published shapes are always up to date.
        max_evidence: number of newest observations kept for each object.
        gain: existence gained by an observation.
        gain_by_score: whether the gain is multiplied by the detection's score.
        loss: existence lost by a missed detection.
        detection_rate: "estimated": a missed detection costs less for an object that is seldom
            found, for "rays"; "fixed": always the same.
        loses: which tracks can be missed: "all" in the visible area, or only "unmatched" ones,
            which this frame did not show.
        sight: the occlusion test, which decides what a frame should have shown. "area": objects in
            the visible area. "rays": objects of which the depth image could see at least half;
            without an image, the area.
        margin: how far inside the visible area an object must be to be missed [m].
        tolerance: error of the measured surface of an object, for "rays" [m].
        gone_loss: existence lost by a see-through, for "rays": rays passed through the object's
            place.
        stale_loss: the same for an object not seen for an hour, as since another drive.
        stale_miss: existence that such an object loses by a missed detection, if it was seen often;
            not where rays still end in its place.
        moves: whether an object that is gone, while one of its class and shape appears at another
            place, is the same object, moved.
        contested: existence lost by a conflict: a frame shows another class in the object's place.
        min_contested: Jaccard index from which two objects are in conflict.
        slip: Jaccard index with a confirmed track of another class from which an observed shape is
            a misclassification and ignored; and from which two published objects of different
            classes are one, whose class is decided; 1 turns this off.
        max_range: distance from the camera up to which an object can be missed [m].
        max_existence: existence never grows above this.
        confidence: of an object: "existence", the probability that it exists (see `probability`);
            "score", the mean score of its detections.
        publish_above: objects with more existence than this are in the map.
        min_probability: objects that are less probable than this, 0..1, are not in the map; 0 turns
            it off. Those that only an estimated detection rate keeps need at least 0.5; those with
            an existence above 10 need none.
        forget_below: tracks with less existence than this are pruned.
    """

    class_sizes: Literal["usual", "any"] = "usual"
    association: Literal["overlap", "jaccard", "radius"] = "overlap"
    min_overlap: float = 0.35
    slack: float = 0.05
    min_jaccard: float = 0.2
    radius: float = 0.5
    combine: Literal["overlapping", "matches"] = "overlapping"
    exclusive: bool = True
    max_growth: float = 1.3
    fusion: Literal["votes", "best_shape", "convex_hull"] = "votes"
    vote_share: float = 0.3
    abstain: Literal["hidden", "outside"] = "hidden"
    half_weight: float = 2.0
    align: float = 0.1
    vote_resolution: float = 0.005
    landmarks: bool = True
    completion: Literal["class_depth", "none"] = "class_depth"
    class_depths: Mapping[str, float] = field(default_factory=dict)
    renewal: float = 0.1
    max_evidence: int = 100
    gain: float = 1.5
    gain_by_score: bool = True
    loss: float = 0.3
    detection_rate: Literal["estimated", "fixed"] = "estimated"
    loses: Literal["unmatched", "all"] = "unmatched"
    sight: Literal["rays", "area"] = "rays"
    margin: float = 0.1
    tolerance: float = 0.15
    gone_loss: float = 1.0
    stale_loss: float = 7.0
    stale_miss: float = 3.0
    moves: bool = True
    contested: float = 0.5
    min_contested: float = 0.2
    slip: float = 0.4
    max_range: float = 4.0
    max_existence: float = 20.0
    confidence: Literal["existence", "score"] = "existence"
    publish_above: float = 2.0
    min_probability: float = 0.25
    forget_below: float = -5.0

    def __post_init__(self) -> None:
        shares = ("min_overlap", "min_jaccard", "vote_share", "min_contested", "slip")
        for share in (*shares, "min_probability"):
            _check(self, share, low=0, high=1)
        _check(self, "radius", low=0)
        _check(self, "vote_resolution", low=0.001)
        _check(self, "renewal", low=0, high=1)
        _check(self, "max_evidence", low=1, high=100_000)
        amounts = (
            "slack",
            "align",
            "gain",
            "loss",
            "margin",
            "tolerance",
            "gone_loss",
            "stale_loss",
            "stale_miss",
            "contested",
        )
        for amount in amounts:
            _check(self, amount, low=0)
        for name, depth in self.class_depths.items():
            if not 0 <= depth <= 20:
                raise ValueError(f"class_depths: {name} must be 0 to 20 m deep, got {depth:g}")
        _check(self, "max_growth", low=1, high=math.inf)
        _check(self, "half_weight", low=0.01, high=math.inf)
        _check(self, "max_range", low=0, high=math.inf)
        for level in ("max_existence", "publish_above", "forget_below"):
            _check(self, level)
        if not self.forget_below <= self.publish_above <= self.max_existence:
            raise ValueError(
                "forget_below, publish_above and max_existence must not decrease, got "
                f"{self.forget_below:g}, {self.publish_above:g}, {self.max_existence:g}"
            )


@dataclass(frozen=True)
class OccupancyConfig:
    """How depth becomes an occupancy layer; see `OccupancyMapper`.

    Attributes:
        resolution: side of a cell [m].
        min_height: points above the floor (z = 0 of the map) by less than this are floor [m].
        max_height: points higher than this are no obstacles [m].
        free_below: a ray frees the cells over which it passes lower than this [m].
        max_range: points farther than this from the camera, over the floor, are ignored [m].
        pixel_step: every n-th row and column of the depth image is used.
        min_points: points in a cell in one frame that make it a hit.
        hit: log-odds added by a hit.
        miss: log-odds subtracted by a ray through the cell.
        min_log_odds: the lower clamp.
        max_log_odds: the upper clamp.
        free_thresh: cells less likely occupied than this are published as free, 0.
        occupied_thresh: cells at least this likely occupied are published as occupied, 100;
            between the thresholds the probability is published, in percent.
        max_cells: a map that would need more cells is refused.

    Source of the log-odds: Hornung et al., OctoMap, Autonomous Robots 2013, section 5.
    """

    resolution: float = 0.05
    min_height: float = 0.1
    max_height: float = 1.8
    free_below: float = 0.3
    max_range: float = 5.0
    pixel_step: int = 2
    min_points: int = 3
    hit: float = 0.85
    miss: float = 0.4
    min_log_odds: float = -2.0
    max_log_odds: float = 3.5
    free_thresh: float = 0.35
    occupied_thresh: float = 0.65
    max_cells: int = 50_000_000

    def __post_init__(self) -> None:
        _check(self, "resolution", low=0.001)
        _check(self, "max_range", low=self.resolution, high=1000 * self.resolution)
        for count in ("pixel_step", "min_points", "max_cells"):
            _check(self, count, low=1)
        for amount in ("hit", "miss", "max_log_odds"):
            _check(self, amount, low=0)
        _check(self, "min_log_odds", high=0)
        _check(self, "min_height")
        _check(self, "max_height")
        _check(self, "free_below", low=self.min_height)
        _check(self, "free_thresh", low=0, high=self.occupied_thresh)
        _check(self, "occupied_thresh", high=1)
        if not self.min_height < self.max_height:
            raise ValueError(
                f"min_height must be less than max_height, got {self.min_height:g} and "
                f"{self.max_height:g}"
            )


def _check(config: object, name: str, low: float | None = None, high: float | None = None) -> None:
    """Raise a ValueError if a setting is not a finite number within its limits, inclusive."""
    value = getattr(config, name)
    if math.isinf(value) and value not in (low, high):
        raise ValueError(f"{name} must be finite, got {value:g}")
    if (low is not None and not value >= low) or (high is not None and not value <= high):
        limits = [f"at least {low:g}"] if low is not None else []
        limits += [f"at most {high:g}"] if high not in (None, math.inf) else []
        raise ValueError(f"{name} must be {' and '.join(limits)}, got {value:g}")
