"""Matches views of a drive to each other: directly, or after one was looked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from hypermap.mapping.pose_graph.planar import Array, apply, between, compose, inverse, wrapped
from hypermap.mapping.pose_graph.registration import register
from hypermap.mapping.pose_graph.search import Surroundings
from hypermap.mapping.pose_graph.view import View

_AHEAD = 2.0  # meters from a camera to what it looks at
_ENOUGH_OVERLAP = 0.5  # of the later view; with less, the other way round may be better
_LEAST_OVERLAP, _LEAST_AGREEMENT = 0.25, 0.85
_PART = 1.5  # meters of way about a view whose surfaces are looked for together
_MOST_PART = 15  # views before and after it
_LEAST_SCORE = 0.4
_MOST_OTHER = 0.9  # share of the score that the best place elsewhere has, at most
_LEAST_REACH = np.array([0.2, 0.1])  # of a search [m, rad]
_FEWEST_MATCHES = 2  # that agree on where a view is
_AGREE = 0.1, 0.035  # [m, rad]

Match: TypeAlias = "tuple[int, int, Array, Array]"
"""A view, another one, where this is in the first, and the information of that."""


def looked_at(poses: Array) -> Array:
    """Return about where cameras look, shape (..., 2), by their poses, shape (..., 3)."""
    ahead = np.stack([np.cos(poses[..., 2]), np.sin(poses[..., 2])], axis=-1)
    return np.asarray(poses[..., :2] + _AHEAD * ahead)


class Matcher:
    """Matches views, of which there may be more each time."""

    def __init__(self, views: Sequence[View], ways: Sequence[float]) -> None:
        """Prepare to match.

        Args:
            views: in order of time.
            ways: from the beginning to each [m].
        """
        self._views, self._ways = views, ways

    def match(self, poses: Array, a: int, b: int, map_T_b: Array | None = None) -> Match | None:
        """Return how two views lie on each other; None unless they surely show the same.

        Args:
            poses: where they are, about, shape (N, 3).
            a: a view.
            b: another one.
            map_T_b: where this is instead, shape (3,).
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
        """Return matches of a view to the place of another one, after looking for it there.

        None if it is not found, may as well be elsewhere, or its matches do not agree.

        Args:
            poses: where views are, about, shape (N, 3).
            a: a view of the place.
            b: the newest view.
            reach: how far it may be from its pose [m, rad], shape (2,).
        """
        start, reach = between(poses[a], poses[b]), np.maximum(reach, _LEAST_REACH)
        part = self._part(a)
        surroundings = Surroundings(self._surfaces(poses, a, part))
        sought = self._surfaces(poses, b, self._part(b))
        found = surroundings.place_of(sought, start, reach, _LEAST_SCORE)
        if found is None or found.other > _MOST_OTHER * found.score:
            return []
        map_T_b = compose(poses[a], found.a_T_b)
        tried = [self.match(poses, c, b, map_T_b) for c in part]
        return self.agreeing(poses, [match for match in tried if match is not None], b)[0]

    @staticmethod
    def agreeing(
        poses: Array, matches: Sequence[Match], b: int
    ) -> tuple[list[Match], Array | None]:
        """Return those matches of a view by which it is at the same place, and this place.

        None, and no place, if there are too few.

        Args:
            poses: where views are, shape (N, 3).
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
        """Return the views of the drive about one of them."""
        around = range(max(0, a - _MOST_PART), min(len(self._views), a + _MOST_PART + 1))
        return [c for c in around if abs(self._ways[c] - self._ways[a]) < _PART]

    def _surfaces(self, poses: Array, a: int, part: Sequence[int]) -> Array:
        """Return points of the upright surfaces of some views, seen from one, shape (N, 3)."""
        surfaces = []
        for c in part:
            points = self._views[c].upright[::2].astype(np.float64)
            points[:, :2] = apply(between(poses[a], poses[c]), points[:, :2])
            surfaces.append(points)
        return np.concatenate(surfaces)
