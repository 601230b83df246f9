"""The evidence behind the objects of a semantic layer: observations and camera poses."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray
from hypermap.core.tangles import has_empty_hole

_FAR = 1e9  # meters; the farthest place of an object
_DECIMALS = 4  # of meters
_SCORE_DECIMALS = 6
_POSE_DECIMALS = 9
_NEAR = 0.1  # meters; a camera so near has no direction
_ONE_SIDED = 0.75  # length of the mean direction of view: 1 from one place, 0 from all around


@dataclass(frozen=True, eq=False)
class EvidenceTable:
    """Observations of objects as columns, and the views in which they were made.

    One view may show several objects. It keeps its pose, so that a corrected trajectory can
    move the observations. All coordinates are in the layer's frame.

    Attributes:
        object_ids: which object each observation is evidence of, int64, shape (N,).
        views: row of the view in which it was made, int64, shape (N,).
        scores: the detector's, 0..1, shape (N,).
        footprints: the observed polygons [m], shape (N,).
        heights: lowest and highest point [m], shape (N, 2).
        stamps: time of each view [s], shape (V,).
        poses: map_T_camera of each view's optical frame, shape (V, 4, 4).
        areas: the visible area of each view, polygons [m], may be empty, shape (V,).

    Raises:
        ValueError: If the columns do not match, a number is not finite or absurdly large,
            or a footprint has no points.
    """

    object_ids: NDArray[np.int64]
    views: NDArray[np.int64]
    scores: NDArray[np.float64]
    footprints: ObjectArray
    heights: NDArray[np.float64]
    stamps: NDArray[np.float64]
    poses: NDArray[np.float64]
    areas: ObjectArray

    def __post_init__(self) -> None:
        count, view_count = len(self.object_ids), len(self.stamps)
        expected = {
            "object_ids": (count,),
            "views": (count,),
            "scores": (count,),
            "footprints": (count,),
            "heights": (count, 2),
            "stamps": (view_count,),
            "poses": (view_count, 4, 4),
            "areas": (view_count,),
        }
        for name, shape in expected.items():
            column = getattr(self, name)
            if column.shape != shape:
                raise ValueError(f"{name} must have shape {shape}, got {column.shape}")
            if column.dtype.kind == "f" and not np.isfinite(column).all():
                raise ValueError(f"{name} must be finite")
            if name in ("scores", "heights", "poses") and np.abs(column).max(initial=0) > _FAR:
                raise ValueError(f"{name} must be within {_FAR:g}")  # more cannot be rounded
        if count and not (self.views.min() >= 0 and self.views.max() < view_count):
            raise ValueError(f"views must be rows of the {view_count} views")
        if shapely.is_empty(self.footprints).any():
            raise ValueError("a footprint must not be empty")
        for shapes in (self.footprints, self.areas):
            if not np.abs(shapely.get_coordinates(shapes)).max(initial=0) <= _FAR:
                raise ValueError(f"shapes must be finite and within {_FAR:g} m")
            if has_empty_hole(shapes).any():
                raise ValueError("a hole of a shape must have corners; leave out the empty hole")

    @classmethod
    def empty(cls) -> EvidenceTable:
        """Return a table without observations."""
        none, nothing = np.empty(0), np.empty(0, dtype=object)
        ids = np.empty(0, dtype=np.int64)
        return cls(
            ids, ids, none, nothing, none.reshape(0, 2), none, none.reshape(0, 4, 4), nothing
        )

    def __len__(self) -> int:
        """Return how many observations there are."""
        return len(self.object_ids)

    def of(self, object_ids: Iterable[int]) -> EvidenceTable:
        """Return the observations of some objects, with their views.

        The geometries are copies, so that each thread can prepare its own.
        """
        wanted = np.fromiter(object_ids, dtype=np.int64)
        rows = np.flatnonzero(np.isin(self.object_ids, wanted))
        views, view_of_row = np.unique(self.views[rows], return_inverse=True)
        return EvidenceTable(
            object_ids=self.object_ids[rows],
            views=view_of_row.astype(np.int64),
            scores=self.scores[rows],
            footprints=np.asarray(shapely.force_2d(self.footprints[rows])),
            heights=self.heights[rows],
            stamps=self.stamps[views],
            poses=self.poses[views],
            areas=np.asarray(shapely.force_2d(self.areas[views])),
        )

    def rounded(self) -> EvidenceTable:
        """Return a table rounded as in files: lengths to 0.1 mm, scores to 1e-6, poses to 1e-9."""
        return EvidenceTable(
            object_ids=self.object_ids,
            views=self.views,
            scores=np.round(self.scores, _SCORE_DECIMALS),
            footprints=_rounded(self.footprints),
            heights=np.round(self.heights, _DECIMALS),
            stamps=self.stamps,
            poses=np.round(self.poses, _POSE_DECIMALS),
            areas=_rounded(self.areas),
        )


def mean_view(
    center_xy: NDArray[np.float64], cameras_xy: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the mean of the directions from which a place was seen, of length 1 each, shape (2,).

    Args:
        center_xy: the place [m], shape (2,).
        cameras_xy: from where it was seen [m], shape (N, 2).
    """
    views = center_xy - cameras_xy
    lengths = np.hypot(*views.T)
    is_far = lengths > _NEAR
    if not is_far.any():
        return np.zeros(2)
    return np.asarray((views[is_far] / lengths[is_far, np.newaxis]).mean(axis=0))


def is_one_sided(center_xy: NDArray[np.float64], cameras_xy: NDArray[np.float64]) -> bool:
    """Return whether a place was seen from one side alone; arguments as for `mean_view`."""
    return bool(np.hypot(*mean_view(center_xy, cameras_xy)) >= _ONE_SIDED)


def _rounded(shapes: ObjectArray) -> ObjectArray:
    rounded: ObjectArray = shapely.transform(shapes, lambda xy: np.round(xy, _DECIMALS) + 0.0)
    return rounded
