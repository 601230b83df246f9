"""Builds a pose graph from the views of a drive, in order of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hypermap.core.arrays import IntArray
from hypermap.mapping.pose_graph.graph import PoseGraph
from hypermap.mapping.pose_graph.matching import Match, Matcher, looked_at
from hypermap.mapping.pose_graph.odometry import information_of
from hypermap.mapping.pose_graph.planar import Array, between, compose, wrapped
from hypermap.mapping.pose_graph.registration import vague_direction
from hypermap.mapping.pose_graph.texture import Textures, align
from hypermap.mapping.pose_graph.view import View
from hypermap.perception.frame import RgbdFrame

_RECENT = 12  # views; matches to older ones close a loop
_MOST_LOOPS = 8  # loop closures of one view
_APART = 2.0  # meters between what two matched views look at, at most
_SAME_WAY = np.radians(50)  # between their viewing directions, at most
_SURE = 0.15, np.radians(4)  # [m, rad]; up to this uncertainty, views are matched directly
_UNSURE = 6.0, np.radians(45)  # [m, rad]; beyond this uncertainty, places are not searched
_NEAR = 1.0  # meters between cameras in a search, in addition to the uncertainty
_SIGMAS = 1.5  # standard deviations, twice those of usual odometry; radius of a search
_SEARCH_EVERY = 3  # views
_MOST_SEARCHES = 3  # places searched for one view
_DIFFERENT = 1.5  # meters traveled between them
_BY_TEXTURE = 1, 3, 6, 9, 12  # views between two whose texture is compared
_UNLIKELY = 9.0  # squared Mahalanobis distance from odometry, twice as uncertain as usual
_OPTIMIZE_EVERY = 20  # views with loop closures; immediately if they do not fit


@dataclass
class LoopCounts:
    """Counts of attempts to close loops.

    Attributes:
        searched: places where a view was searched for.
        found: of these, places where it was found.
        closed: loop closures: matches of views to much earlier ones.
    """

    searched: int = 0
    found: int = 0
    closed: int = 0


class Building:
    """A pose graph that grows by views.

    Each view is matched to those just before it, and to much earlier ones that show the same place
    by its pose in the graph. If this pose is too uncertain for that, the place is searched.

    Attributes:
        graph: poses and matches.
        loops: counts of attempts to close loops.
    """

    def __init__(self) -> None:
        self.graph = PoseGraph()
        self.loops = LoopCounts()
        self._views: list[View] = []
        self._ways: list[float] = []
        self._matcher = Matcher(self._views, self._ways)
        self._textures = Textures(_RECENT + 1)
        self._since = 0  # views since all poses were optimized

    def add(self, view: View, frame: RgbdFrame) -> None:
        """Add the next view of the drive, and the frame that it shows."""
        graph, b = self.graph, len(self._views)
        self._views.append(view)
        self._textures.add(b, view, frame)
        if b == 0:
            graph.add_node(view.pose)
            self._ways.append(0.0)
            return
        step = between(self._views[b - 1].pose, view.pose)
        self._ways.append(self._ways[-1] + float(np.hypot(*step[:2])))
        graph.add_node(compose(graph.poses[b - 1], step))
        graph.add_edge(b - 1, b, step, information_of(step), is_match=False)
        self._follow(b)
        self._close_loops(b, np.arange(max(0, b - _RECENT)))

    def finish(self) -> None:
        """Optimize all poses."""
        self.graph.optimize()

    @property
    def stamps(self) -> Array:
        """The stamps of the views [s], shape (N,)."""
        return np.array([view.stamp for view in self._views])

    @property
    def given(self) -> Array:
        """Their poses as recorded, shape (N, 3)."""
        return np.array([view.pose for view in self._views]).reshape(-1, 3)

    @property
    def poses(self) -> Array:
        """Their poses in the graph, shape (N, 3)."""
        return self.graph.poses

    def match_errors(self) -> tuple[Array, Array]:
        """Return the squared Mahalanobis distances of the errors of matches, shapes (M,).

        By the recorded poses, and by those of the graph.
        """
        graph = self.graph
        return graph.squares(self.given)[graph.is_match], graph.squares(self.poses)[graph.is_match]

    def _follow(self, b: int) -> None:
        """Match a view to those just before it, and move it to where these matches agree.

        Then a wrong step of the recorded poses does not make matches look wrong.
        """
        recent = np.sort(self._that_may_share(b, np.arange(max(0, b - _RECENT), b)))
        matches = [self._by_texture(match) for match in self._matches(recent.tolist(), b)]
        self._link(matches)
        place = self._matcher.agreeing(self.poses, matches, b)[1]
        if place is not None:
            self.graph.poses[b] = place

    def _by_texture(self, match: Match) -> Match:
        """Return a match of new views, by their color images, too, if depth tells too little."""
        a, b, a_T_b, information = match
        direction = vague_direction(information)
        if direction is None or abs(a - b) not in _BY_TEXTURE:
            return match
        on, of = self._textures.of(a), self._textures.of(b)
        if on is None or of is None:
            return match
        # Along a wall, depth goes where noise leads it, which may be far.
        start = a_T_b.copy()
        start[:2] += direction * (direction @ (between(*self.poses[[a, b]]) - a_T_b)[:2])
        found = align(on, of, start, direction)
        given = between(self._views[a].pose, self._views[b].pose)
        if found is None or not _agrees(found[0], given):
            return match
        along = np.append(direction, 0.0)
        return a, b, found[0], information + np.outer(along, along) / found[1] ** 2

    def _matches(self, others: Sequence[int], b: int) -> list[Match]:
        tried = [self._matcher.match(self.poses, a, b) for a in others]
        return [match for match in tried if match is not None]

    def _link(self, matches: Sequence[Match]) -> None:
        for match in matches:
            self.graph.add_edge(*match, is_match=True)

    def _close_loops(self, b: int, earlier: IntArray) -> None:
        """Match a view to much earlier ones, and optimize all poses if this moves them."""
        near = self._that_may_share(b, earlier)
        is_turn = b % _SEARCH_EVERY == 0 and len(earlier) > 0
        if len(near) == 0 and not is_turn:
            return
        position, yaw = self.graph.uncertainty(b)
        sure = near[(position[near] < _SURE[0]) & (yaw[near] < _SURE[1])]
        matches = self._matches(_spread(sure, _MOST_LOOPS), b)
        if not matches and is_turn:
            matches = self._search(b, earlier, position, yaw)
        self._since += 1
        if not matches:
            return
        self._link(matches)
        self.loops.closed += len(matches)
        fit = self.graph.squares(self.poses)[-len(matches) :]
        if np.median(fit) > 1 or self._since > _OPTIMIZE_EVERY:
            self.graph.optimize()
            self._since = 0

    def _that_may_share(self, b: int, earlier: IntArray) -> IntArray:
        """Return the earlier views that may overlap with one, the nearest first."""
        poses = self.graph.poses
        apart = np.hypot(*(looked_at(poses[earlier]) - looked_at(poses[b])).T)
        turned = np.abs(wrapped(poses[earlier, 2] - poses[b, 2]))
        order = np.argsort(apart, kind="stable")
        order = order[(apart[order] < _APART) & (turned[order] < _SAME_WAY)]
        return np.asarray(earlier[order])

    def _search(self, b: int, earlier: IntArray, position: Array, yaw: Array) -> list[Match]:
        """Search for the place of a view, and return its matches there, none if not found."""
        poses = self.graph.poses
        apart = np.hypot(*(poses[earlier, :2] - poses[b, :2]).T)
        possible = (apart < _NEAR + _SIGMAS * position[earlier]) & (position[earlier] < _UNSURE[0])
        possible &= yaw[earlier] < _UNSURE[1]
        tried: list[int] = []
        for a in earlier[np.argsort(np.where(possible, apart, np.inf))[: possible.sum()]]:
            if any(abs(self._ways[a] - self._ways[c]) < _DIFFERENT for c in tried):
                continue
            tried.append(int(a))
            self.loops.searched += 1
            reach = _SIGMAS * np.array([position[a], yaw[a]])
            if matches := self._matcher.find(poses, int(a), b, reach):
                self.loops.found += 1
                return matches[:_MOST_LOOPS]
            if len(tried) == _MOST_SEARCHES:
                break
        return []


def _agrees(a_T_b: Array, given: Array) -> bool:
    """Return whether a relative pose is a likely one by odometry, shapes (3,)."""
    error = a_T_b - given
    error[2] = wrapped(error[2])
    return bool(error @ information_of(given) @ error < _UNLIKELY)


def _spread(chosen: IntArray, count: int) -> list[int]:
    """Return some of the views, the best first, spread over time."""
    kept: list[int] = []
    for a in chosen.tolist():
        if all(abs(a - c) > 2 for c in kept):
            kept.append(a)
        if len(kept) == count:
            break
    return kept
