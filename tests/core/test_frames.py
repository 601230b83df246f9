from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st

from hypermap.core.arrays import as_objects
from hypermap.core.errors import FrameError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.testing.strategies import points, polygons, poses

# Worked out on paper: turn by 90 degrees, then shift by (1, 2).
TURNED = Pose2D(1.0, 2.0, math.pi / 2)


@pytest.mark.parametrize(
    ("child", "parent"), [((0, 0), (1, 2)), ((3, 0), (1, 5)), ((0, 3), (-2, 2)), ((-1, 1), (0, 1))]
)
def test_a_pose_takes_points_of_the_child_to_the_parent(child, parent) -> None:
    np.testing.assert_allclose(TURNED.apply(child), [parent], atol=1e-12)


@given(poses, points())
@example(Pose2D(1.0, 2.0, 1.0), np.array([[3.0, 4.0]]))
def test_a_pose_does_what_its_matrix_does(pose: Pose2D, xy: np.ndarray) -> None:
    homogeneous = np.column_stack([xy, np.ones(len(xy))])
    np.testing.assert_allclose(pose.apply(xy), (homogeneous @ pose.matrix().T)[:, :2], atol=1e-9)


@given(poses, points())
def test_the_inverse_undoes_a_pose(pose: Pose2D, xy: np.ndarray) -> None:
    np.testing.assert_allclose(pose.inverse().apply(pose.apply(xy)), xy, atol=1e-9)
    np.testing.assert_allclose((pose @ pose.inverse()).matrix(), np.eye(3), atol=1e-9)


@given(poses, poses, poses, points())
def test_poses_compose_like_functions(a: Pose2D, b: Pose2D, c: Pose2D, xy: np.ndarray) -> None:
    np.testing.assert_allclose((a @ b).apply(xy), a.apply(b.apply(xy)), atol=1e-9)
    np.testing.assert_allclose(((a @ b) @ c).matrix(), (a @ (b @ c)).matrix(), atol=1e-9)


@given(poses, points(min_size=2, max_size=2))
def test_distances_do_not_change(pose: Pose2D, xy: np.ndarray) -> None:
    moved = pose.apply(xy)
    before, after = np.hypot(*(xy[0] - xy[1])), np.hypot(*(moved[0] - moved[1]))
    assert after == pytest.approx(before, abs=1e-9)


@given(poses, poses)
def test_the_yaw_of_a_product_stays_within_half_a_turn(a: Pose2D, b: Pose2D) -> None:
    assert -math.pi <= (a @ b).yaw <= math.pi


@given(poses, polygons())
def test_a_geometry_moves_with_its_points(pose: Pose2D, polygon: shapely.Polygon) -> None:
    moved = pose.apply_geometry(polygon)
    assert moved.area == pytest.approx(polygon.area)
    np.testing.assert_allclose(
        shapely.get_coordinates(moved), pose.apply(shapely.get_coordinates(polygon))
    )
    (also,) = pose.apply_geometries(as_objects([polygon]))
    assert also.equals(moved)


def test_no_geometries_stay_none() -> None:
    assert TURNED.apply_geometries(as_objects([])).shape == (0,)


def test_the_result_never_shares_memory_with_the_argument() -> None:
    given_points = np.zeros((2, 2))
    for pose in (Pose2D(), TURNED):
        pose.apply(given_points)[:] = 7
        assert (given_points == 0).all()


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_pose_must_be_finite(bad: float) -> None:
    for values in ((bad, 0, 0), (0, bad, 0), (0, 0, bad)):
        with pytest.raises(ValueError, match="a pose must be finite"):
            Pose2D(*values)


# A building: two floors below the map, rooms below the floors, and a place apart.
BUILDING = [
    Transform("map", "floor", Pose2D(10.0, 0.0, math.pi / 2)),
    Transform("floor", "lab", Pose2D(1.0, 0.0, 0.0)),
    Transform("map", "cellar", Pose2D(0.0, -5.0, math.pi)),
    Transform("moon", "crater", Pose2D(1.0, 1.0, 0.0)),
]


@pytest.mark.parametrize(
    ("target", "source", "point", "expected"),
    [
        ("map", "map", (1, 2), (1, 2)),
        ("map", "floor", (1, 0), (10, 1)),
        ("map", "lab", (1, 0), (10, 2)),
        ("lab", "map", (10, 2), (1, 0)),
        ("cellar", "lab", (0, 0), (-10, -6)),
        ("lab", "cellar", (-10, -6), (0, 0)),
        ("moon", "crater", (0, 0), (1, 1)),
    ],
)
def test_look_ups_go_up_and_down_the_tree(target, source, point, expected) -> None:
    tree = FrameTree(BUILDING)
    np.testing.assert_allclose(tree.lookup(target, source).apply(point), [expected], atol=1e-12)


@given(st.lists(poses, min_size=1, max_size=5), st.data())
def test_any_two_frames_of_a_tree_look_at_each_other(all_poses, data) -> None:
    tree = FrameTree()
    for i, pose in enumerate(all_poses):
        parent = data.draw(st.sampled_from(["root", *(f"f{j}" for j in range(i))]))
        tree.add(Transform(parent, f"f{i}", pose))
    a, b, c = (data.draw(st.sampled_from(tree.frames)) for _ in range(3))
    there_and_back = tree.lookup(a, b) @ tree.lookup(b, a)
    np.testing.assert_allclose(there_and_back.matrix(), np.eye(3), atol=1e-9)
    over_b = tree.lookup(a, b) @ tree.lookup(b, c)
    np.testing.assert_allclose(over_b.matrix(), tree.lookup(a, c).matrix(), atol=1e-9)


def test_the_order_in_which_transforms_are_added_does_not_matter() -> None:
    forward, backward = FrameTree(BUILDING), FrameTree(reversed(BUILDING))
    assert forward.lookup("cellar", "lab") == backward.lookup("cellar", "lab")
    assert list(forward) == BUILDING
    assert len(forward) == 4
    assert forward.frames == ["map", "floor", "lab", "cellar", "moon", "crater"]


@pytest.mark.parametrize(
    ("parent", "child", "message"),
    [
        ("cellar", "lab", "frame 'lab' already has the parent 'floor'"),
        ("map", "map", "frame 'map' cannot be a child of 'map': the two would form a loop"),
        ("lab", "map", "frame 'map' cannot be a child of 'lab': the two would form a loop"),
        ("lab", "lab", "frame 'lab' already has the parent 'floor'"),
    ],
)
def test_what_is_no_tree_is_refused(parent: str, child: str, message: str) -> None:
    tree = FrameTree(BUILDING)
    with pytest.raises(FrameError) as caught:
        tree.add(Transform(parent, child, Pose2D()))
    assert str(caught.value) == message
    assert list(tree) == BUILDING


@pytest.mark.parametrize(
    ("target", "source", "message"),
    [
        ("map", "labb", "no transform has the frame 'labb'; did you mean 'lab'?"),
        ("attic", "lab", "no transform has the frame 'attic'; known: map, floor, lab, cellar, "
         "moon, crater"),
        ("map", "crater", "no transform connects the frame 'crater' with the frame 'map'"),
    ],
)  # fmt: skip
def test_an_unknown_or_separate_frame_is_an_error(target: str, source: str, message: str) -> None:
    with pytest.raises(FrameError) as caught:
        FrameTree(BUILDING).lookup(target, source)
    assert str(caught.value) == message


def test_a_frame_needs_no_transform_to_itself() -> None:
    assert FrameTree().lookup("odom", "odom").is_identity
