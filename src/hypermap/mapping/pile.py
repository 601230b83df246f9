"""What was seen of one object, observation by observation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray
from hypermap.perception.observation import Observation, ObservedObject


@dataclass(frozen=True, eq=False)
class Evidence:
    """One observed shape, with the view from which it was seen.

    The camera's pose and the stamp stay with it, so that a corrected trajectory can move it.

    Attributes:
        stamp: time of the frame [s].
        map_T_camera: pose of the camera's optical frame in the map, shape (4, 4).
        visible_area: polygon in the map frame [m] that the frame could have seen; see `of`.
        score: the detector's, 0..1.
        footprint: polygon in the map frame [m].
        centroid_xy: the footprint's centroid [m], shape (2,).
        z_min: height of the lowest point [m].
        z_max: height of the highest point [m].
    """

    stamp: float
    map_T_camera: NDArray[np.float64]
    visible_area: BaseGeometry
    score: float
    footprint: BaseGeometry
    centroid_xy: NDArray[np.float64]
    z_min: float
    z_max: float

    @classmethod
    def of(
        cls,
        observed: ObservedObject,
        observation: Observation,
        abstain: Literal["hidden", "outside"] = "outside",
    ) -> Evidence:
        """Return what one object of an observation is evidence of.

        Args:
            observed: the object.
            observation: the frame that shows it.
            abstain: "outside": the frame has seen all of its visible area; "hidden": what lies
                behind walls it has not seen.
        """
        area = observation.visible_area
        view = observation.view
        if abstain == "hidden" and view is not None and view.is_level:
            area = view.ground
        return cls(
            stamp=observation.stamp,
            map_T_camera=observation.map_T_camera,
            visible_area=area,
            score=observed.score,
            footprint=observed.footprint,
            centroid_xy=shapely.get_coordinates(shapely.centroid(observed.footprint))[0],
            z_min=observed.z_min,
            z_max=observed.z_max,
        )


class Pile:
    """The newest evidence for one object, at most `limit` pieces, and figures about all of it.

    Attributes:
        items: what is kept, oldest first.
        centroids: of the kept footprints [m], shape (N, 2).
        count: how many pieces there were altogether.
        score_sum: the sum of all their scores.
        first_seen: the oldest stamp of all [s].
        last_seen: the newest stamp of all [s].
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._heights: tuple[float, float] | None = None
        self.items: list[Evidence] = []
        self.centroids = np.empty((0, 2))
        self.count = 0
        self.score_sum = 0.0
        self.first_seen = np.inf
        self.last_seen = -np.inf

    def __len__(self) -> int:
        return len(self.items)

    def add(self, evidence: Evidence) -> None:
        """Put one piece on top; the lowest one goes when the pile is full."""
        self.items.append(evidence)
        self.centroids = np.vstack([self.centroids, evidence.centroid_xy])[-self._limit :]
        del self.items[: -self._limit]
        self._count(1, evidence.score, evidence.stamp, evidence.stamp)

    def merge(self, others: Iterable[Pile]) -> None:
        """Take over all evidence of other piles, in order of time."""
        for other in others:
            self.items.extend(other.items)
            self._count(other.count, other.score_sum, other.first_seen, other.last_seen)
        self.items = sorted(self.items, key=lambda evidence: evidence.stamp)[-self._limit :]
        self.centroids = np.array([evidence.centroid_xy for evidence in self.items])

    def distances(self) -> NDArray[np.float64]:
        """Return how far each kept footprint was from its camera [m], shape (N,)."""
        cameras = np.array([evidence.map_T_camera[:2, 3] for evidence in self.items])
        return np.asarray(np.hypot(*(self.centroids - cameras).T))

    def footprints(self) -> ObjectArray:
        """Return the kept footprints, shape (N,)."""
        return np.array([evidence.footprint for evidence in self.items], dtype=object)

    def heights(self) -> tuple[float, float]:
        """Return the usual lowest and highest point of the kept evidence [m] (medians)."""
        if self._heights is None:
            z = np.median([(evidence.z_min, evidence.z_max) for evidence in self.items], axis=0)
            self._heights = float(z[0]), float(z[1])
        return self._heights

    def _count(self, count: int, score: float, first: float, last: float) -> None:
        self._heights = None
        self.count += count
        self.score_sum += score
        self.first_seen = min(self.first_seen, first)
        self.last_seen = max(self.last_seen, last)
