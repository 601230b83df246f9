"""Observed shapes become objects, which gain and lose existence."""

from __future__ import annotations

import dataclasses
import math
from typing import Literal

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from hypermap.mapping import evidence as evidence_module
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.stages import EvidenceConfig
from hypermap.perception.observation import Observation, ObservedObject

from .evidence_tools import DEFAULT, NOWHERE, ROOM, THESIS, only, published_all, seen, square


def test_existence_follows_the_thesis() -> None:
    # Seen three times, lost six times. Whoever lies in the observed area loses 0.2, seen or not.
    evidence = EvidenceMap(published_all(THESIS))
    expected = [0.8, 1.6, 2.4, 2.2, 2.0, 1.8, 1.6, 1.4, 1.2]
    found = []
    for observation in [seen(square(0))] * 3 + [seen()] * 6:
        evidence.update(observation)
        found.append(only(evidence).existence)
    assert found == expected


def test_an_object_is_published_above_two() -> None:
    evidence = EvidenceMap(dataclasses.replace(THESIS, loss=0.0))
    counts = []
    for _ in range(3):
        evidence.update(seen(square(0)))
        published = evidence.objects(), evidence.summary(), evidence.layer()
        counts.append((len(evidence), *map(len, published)))
    assert counts == [(0, 0, 0, 0), (0, 0, 0, 0), (1, 1, 1, 1)]  # existence 1, 2, 3


def test_an_object_is_forgotten_below_minus_five() -> None:
    evidence = EvidenceMap(published_all(THESIS))
    evidence.update(seen(square(0), area=NOWHERE))  # existence 1
    for _ in range(30):
        evidence.update(seen())
    assert evidence.evidence(0)[0].stamp == 0  # existence -5: just still known
    evidence.update(seen())
    with pytest.raises(KeyError):
        evidence.evidence(0)


def test_existence_is_capped_at_twenty() -> None:
    evidence = EvidenceMap(THESIS)
    for _ in range(30):
        evidence.update(seen(square(0), area=NOWHERE))
    assert only(evidence).existence == 20
    evidence.update(seen(square(0)))
    assert only(evidence).existence == 19.8


@pytest.mark.parametrize(
    ("area", "existence"),
    [
        (square(0, side=1.2), 1.4),
        (square(0, side=1), 1.4),  # its own boundary still lies within
        (square(0.2, side=1.2), 1.6),  # sticks out
        (square(5), 1.6),
        (NOWHERE, 1.6),
    ],
    ids=["inside", "same", "partly", "elsewhere", "empty"],
)
def test_an_object_loses_only_where_its_whole_shape_was_observed(
    area: BaseGeometry, existence: float
) -> None:
    evidence = EvidenceMap(published_all(THESIS))
    for _ in range(2):
        evidence.update(seen(square(0)))
    evidence.update(seen(area=area))
    assert only(evidence).existence == existence


def test_in_the_default_profile_only_what_was_not_seen_loses() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    evidence.update(seen(square(0), score=0.5))
    assert only(evidence).existence == 0.75  # 1.5 times the score
    evidence.update(seen(square(0), score=0.9))
    assert only(evidence).existence == 2.1
    evidence.update(seen())
    assert only(evidence).existence == 1.8


def test_in_the_default_profile_the_edge_of_the_view_and_distant_things_lose_nothing() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    evidence.update(seen(square(0), square(6)))
    evidence.update(seen(area=square(0, side=1.1)))
    evidence.update(seen(area=square(6, side=3)))  # the camera stands at the origin
    assert [found.existence for found in evidence.objects()] == [1.5, 1.5]
    elsewhere = np.eye(4)
    elsewhere[:2, 3] = 6, 3
    evidence.update(dataclasses.replace(seen(), map_T_camera=elsewhere))
    assert [found.existence for found in evidence.objects()] == [1.5, 1.2]


