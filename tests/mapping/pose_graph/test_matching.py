"""Registration of views, and the search for a place."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap.mapping.pose_graph.matching import Matcher
from hypermap.mapping.pose_graph.planar import between
from hypermap.mapping.pose_graph.registration import register
from hypermap.mapping.pose_graph.search import Surroundings
from hypermap.mapping.pose_graph.view import View

from .rooms import pose, seen_from

CORRIDOR = ((-20.0, 0.0, 0.0), (40.0, 2.0, 2.5))


def view(x: float, y: float, yaw_deg: float, **world: object) -> View:
    return View.of(seen_from(pose(x, y, yaw_deg), stamp=x + y, **world))


def test_a_view_has_the_points_of_upright_surfaces_above_the_floor() -> None:
    seen = view(1.2, 1.0, 0)
    x, y = seen.upright[:, 0] + 1.2, seen.upright[:, 1] + 1.0
    at_side = (np.abs(y - 2.0) < 0.1) & (np.abs(x - 3.4) < 1)  # of the table
    assert at_side.any()
    assert seen.upright[:, 2].min() > 0.05
    assert np.median(seen.upright_normals[at_side, 1]) < -0.99  # toward the camera


def test_registration_finds_how_views_lie_on_each_other() -> None:
    first, second = view(1.2, 1.0, 5), view(1.5, 1.1, 15)
    true = between(first.pose, second.pose)
    found = register(first, second, true + np.array([0.06, -0.05, 0.04]))
    assert found is not None
    assert found.a_T_b == pytest.approx(true, abs=0.004)
    assert found.agreement > 0.95
    assert np.linalg.eigvalsh(found.information).min() > 1e3


def test_registration_in_a_bare_corridor_knows_nothing_along_it() -> None:
    first, second = (view(x, 1.0, 0, room=CORRIDOR, boxes=()) for x in (0.0, 0.4))
    found = register(first, second, between(first.pose, second.pose) + np.array([0.1, 0.02, 0.01]))
    assert found is not None
    along, aside, _ = np.diag(found.information)
    assert aside > 1e4
    assert along < 1e-6 * aside
    assert found.a_T_b[1:] == pytest.approx(between(first.pose, second.pose)[1:], abs=0.004)


def test_noise_never_looks_like_knowledge_along_a_bare_wall() -> None:
    """What many matches claim to know there adds up to centimeters in each meter of a corridor."""
    for i in range(20):
        first, second = (view(x + 0.1 * i, 1.0, 20, room=CORRIDOR, boxes=()) for x in (0.0, 0.2))
        found = register(first, second, between(first.pose, second.pose))
        assert found is not None
        wall = np.array([np.cos(first.pose[2]), -np.sin(first.pose[2])])  # in the first view
        across = np.array([-wall[1], wall[0]])
        assert wall @ found.information[:2, :2] @ wall < 5.0  # 1/m²
        assert across @ found.information[:2, :2] @ across > 1e4
        assert found.information[2, 2] > 1e4


def test_views_of_different_places_do_not_match() -> None:
    views = [view(1.2, 1.0, 0), view(5.6, 4.0, 180)]
    poses = np.array([views[0].pose, views[0].pose])  # where the second is not
    assert Matcher(views, [0.0, 7.0]).match(poses, 0, 1) is None


def test_a_place_is_found_again_from_far_off() -> None:
    views = [view(1.2 + 0.2 * i, 1.0, 2 * i) for i in range(4)] + [view(1.5, 1.2, -3)]
    ways = [0.2 * i for i in range(4)] + [16.0]
    true = np.array([each.pose for each in views])
    drifted = true.copy()
    drifted[4] += [0.7, -0.9, 0.3]
    matches = Matcher(views, ways).find(drifted, 1, 4, np.array([1.5, 0.5]))
    assert len(matches) >= 2
    for a, b, a_T_b, _ in matches:
        assert a_T_b == pytest.approx(between(true[a], true[b]), abs=0.006)


def test_a_place_that_looks_the_same_elsewhere_is_not_found() -> None:
    views = [view(0.3 * i, 1.0, 0, room=CORRIDOR, boxes=()) for i in range(4)]
    poses = np.array([each.pose for each in views])
    poses[3, 0] += 0.5
    ways = [0.0, 0.3, 0.6, 20.0]
    assert Matcher(views, ways).find(poses, 1, 3, np.array([1.5, 0.3])) == []


@pytest.mark.parametrize("bare", [1, 4])
def test_no_place_is_found_where_no_surface_is_upright(bare: int) -> None:
    hall = ((-90.0, -90.0, 0.0), (90.0, 90.0, 30.0))
    views = [view(1.2 + 0.2 * i, 1.0, 2 * i) for i in range(5)]
    views[bare] = view(1.2, 1.0, 0, room=hall, boxes=())
    assert len(views[bare].upright) == 0
    poses = np.array([each.pose for each in views])
    ways = [0.0, 20.0, 40.0, 60.0, 80.0]
    assert Matcher(views, ways).find(poses, 1, 4, np.array([1.5, 0.5])) == []


def test_a_search_finds_the_best_place_of_all() -> None:
    points = view(1.2, 1.0, 0).upright.astype(float)
    place = Surroundings(points)
    shifted = points - [0.62, -0.43, 0.0]
    found = place.place_of(shifted, np.zeros(3), np.array([1.0, 0.0]), 0.3)
    assert found is not None
    assert found.a_T_b[:2] == pytest.approx([0.62, -0.43], abs=0.1)
    assert found.other < 0.9 * found.score
    near = np.stack(np.meshgrid(*[0.05 * np.arange(-3, 4)] * 2), axis=-1).reshape(-1, 2)
    tried = [np.append(found.a_T_b[:2] + off, 0.0) for off in near]
    scores = [place.place_of(shifted, about, np.zeros(2), 0.0) for about in tried]
    assert max(one.score for one in scores if one is not None) == pytest.approx(found.score)
    assert (
        place.place_of(shifted + np.array([30, 0, 0]), np.zeros(3), np.array([0.5, 0.1]), 0.3)
        is None
    )
