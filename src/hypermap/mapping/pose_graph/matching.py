"""Matches views of a drive to each other: directly, or after a search."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from hypermap.mapping.pose_graph.planar import Array, apply, between, compose, inverse, wrapped
from hypermap.mapping.pose_graph.registration import register
from hypermap.mapping.pose_graph.search import Surroundings
from hypermap.mapping.pose_graph.view import View

_AHEAD = 2.0  # meters from a camera to what it looks at, about
_ENOUGH_OVERLAP = 0.5  # of the later view; with less, the reverse registration may be better
_LEAST_OVERLAP, _LEAST_AGREEMENT = 0.25, 0.85
_PART = 1.5  # meters traveled around a view; their surfaces are searched together
_MOST_PART = 15  # views before and after it, at most
_LEAST_SCORE = 0.4
_MOST_OTHER = 0.9  # largest score of another place, as a share of the best score
_LEAST_REACH = np.array([0.2, 0.1])  # of a search [m, rad]
_FEWEST_MATCHES = 2  # that must agree on the pose of a view
_AGREE = 0.1, 0.035  # [m, rad]

Match: TypeAlias = "tuple[int, int, Array, Array]"
"""Views a and b, `a_T_b`, shape (3,), and the inverse of its covariance, shape (3, 3)."""


def looked_at(poses: Array) -> Array:
    """Return the points at which cameras look, shape (..., 2), by their poses, shape (..., 3)."""
    ahead = np.stack([np.cos(poses[..., 2]), np.sin(poses[..., 2])], axis=-1)
    return np.asarray(poses[..., :2] + _AHEAD * ahead)


class Matcher:
    """Matches views, to which more may be added between calls."""

    def __init__(self, views: Sequence[View], ways: Sequence[float]) -> None:
        """Prepare to match.

        Args:
            views: in order of time.
            ways: distance traveled to each [m].
        """
        self._views, self._ways = views, ways

    def match(self, poses: Array, a: int, b: int, map_T_b: Array | None = None) -> Match | None:
        """Register two views; None unless they surely show the same place.

        Args:
            poses: approximate poses of all views, shape (N, 3).
            a: a view.
            b: another view.
            map_T_b: another approximate pose of b, shape (3,).
        """
        start = between(poses[a], poses[b] if map_T_b is None else map_T_b)
        found = register(self._views[a], self._views[b], start)
        if found is None or found.overlap < _ENOUGH_OVERLAP:
            back = register(self._views[b], self._views[a], inverse(start))
            if back is not None and (found is None or back.overlap > found.overlap):
                a, b, found = b, a, back
        if found is None or found.overlap < _LEAST_OVERLAP or found.agreement < _LEAST_AGREEMENT:
            return None
        return a, b, found.a_T_b, found.information

    def find(self, poses: Array, a: int, b: int, reach: Array) -> list[Match]:
        """Search for a view around another one, and return its matches there.

        No matches if it is not found, may as well be elsewhere, or its matches do not agree.

        Args:
            poses: approximate poses of the views, shape (N, 3).
            a: a view of the place.
            b: the newest view.
            reach: largest error of its pose [m, rad], shape (2,).
        """
        start, reach = between(poses[a], poses[b]), np.maximum(reach, _LEAST_REACH)
        part = self._part(a)
        known, sought = self._surfaces(poses, a, part), self._surfaces(poses, b, self._part(b))
        if not len(known) or not len(sought):  # as in a hall whose walls are out of range
            return []
        found = Surroundings(known).place_of(sought, start, reach, _LEAST_SCORE)
        if found is None or found.other > _MOST_OTHER * found.score:
            return []
        map_T_b = compose(poses[a], found.a_T_b)
        tried = [self.match(poses, c, b, map_T_b) for c in part]
        return self.agreeing(poses, [match for match in tried if match is not None], b)[0]

    @staticmethod
    def agreeing(
        poses: Array, matches: Sequence[Match], b: int
    ) -> tuple[list[Match], Array | None]:
        """Return the matches of a view that agree on its pose, and this pose, shape (3,).

        An empty list and None if there are too few.

        Args:
            poses: of the views, shape (N, 3).
            matches: of the view with others.
            b: the view.
        """
        if len(matches) < _FEWEST_MATCHES:
            return [], None
        places = np.array(
            [
                compose(poses[c], c_T_d) if d == b else compose(poses[d], inverse(c_T_d))
                for c, d, c_T_d, _ in matches
            ]
        )
        middle = np.append(np.median(places[:, :2], axis=0), places[0, 2])
        middle[2] += np.median(wrapped(places[:, 2] - middle[2]))
        dx, dy, turn = np.abs(places - middle).T
        agrees = (np.hypot(dx, dy) < _AGREE[0]) & (np.abs(wrapped(turn)) < _AGREE[1])
        if np.count_nonzero(agrees) < _FEWEST_MATCHES:
            return [], None
        return [match for match, does in zip(matches, agrees, strict=True) if does], middle

    def _part(self, a: int) -> list[int]:
        """Return the views of the drive just before and after one of them."""
        around = range(max(0, a - _MOST_PART), min(len(self._views), a + _MOST_PART + 1))
        return [c for c in around if abs(self._ways[c] - self._ways[a]) < _PART]

    def _surfaces(self, poses: Array, a: int, part: Sequence[int]) -> Array:
        """Return points of the upright surfaces of some views in the frame of one, (N, 3)."""
        surfaces = []
        for c in part:
            points = self._views[c].upright[::2].astype(np.float64)
            points[:, :2] = apply(between(poses[a], poses[c]), points[:, :2])
            surfaces.append(points)
        return np.concatenate(surfaces)