def test_evidence_goes_to_the_object_it_overlaps_by_a_fifth() -> None:
    evidence = EvidenceMap(published_all(THESIS))
    evidence.update(seen(shapely.box(0, 0, 3, 1)))
    evidence.update(seen(shapely.box(2, 0, 5, 1)))
    assert only(evidence).attributes["evidence"] == 2
    evidence.update(seen(shapely.box(10, 0, 13, 1)))
    evidence.update(seen(shapely.box(12.1, 0, 15.1, 1)))
    assert [found.attributes["evidence"] for found in evidence.objects()] == [2, 1, 1]


def test_a_shape_that_matches_several_objects_combines_them() -> None:
    evidence = EvidenceMap(published_all(THESIS))
    evidence.update(seen(square(0), square(1.1), square(9), area=NOWHERE))
    evidence.update(seen(square(0), stamp=1.0, area=NOWHERE))
    evidence.update(seen(square(0.55, side=2), stamp=2.0, area=NOWHERE))
    combined, other = evidence.objects()
    assert (combined.id, combined.existence, combined.attributes["evidence"]) == (0, 4, 4)
    assert (combined.first_seen, combined.last_seen) == (0, 2)
    assert (other.id, other.attributes["evidence"]) == (2, 1)
    # Centroids at x = 0, 1.1, 0 and 0.55: the mean is 0.4125, and the large one is the nearest.
    assert combined.footprint.equals(square(0.55, side=2))


def test_combined_existence_is_capped_too() -> None:
    evidence = EvidenceMap(THESIS)
    for _ in range(15):
        evidence.update(seen(square(0), square(1.1), area=NOWHERE))
    evidence.update(seen(square(0.55, side=2), area=NOWHERE))
    assert only(evidence).existence == 20


def test_one_wrong_shape_does_not_combine_objects_in_the_default_profile() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    for _ in range(5):
        evidence.update(seen(square(0), square(2)))
    evidence.update(seen(shapely.box(-0.5, -0.5, 2.5, 0.5)))
    assert [round(found.footprint.area, 1) for found in evidence.objects()] == [1, 1]


def test_objects_that_grow_into_each_other_are_combined_in_the_default_profile() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    left, right, whole = shapely.box(0, 0, 1, 1), shapely.box(1, 0, 2, 1), shapely.box(0, 0, 2, 1)
    evidence.update(seen(left, right))
    assert len(evidence.objects()) == 2
    for _ in range(3):
        evidence.update(seen(whole))
    assert only(evidence).id == 0
    assert only(evidence).attributes["evidence"] == 5


def test_a_combined_object_keeps_the_id_that_people_know_not_that_of_an_improbable_track() -> None:
    evidence = EvidenceMap(DEFAULT)
    middle = shapely.box(0, 0, 2, 2)
    around = [square(1 + x, 1 + y, 2.0) for x, y in ((1.2, 0), (-1.2, 0), (0, 1.2), (0, -1.2))]
    for shape in (middle, *around):  # which hardly agree
        evidence.update(seen(shape, score=0.3, area=NOWHERE))
    for _ in range(4):
        evidence.update(seen(shapely.box(3.4, 0, 4.4, 2), area=NOWHERE))
    assert only(evidence).id == 1
    evidence.update(seen(shapely.box(0.5, 0, 4.4, 2), area=NOWHERE))
    assert only(evidence).attributes["evidence"] == 10
    assert only(evidence).id == 1


@pytest.mark.parametrize(("combine", "count"), [("matches", 2), ("overlapping", 1)])
def test_an_object_that_grows_over_another_takes_it_in_as_configured(
    combine: Literal["matches", "overlapping"], count: int
) -> None:
    config = dataclasses.replace(
        THESIS, association="overlap", min_overlap=0.2, fusion="convex_hull", combine=combine
    )
    evidence = EvidenceMap(published_all(config))
    within = shapely.box(2, 1.2, 2.6, 1.8)  # meets neither of two shapes whose hull covers it
    for shape in (shapely.box(0, 0, 4, 1), within, shapely.box(0, 0, 1, 3)):
        evidence.update(seen(shape, area=NOWHERE))
    assert len(evidence) == count


