"""Floor that the shapes of two objects of a class share belongs to one of them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests.mapping.evidence_tools import DEFAULT, NOWHERE, ROOM, published_all, seen

from hypermap.core.arrays import FloatArray
from hypermap.core.semantic import SemanticObject
from hypermap.mapping.config import profile
from hypermap.mapping.contested import own_floor
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.evidence_buffer import EvidenceBuffer, evidence_from
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.perceived import no_detections
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.votes import votes_at

FRONT, BEHIND = shapely.box(0, 0, 2, 0.6), shapely.box(0, 0.65, 2, 1.25)
BOTH = shapely.box(0, 0, 2, 1.25)
VIEWS = 10.0
CONFIG = published_all(DEFAULT)


def shelf(number: int, name: str = "shelf", low: float = 0.0) -> SemanticObject:
    heights = {"z_min": low, "z_max": low + 2.0}
    return SemanticObject(name, BOTH, id=number, attributes=heights)


def votes_on(number: int, points_xy: FloatArray) -> FloatArray:
    """The views of two shelves, of which four in ten reach over the other one, too."""
    is_own = shapely.contains_xy((FRONT, BEHIND)[number % 2], points_xy)
    return np.vstack([np.where(is_own, VIEWS, 0.4 * VIEWS), np.full(len(points_xy), VIEWS)])


def own(*objects: SemanticObject, are_one: bool = False, fixed: tuple[int, ...] = ()) -> set[int]:
    return set(own_floor(objects, lambda *_: are_one, votes_on, 0.3, fixed))


def test_each_of_two_shelves_gets_the_floor_on_which_it_has_more_of_the_votes() -> None:
    found = own_floor([shelf(0), shelf(1)], lambda *_: False, votes_on, 0.3)
    assert shapely.hausdorff_distance(found[0], FRONT) < 0.06  # and half of what is between
    assert shapely.hausdorff_distance(found[1], BEHIND) < 0.06


@pytest.mark.parametrize(
    "other",
    [shelf(1, name="cupboard"), shelf(1, low=2.5)],
    ids=["of another class", "above"],
)
def test_other_things_may_share_floor(other: SemanticObject) -> None:
    assert own(shelf(0), other) == set()


def test_what_may_be_one_object_or_was_edited_stays() -> None:
    assert own(shelf(0), shelf(1), are_one=True) == set()
    assert own(shelf(0), shelf(1), fixed=(1,)) == set()
    assert own() == set()


def test_an_object_without_more_votes_anywhere_keeps_its_shape() -> None:
    def votes(number: int, points_xy: FloatArray) -> FloatArray:
        return np.vstack([np.full(len(points_xy), 9.0 - number), np.full(len(points_xy), 10.0)])

    assert set(own_floor([shelf(0), shelf(1)], lambda *_: False, votes, 0.3)) == {0}


def test_many_views_that_mostly_agree_outvote_few_that_all_do() -> None:
    def votes(number: int, points_xy: FloatArray) -> FloatArray:
        given, cast = ((9.0, 10.0), (2.0, 2.0))[number]
        return np.vstack([np.full(len(points_xy), given), np.full(len(points_xy), cast)])

    assert set(own_floor([shelf(0), shelf(1)], lambda *_: False, votes, 0.3)) == {0}


def test_outlines_that_cross_themselves_are_divided_all_the_same() -> None:
    bow = shapely.Polygon([(0, 0), (2, 1.25), (2, 0), (0, 1.25)])
    crossed = [dataclasses.replace(shelf(i), footprint=bow) for i in (0, 1)]
    found = own_floor(crossed, lambda *_: False, votes_on, 0.3)
    assert all(shape.is_valid and shape.area < 1.25 for shape in found.values())


def two_shelves(config: EvidenceConfig = CONFIG) -> EvidenceMap:
    """A map of two shelves back to back, where every second box shows what is behind, too."""
    evidence = EvidenceMap(config)
    for stamp in range(12):
        front = BOTH if stamp % 2 else FRONT
        evidence.update(seen(front, BEHIND, name="shelf", stamp=float(stamp)))
    return evidence


def test_shelves_back_to_back_do_not_overlap_in_the_map() -> None:
    front, behind = two_shelves().objects()
    assert shapely.area(shapely.intersection(front.footprint, behind.footprint)) < 0.05
    assert front.footprint.area == pytest.approx(FRONT.area, rel=0.1)
    assert behind.footprint.area == pytest.approx(BEHIND.area, rel=0.1)


def test_they_may_where_frames_do_not_tell_objects_apart() -> None:
    (both,) = two_shelves(dataclasses.replace(CONFIG, exclusive=False)).objects()
    assert both.footprint.area > 1.5 * FRONT.area


def test_the_map_of_a_live_node_may_overlap_until_it_is_final() -> None:
    evidence = two_shelves()
    live, final = (evidence.layer(is_final=is_final) for is_final in (False, True))
    front, own_front = (next(iter(layer)) for layer in (live, final))
    assert front.id == own_front.id
    assert front.footprint.area > 1.5 * own_front.footprint.area


def test_a_shape_drawn_by_hand_stays_and_the_others_are_no_edits() -> None:
    mapper = Mapper(dataclasses.replace(profile("default"), evidence=CONFIG), no_detections)
    mapper.evidence = two_shelves()
    hypermap = mapper.hypermap()
    (front, behind), layer = hypermap.semantic().objects(), hypermap.semantic()
    layer.update(front.id, dataclasses.replace(front, footprint=BOTH))
    again = Mapper.onto(hypermap, no_detections)
    assert set(again.evidence.hand_edits()) == {front.id}
    drawn, other = again.hypermap().semantic().objects()
    assert drawn.footprint.equals(BOTH)
    assert other.footprint.area == pytest.approx(behind.footprint.area, rel=0.05)


SIDES = st.floats(0.2, 2.0)


@given(st.lists(st.tuples(SIDES, st.floats(0.1, 1.0), st.booleans()), min_size=1, max_size=6))
def test_votes_at_a_place_are_those_of_the_views_that_show_it(
    views: list[tuple[float, float, bool]],
) -> None:
    buffer, config = EvidenceBuffer(100), dataclasses.replace(DEFAULT, align=0.0)
    for side, score, is_bounded in views:
        area = ROOM if is_bounded else NOWHERE
        frame = seen(shapely.box(0, 0, side, side), score=score, area=area)
        buffer.add(evidence_from(frame, "outside")[0][1])
    weights = np.array([score for _, score, _ in views]) / (1 + 0.25 * np.array(_far(buffer)) ** 2)
    places = np.array([[0.1, 0.1], [1.05, 1.05], [3, 3], [50, 50]])
    votes, cast = votes_at(buffer, config, np.zeros((len(views), 2)), places)
    sides = np.array([side for side, _, _ in views])
    expected = [weights[sides > x].sum() for x in places[:, 0]]
    unbounded = weights[[not is_bounded for _, _, is_bounded in views]].sum()
    assert votes == pytest.approx(np.array(expected))
    assert cast == pytest.approx(np.array([*[weights.sum()] * 3, unbounded]))


def _far(buffer: EvidenceBuffer) -> list[float]:
    """Return how far from the camera, at the origin, each footprint is."""
    return [float(np.hypot(*item.centroid_xy)) for item in buffer.items]
