"""The pose graph, without any images."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap.mapping.pose_graph.graph import PoseGraph
from hypermap.mapping.pose_graph.planar import (
    apply,
    between,
    compose,
    inverse,
    moved,
    planar,
    wrapped,
)

from .rooms import pose

SURE = np.diag([1e4, 1e4, 1e5])


def square_loop(side: int = 10) -> np.ndarray:
    """Return poses 1 m apart around a square and on to its second corner, shape (N, 3)."""
    poses = [np.zeros(3)]
    for i in range(5 * side):
        turn = np.pi / 2 if i and i % side == 0 else 0.0
        poses.append(compose(compose(poses[-1], np.array([0, 0, turn])), np.array([1.0, 0, 0])))
    return np.array(poses)


def drifting(true: np.ndarray, drift: tuple[float, float, float]) -> PoseGraph:
    """Return the graph of a drive whose odometry is off by the same in each step."""
    graph = PoseGraph()
    graph.add_node(true[0])
    for i in range(len(true) - 1):
        step = between(true[i], true[i + 1]) + drift
        graph.add_node(compose(graph.poses[i], step))
        graph.add_edge(i, i + 1, step, np.diag([1e3, 1e3, 1e4]), is_match=False)
    return graph


def farthest(graph: PoseGraph, true: np.ndarray) -> float:
    return float(np.hypot(*(graph.poses - true)[:, :2].T).max())


def test_closed_loops_take_the_drift_out_of_a_square() -> None:
    true = square_loop()
    graph = drifting(true, (0.01, 0.0, 0.004))
    assert farthest(graph, true) > 1.3
    for i in range(10):
        graph.add_edge(i, i + 40, between(true[i], true[i + 40]), SURE, is_match=True)
    graph.optimize()
    assert farthest(graph, true) < 0.2
    assert (graph.poses[0] == true[0]).all()


def test_a_false_loop_closure_is_outvoted_by_the_true_ones() -> None:
    true = square_loop()
    wrong = drifting(true, (0.01, 0.0, 0.004))
    for i in range(10):
        wrong.add_edge(i, i + 40, between(true[i], true[i + 40]), SURE, is_match=True)
    right = drifting(true, (0.01, 0.0, 0.004))
    for i in range(10):
        right.add_edge(i, i + 40, between(true[i], true[i + 40]), SURE, is_match=True)
    false = between(true[5], true[44]) + np.array([0.6, -0.4, 0.1])
    wrong.add_edge(5, 44, false, SURE, is_match=True)
    for graph in (wrong, right):
        graph.optimize()
    assert np.abs(wrong.poses - right.poses).max() < 0.02


def test_measurements_that_fit_move_nothing() -> None:
    true = square_loop()
    graph = drifting(true, (0.0, 0.0, 0.0))
    graph.add_edge(0, 40, between(true[0], true[40]), SURE, is_match=True)
    graph.optimize()
    assert graph.poses == pytest.approx(true, abs=1e-9)
    assert graph.squares(graph.poses).max() < 1e-9


def test_uncertainty_grows_with_the_way_and_falls_when_a_loop_is_closed() -> None:
    true = square_loop()
    graph = drifting(true, (0.0, 0.0, 0.0))
    position, yaw = graph.uncertainty(40)
    assert position[40] == 0
    assert position[0] > position[20] > position[39] > 0
    assert yaw[0] == pytest.approx(np.sqrt(40 * 1e-4))
    graph.add_edge(0, 40, between(true[0], true[40]), SURE, is_match=True)
    assert graph.uncertainty(40)[0][0] < 0.02


def test_edges_beyond_the_first_room_are_kept() -> None:
    graph = drifting(square_loop(80), (0.0, 0.0, 0.0))
    assert len(graph.is_match) == 400
    assert graph.squares(graph.poses).max() < 1e-9


def test_planar_poses_compose_and_invert() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 50, 3)) * [5, 5, 2]
    assert compose(a, between(a, b))[:, :2] == pytest.approx(b[:, :2])
    assert wrapped(compose(a, between(a, b))[:, 2] - b[:, 2]) == pytest.approx(0, abs=1e-12)
    assert compose(a, inverse(a)) == pytest.approx(0, abs=1e-12)
    assert apply(a[0], b[:, :2]) == pytest.approx(
        np.array([compose(a[0], np.append(xy, 0.0))[:2] for xy in b[:, :2]])
    )


def test_a_pose_in_space_moves_over_the_floor_as_its_planar_one() -> None:
    before = pose(1, 2, 30)
    after = moved(before, planar(before), np.array([3.0, -1.0, -2.0]))
    assert planar(after) == pytest.approx([3.0, -1.0, -2.0])
    assert after[2] == pytest.approx(before[2])  # height, roll and pitch
    straight_down = np.array([[1.0, 0, 0, 1], [0, -1, 0, 2], [0, 0, -1, 3], [0, 0, 0, 1]])
    turned = moved(
        straight_down, planar(straight_down), planar(straight_down) + np.array([0, 0, 0.5])
    )
    assert planar(turned)[2] - planar(straight_down)[2] == pytest.approx(0.5)