def test_best_shape_and_hull_of_three_shapes() -> None:
    shapes = [square(0), square(0.4), square(1.0)]  # the mean centroid is at 0.467
    for fusion, expected in [
        ("best_shape", square(0.4)),
        ("convex_hull", shapely.box(-0.5, -0.5, 1.5, 0.5)),
    ]:
        evidence = EvidenceMap(
            dataclasses.replace(published_all(THESIS), fusion=fusion, association="radius")
        )
        for shape in shapes:
            evidence.update(seen(shape))
        assert only(evidence).footprint.equals(expected)


def test_a_published_object_tells_what_is_known_of_it() -> None:
    evidence = EvidenceMap(THESIS)
    for stamp, score in [(1.0, 0.5), (2.0, 0.7), (3.0, 0.9), (4.0, 0.9)]:
        evidence.update(seen(square(0), stamp=stamp, score=score))
    found = only(evidence)
    assert (found.name, found.id, found.tags) == ("chair", 0, ("chair",))
    assert found.confidence == pytest.approx((0.75,))
    assert (found.first_seen, found.last_seen, found.existence) == (1, 4, 3.2)
    assert dict(found.attributes) == {"evidence": 4, "z_min": 0.1, "z_max": 0.9}


def test_the_confidence_of_the_profile_default_is_a_probability_that_grows_with_existence() -> None:
    evidence = EvidenceMap(profile("default").evidence)
    sure = []
    for stamp in range(4):
        evidence.update(seen(square(3), stamp=float(stamp), score=1.0))
        sure += [item.confidence[0] for item in evidence.objects()]
    odds = [math.exp(7.0 - 5.1 + 1.4 * math.log(existence)) for existence in (3.0, 4.5, 6.0)]
    assert sure == pytest.approx([each / (1 + each) for each in odds])


def test_the_evidence_behind_an_object_keeps_stamp_pose_and_score() -> None:
    evidence = EvidenceMap(THESIS)
    pose = np.eye(4)
    pose[:3, 3] = 1, 2, 3
    observed = ObservedObject("cup", 0.4, square(0), 0.7, 0.8)
    evidence.update(Observation(5.0, pose, (observed,), ROOM))
    (kept,) = evidence.evidence(0)
    assert (kept.stamp, kept.score, kept.z_max) == (5, 0.4, 0.8)
    assert kept.map_T_camera is pose
    assert kept.footprint is observed.footprint


def test_evidence_is_bounded() -> None:
    evidence = EvidenceMap(dataclasses.replace(THESIS, max_evidence=3))
    for stamp in range(5):
        evidence.update(seen(square(0), stamp=float(stamp)))
    assert [kept.stamp for kept in evidence.evidence(0)] == [2, 3, 4]
    assert only(evidence).attributes["evidence"] == 5


def test_asking_for_objects_does_not_change_what_is_mapped() -> None:
    rng = np.random.default_rng(3)
    asked, unasked = EvidenceMap(DEFAULT), EvidenceMap(DEFAULT)
    for _ in range(60):
        observation = seen(square(*rng.normal(0, 0.2, 2)), square(*rng.normal(2, 0.2, 2)))
        asked.update(observation)
        unasked.update(observation)
        asked.objects()
    for one, other in zip(asked.objects(), unasked.objects(), strict=True):
        assert one.footprint.equals(other.footprint)
        assert one.existence == other.existence


def test_published_shapes_are_up_to_date_even_where_renewal_is_lazy() -> None:
    lazy, eager = (
        EvidenceMap(dataclasses.replace(DEFAULT, renewal=renewal, combine="matches"))
        for renewal in (0.5, 0.0)
    )
    rng = np.random.default_rng(5)
    for _ in range(25):
        observation = seen(square(*rng.normal(0, 0.05, 2)))
        lazy.update(observation)
        eager.update(observation)
        if len(eager):
            assert only(lazy).footprint.equals(only(eager).footprint)


