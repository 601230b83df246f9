"""A pose graph in the plane, solved by sparse least squares.

Source: Grisetti, Kümmerle, Stachniss, Burgard, "A tutorial on graph-based SLAM", 2010. Edges that
may be outliers lose weight with their error by dynamic covariance scaling (Agarwal, Tipaldi,
Spinello, Stachniss, Burgard, "Robust map optimization using dynamic covariance scaling", ICRA
2013), which becomes stricter with each round (Yang, Antonante, Tzoumas, Carlone, "Graduated
non-convexity for robust spatial perception", RA-L 2020).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import splu

from hypermap.core.arrays import BoolArray
from hypermap.mapping.pose_graph.planar import Array, between, wrapped

_ROUNDS = 30
_DAMPING, _MOST_DAMPING = 1e-9, 1e3
_LEAST_INFORMATION = 1e-4  # about a direction, against division by zero
_ROOM = 256  # edges
_EDGE = np.dtype(
    [
        ("a", np.int64),
        ("b", np.int64),
        ("a_T_b", np.float64, 3),
        ("information", np.float64, (3, 3)),
        ("is_match", np.bool_),
    ]
)
_SMALL = 1e-5  # meters or radians; the iteration ends with a step below this
_PHIS = (
    1e9,
    1e3,
    1e2,
    10.0,
)  # of the rounds, from all matches to those that fit


class PoseGraph:
    """Poses and measured relative poses between them.

    Attributes:
        poses: x, y, yaw of each node [m, m, rad], shape (N, 3).
    """

    def __init__(self) -> None:
        self.poses: Array = np.empty((0, 3))
        self._count = 0
        self._edges = np.empty(_ROOM, _EDGE)  # of which `_count` are used

    def add_node(self, pose: Array) -> None:
        """Add a pose, shape (3,)."""
        self.poses = np.vstack([self.poses, pose])

    def add_edge(self, a: int, b: int, a_T_b: Array, information: Array, *, is_match: bool) -> None:
        """Add a measured relative pose, which may be an outlier.

        Args:
            a: a node.
            b: another node.
            a_T_b: x, y, yaw of b in a, shape (3,).
            information: inverse of its covariance, shape (3, 3).
            is_match: whether it is from images, and not from odometry.
        """
        if self._count == len(self._edges):
            self._edges = np.concatenate([self._edges, np.empty_like(self._edges)])
        self._edges[self._count] = a, b, a_T_b, information, is_match
        self._count += 1

    @property
    def is_match(self) -> BoolArray:
        """Which edges are from images, shape (M,)."""
        return np.asarray(self._edges["is_match"][: self._count])

    def squares(self, poses: Array) -> Array:
        """Return the squared Mahalanobis distance of each edge's error, by some poses, (M,)."""
        edges = self._edges[: self._count]
        errors = _errors(poses, edges)
        return np.asarray(np.einsum("mi,mij,mj->m", errors, edges["information"], errors))

    def uncertainty(self, b: int) -> tuple[Array, Array]:
        """Return standard deviations of each pose relative to one.

        They are those along the chain of edges with the least uncertainty, by the axes of each
        edge's first view. An error of a heading counts by the distance to the pose.

        Returns:
            Of the position [m] and of the yaw [rad], shapes (N,).
        """
        edges = self._edges[: self._count]
        x, y, yaw = np.einsum("mii->im", edges["information"])
        by_yaw = 1 / np.maximum(yaw, _LEAST_INFORMATION)
        lever = np.sum((self.poses[edges["b"], :2] - self.poses[b, :2]) ** 2, axis=1)
        by_place = 1 / np.maximum(x, _LEAST_INFORMATION) + 1 / np.maximum(y, _LEAST_INFORMATION)
        size = len(self.poses)
        found = []
        for variances in (by_place + by_yaw * lever, by_yaw):
            # The information of parallel edges adds up.
            links = sparse.csr_matrix((1 / variances, (edges["a"], edges["b"])), (size, size))
            links.data = 1 / links.data
            found.append(np.sqrt(dijkstra(links, directed=False, indices=[b])[0]))
        return found[0], found[1]

    def optimize(self) -> None:
        """Move the poses to minimize the errors of the edges; the first stays.

        At first all matches have full weight, so many that agree can correct large errors; then
        outliers lose weight round by round.
        """
        if len(self.poses) < 2 or self._count == 0:
            return
        for phi in _PHIS:
            self._optimize(phi)

    def _optimize(self, phi: float) -> None:
        """Optimize by the Levenberg-Marquardt algorithm.

        Args:
            phi: squared Mahalanobis distance from which a match loses weight.
        """
        phis = np.where(self.is_match, phi, np.inf)
        damping, (cost, weights) = _DAMPING, _robust(self.squares(self.poses), phis)
        for _ in range(_ROUNDS):
            moves = self._step(weights, damping)
            tried = self.poses.copy()
            tried[1:] += moves
            tried[:, 2] = wrapped(tried[:, 2])
            new_cost, new_weights = _robust(self.squares(tried), phis)
            if new_cost > cost * (1 + 1e-9):
                damping *= 10
                if damping > _MOST_DAMPING:
                    return
                continue
            self.poses, cost, weights = tried, new_cost, new_weights
            damping = max(damping / 10, _DAMPING)
            if np.abs(moves).max() < _SMALL:
                return

    def _step(self, weights: Array, damping: float) -> Array:
        """Return the step of all poses but the first, shape (N - 1, 3)."""
        H, gradient = _normal_equations(self.poses, self._edges[: self._count], weights)
        H = H + damping * sparse.diags(H.diagonal())
        # The elimination order for symmetric matrices, without pivoting.
        solver = splu(
            H.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        return np.asarray(solver.solve(-gradient)).reshape(-1, 3)


def _robust(squares: Array, phis: Array) -> tuple[float, Array]:
    """Return the cost of squared errors, and the weight of each edge, shape (M,)."""
    excess = squares / phis
    scale = np.minimum(1, 2 / (1 + excess))
    cost = np.where(excess > 1, squares * (3 - 1 / np.maximum(excess, 1)) / (1 + excess), squares)
    return float(cost.sum()), scale**2


def _errors(poses: Array, edges: NDArray[np.void]) -> Array:
    """Return the errors of edges: predicted minus measured, in the first's frame, shape (M, 3)."""
    errors = between(poses[edges["a"]], poses[edges["b"]]) - edges["a_T_b"]
    errors[:, 2] = wrapped(errors[:, 2])
    return np.asarray(errors)


def _normal_equations(
    poses: Array, edges: NDArray[np.void], weights: Array
) -> tuple[sparse.csc_matrix, Array]:
    """Return the matrix and gradient of all poses but the first, shape (3N - 3, ...)."""
    a, b = edges["a"], edges["b"]
    information = weights[:, np.newaxis, np.newaxis] * edges["information"]
    errors = _errors(poses, edges)
    cos, sin = np.cos(poses[a, 2]), np.sin(poses[a, 2])
    dx, dy = (poses[b, :2] - poses[a, :2]).T
    zero, one = np.zeros(len(a)), np.ones(len(a))
    by_b = np.stack([cos, sin, zero, -sin, cos, zero, zero, zero, one], axis=1).reshape(-1, 3, 3)
    by_a = -by_b.copy()
    by_a[:, 0, 2] = -sin * dx + cos * dy
    by_a[:, 1, 2] = -cos * dx - sin * dy
    gradient = np.zeros((len(poses), 3))
    blocks, rows, columns = [], [], []
    for end, jacobian in ((a, by_a), (b, by_b)):
        weighted = np.einsum("mji,mjk->mik", jacobian, information)
        np.add.at(gradient, end, np.einsum("mij,mj->mi", weighted, errors))
        for other, other_jacobian in ((a, by_a), (b, by_b)):
            blocks.append(weighted @ other_jacobian)
            rows.append(np.repeat(3 * end[:, np.newaxis] + np.arange(3), 3, axis=1))
            columns.append(np.tile(3 * other[:, np.newaxis] + np.arange(3), (1, 3)))
    size = 3 * len(poses)
    places = np.concatenate(rows).ravel(), np.concatenate(columns).ravel()
    H = sparse.coo_matrix((np.concatenate(blocks).ravel(), places), (size, size)).tocsc()
    return sparse.csc_matrix(H[3:, 3:]), np.asarray(gradient[1:].ravel())