@pytest.mark.parametrize(
    "shape",
    [
        shapely.Polygon(),
        shapely.LineString([(0, 0), (1, 1)]),
        shapely.Polygon([(0, 0), (1, 1), (2, 2)]),
        shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)]),
        shapely.Polygon([(0, 0), (1, 0), (float("inf"), 1)]),
    ],
    ids=["empty", "line", "flat", "bow tie", "infinite"],
)
def test_what_is_no_area_is_left_out_and_counted(
    shape: BaseGeometry, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    evidence = EvidenceMap(published_all(THESIS))
    evidence.update(seen(square(0)))
    assert (evidence.ignored, caplog.messages) == (0, [])
    for count in (1, 2):
        evidence.update(seen(shape, square(0)))
        assert only(evidence).footprint.equals(square(0))
        assert evidence.ignored == count
    assert caplog.messages == ["frame 0.000000: skipped shapes without area"] * 2


def test_frames_without_anything_change_nothing() -> None:
    for config in (THESIS, DEFAULT):
        evidence = EvidenceMap(config)
        evidence.update(seen())
        evidence.update(seen(area=NOWHERE))
        assert evidence.objects() == []
        assert len(evidence.layer("semantic", "map")) == 0


def test_the_layer_has_the_objects_with_their_ids() -> None:
    evidence = EvidenceMap(dataclasses.replace(THESIS, loss=0.0))
    for _ in range(3):
        evidence.update(seen(square(3)))
    for _ in range(3):
        evidence.update(seen(square(0), name="cup"))
    layer = evidence.layer("things", "lab")
    assert (layer.name, layer.frame_id) == ("things", "lab")
    assert [(found.id, found.name) for found in layer.objects()] == [(0, "chair"), (1, "cup")]
    assert layer.label_at([[0, 0], [3, 0]]).tolist() == ["cup", "chair"]


@st.composite
def _shapes(draw: st.DrawFn) -> shapely.Polygon:
    x, y = draw(st.integers(-8, 8)) / 4, draw(st.integers(-8, 8)) / 4
    return square(x, y, side=draw(st.sampled_from([0.5, 1.0, 1.5])))


sequences = st.lists(
    st.tuples(st.lists(_shapes(), max_size=3), st.lists(_shapes(), max_size=3)), max_size=6
)
profiles = st.sampled_from([THESIS, DEFAULT])


# The cups become one well-known object in the second frame, which must not judge its chair.
@example(frames=[([], [square(0)] * 3), ([square(0)], [square(0)])], config=DEFAULT)
@settings(max_examples=60, deadline=None)
@given(frames=sequences, config=profiles)
def test_the_order_of_classes_within_a_frame_does_not_matter(
    frames: list[tuple[list[BaseGeometry], list[BaseGeometry]]], config: EvidenceConfig
) -> None:
    chairs_first, cups_first = (EvidenceMap(published_all(config)) for _ in range(2))
    for stamp, (chairs, cups) in enumerate(frames):
        a = [ObservedObject("chair", 0.8, shape) for shape in chairs]
        b = [ObservedObject("cup", 0.8, shape) for shape in cups]
        chairs_first.update(Observation(float(stamp), np.eye(4), tuple(a + b), ROOM))
        cups_first.update(Observation(float(stamp), np.eye(4), tuple(b + a), ROOM))

    def facts(evidence: EvidenceMap) -> list[tuple[str, str, float | None]]:
        return sorted(
            (o.name, o.footprint.normalize().wkt, o.existence) for o in evidence.objects()
        )

    assert facts(chairs_first) == facts(cups_first)


@settings(max_examples=60, deadline=None)
@given(frames=st.lists(st.lists(_shapes(), max_size=4), max_size=12), config=profiles)
def test_existence_is_bounded_and_no_evidence_is_lost_by_combining(
    frames: list[list[BaseGeometry]], config: EvidenceConfig
) -> None:
    evidence = EvidenceMap(published_all(config))
    for shapes in frames:
        evidence.update(seen(*shapes))
        for found in evidence.objects():
            assert found.existence is not None
            assert -5 <= found.existence <= 20
            assert found.footprint.is_valid
            assert found.footprint.area > 0
    # 12 frames are too few for anything to be forgotten (that takes 26).
    counts = [found.attributes["evidence"] for found in evidence.objects()]
    assert sum(counts) == sum(len(shapes) for shapes in frames)


@given(config=profiles)
def test_what_is_never_seen_again_is_forgotten(config: EvidenceConfig) -> None:
    evidence = EvidenceMap(dataclasses.replace(config, moves=False))
    for _ in range(40):
        evidence.update(seen(square(0)))
    for _ in range(126):  # from 20 to below -5 in steps of 0.2
        evidence.update(seen())
    with pytest.raises(KeyError):
        evidence.evidence(0)


@pytest.mark.parametrize("config", [DEFAULT, THESIS], ids=["default", "thesis"])
@pytest.mark.parametrize(
    "point",
    [
        "ChangingTracks.refresh_shape",
        "FrameUpdate._add",
        "FrameUpdate._merge",
        "FrameUpdate._count_co_occurrences",
        "penalize_missed",
        "prune",
    ],
)
@pytest.mark.parametrize("calls", [0, 1, 2])
def test_an_update_that_fails_leaves_all_as_it_was(
    monkeypatch: pytest.MonkeyPatch, config: EvidenceConfig, point: str, calls: int
) -> None:
    config = dataclasses.replace(published_all(config), renewal=0.0)
    evidence, undisturbed = EvidenceMap(config), EvidenceMap(config)
    walk = [seen(square(0.1 * i), square(3), square(6.4)) for i in range(3)]
    for observation in walk:
        evidence.update(observation)
        undisturbed.update(observation)
    left = calls
    *owners, name = point.split(".")
    owner = getattr(evidence_module, owners[0]) if owners else evidence_module
    work = getattr(owner, name)

    def failing(*given: object) -> object:
        nonlocal left
        if left == 0:
            raise MemoryError
        left -= 1
        return work(*given)

    # One shape joins two objects, another is new, a third is as before, and a last one is no area.
    more = seen(square(4.7, side=4), square(20), square(0.1), shapely.LineString([(0, 0), (1, 1)]))
    is_done = True
    with monkeypatch.context() as patched:
        patched.setattr(owner, name, failing)
        try:
            evidence.update(more)
        except MemoryError:
            is_done = False
    if is_done:  # it was called less often
        undisturbed.update(more)
    for observation in [None, more, *walk]:
        if observation is not None:
            evidence.update(observation)
            undisturbed.update(observation)
        assert _facts(evidence) == _facts(undisturbed)


def _facts(evidence: EvidenceMap) -> list[object]:
    layer = evidence.layer()
    pieces = [evidence.evidence(int(number)) for number in layer.ids]
    tracks = evidence.tracks()
    times = [(*one.buffer.surely_there, one.buffer.last_seen) for one in tracks.objects]
    assert tracks.times[:, :3].tolist() == [list(row) for row in times]
    return [
        evidence.ignored,
        evidence.summary(),
        [(item.name, item.footprint.wkt, item.existence) for item in layer],
        [[piece.footprint.wkt for piece in some] for some in pieces],
    ]


def test_a_merge_that_fails_leaves_the_neighbors_as_they_were(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    left, right, whole = shapely.box(0, 0, 1, 1), shapely.box(1, 0, 2, 1), shapely.box(0, 0, 2, 1)
    neighbor = square(3.5)
    evidence.update(seen(left, right, neighbor))
    before = [dict(track.co_occurrences) for track in evidence._tracks.table.objects]
    assert before == [{1: 1, 2: 1}, {0: 1, 2: 1}, {0: 1, 1: 1}]
    with monkeypatch.context() as patched:
        patched.delattr(evidence_module, "penalize_missed")
        with pytest.raises(NameError):
            evidence.update(seen(whole))
    assert [dict(track.co_occurrences) for track in evidence._tracks.table.objects] == before
    evidence.update(seen(whole))
    after = {track.id: dict(track.co_occurrences) for track in evidence._tracks.table.objects}
    assert after == {0: {2: 2}, 2: {0: 2}}


def test_an_object_that_some_frames_showed_in_two_parts_becomes_one() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    left, right, whole = (
        shapely.box(0, 0, 0.7, 1),
        shapely.box(0.7, 0, 2, 1),
        shapely.box(0, 0, 2, 1),
    )
    for _ in range(2):
        evidence.update(seen(left, right))
    assert len(evidence) == 2
    for _ in range(6):
        evidence.update(seen(whole))
    assert shapely.hausdorff_distance(only(evidence).footprint, whole) < 1e-3


def test_a_shape_over_two_known_chairs_does_not_make_them_one() -> None:
    evidence = EvidenceMap(dataclasses.replace(DEFAULT, sight="area", min_probability=0.0))
    left, right = shapely.box(0, 0, 0.4, 0.4), shapely.box(0.6, 0, 1.05, 0.4)
    part, both = shapely.box(0.1, 0.1, 0.3, 0.3), shapely.box(0.1, 0.08, 1, 0.32)
    for i in range(6):
        evidence.update(seen(left, right, area=NOWHERE, stamp=float(i)))
    known = [item.id for item in evidence.objects()]
    for i, shapes in enumerate([(left, part), (both,), *[(left, right)] * 6]):
        evidence.update(seen(*shapes, area=NOWHERE, stamp=86400.0 + i))
    assert [item.id for item in evidence.objects()] == known == [0, 1]


def test_a_view_of_one_of_two_chairs_is_not_for_the_one_that_reached_over_both() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    left, right, both = square(0), square(1.2), shapely.box(-0.5, -0.5, 1.7, 0.5)
    for shape in (left, left, both, both, both):
        evidence.update(seen(shape, right))
    for _ in range(3):
        evidence.update(seen(right))
    assert [count for _, count, *_ in evidence.summary()] == [5, 8]


def test_what_a_frame_misclassifies_is_not_counted_beside_others() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    for _ in range(4):
        for x in (0, 3):
            evidence.update(seen(square(x), name="table", area=NOWHERE))
    table, slip = seen(square(3), name="table", area=NOWHERE), seen(square(0), name="chair")
    evidence.update(dataclasses.replace(table, objects=(*table.objects, *slip.objects)))
    assert [track.name for track in evidence._tracks.table.objects] == ["table", "table"]
    assert not any(track.co_occurrences for track in evidence._tracks.table.objects)


def test_what_is_forgotten_leaves_nothing_behind() -> None:
    # Beside a chair that stays, a wrong one is found in each frame, every time somewhere else.
    evidence = EvidenceMap(dataclasses.replace(published_all(DEFAULT), loss=10.0))
    for i in range(30):
        evidence.update(seen(square(-2), square(2, 2 * (i % 3) - 2)))
    stays, last = evidence._tracks.table.objects
    assert stays.co_occurrences == {last.id: 1}


@pytest.mark.parametrize("name", ["default", "thesis"])
def test_what_is_kept_of_an_object_is_bounded(name: str) -> None:
    evidence = EvidenceMap(published_all(profile(name).evidence))
    for _ in range(130):
        evidence.update(seen(square(0), area=NOWHERE))
    assert len(evidence.evidence(0)) == 100
    assert only(evidence).attributes["evidence"] == 130
