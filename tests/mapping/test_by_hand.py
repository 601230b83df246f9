"""Mapping goes on around what people have done, and never undoes it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map, save_map
from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.going_on import CannotGoOn
from hypermap.mapping.mapper import Mapper
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.viewer.live.document import MapDocument

from .evidence_tools import DEFAULT, THESIS, seen, square
from .test_mapper import CONFIG, boxes, frame

DAY = 86_400.0
MOVED = shapely.box(0.05, -0.15, 0.45, 0.25)


def back_and_forth(first: int, count: int = 8) -> list[RgbdFrame]:
    """Frames that show the box about the origin from above."""
    return [frame(first + i, x=0.1 * (i % 8) - 0.3 + first / 1000) for i in range(count)]


def crates(of: RgbdFrame) -> Detections:
    found = boxes(of)
    return Detections.of(found.xyxy, ["crate"], found.scores)


def mapped(frames: Sequence[RgbdFrame], onto: Hypermap | None = None, source=boxes) -> Hypermap:
    mapper = Mapper(CONFIG, source) if onto is None else Mapper.onto(onto, source)
    for each in frames:
        mapper.add(each)
    return mapper.hypermap()


@pytest.fixture
def edited(tmp_path: Path) -> Callable[[Hypermap, Callable[[SemanticLayer], None]], Hypermap]:
    """A map after a change by hand, saved and opened."""

    def edit(hypermap: Hypermap, change: Callable[[SemanticLayer], object]) -> Hypermap:
        save_map(hypermap, tmp_path / "a.hmap")
        opened = open_map(tmp_path / "a.hmap")
        change(opened.semantic())
        save_map(opened, tmp_path / "b.hmap")
        return open_map(tmp_path / "b.hmap")

    return edit


def objects(hypermap: Hypermap) -> list[SemanticObject]:
    return hypermap.semantic().objects()


def test_what_nobody_has_edited_goes_on_as_before(edited) -> None:
    whole = mapped(back_and_forth(0, 16))
    parts = edited(mapped(back_and_forth(0, 16)[:8]), lambda _: None)
    (found,) = objects(mapped(back_and_forth(0, 16)[8:], parts))
    (expected,) = objects(whole)
    assert vars(found) == {**vars(expected), "footprint": found.footprint}
    assert found.footprint.equals_exact(expected.footprint, 0)
    assert "by_hand" not in whole.metadata


def test_a_name_given_by_hand_stays_and_the_rest_is_mapped_on(edited) -> None:
    hypermap = edited(mapped(back_and_forth(0)), lambda layer: layer.rename(0, "Anna's box"))
    for first in (20, 40):  # twice, so that the edit is in the state of the mapper, too
        hypermap = mapped(back_and_forth(first), hypermap)
    (found,) = objects(hypermap)
    (plain,) = objects(mapped([f for i in (0, 20, 40) for f in back_and_forth(i)]))
    assert (found.id, found.name, found.tags) == (0, "Anna's box", ("box",))
    assert found.attributes == {**plain.attributes, "by_hand": ["name"]}
    assert found.footprint.equals_exact(plain.footprint, 0)
    assert hypermap.metadata["by_hand"] == {"changed": [0]}


def test_a_shape_given_by_hand_is_never_moved(edited) -> None:
    def move(layer: SemanticLayer) -> None:
        layer.update(0, dataclasses.replace(layer.get(0), footprint=MOVED))

    hypermap = edited(mapped(back_and_forth(0)), move)
    hypermap = mapped(back_and_forth(20), edited(mapped(back_and_forth(40), hypermap), lambda _: 0))
    (found,) = objects(hypermap)
    assert found.footprint.equals_exact(MOVED, 0)
    assert found.attributes["evidence"] == 24
    assert found.attributes["by_hand"] == ["shape"]


def test_tags_and_attributes_given_by_hand_stay(edited) -> None:
    def tell(layer: SemanticLayer) -> None:
        more = {**layer.get(0).attributes, "owner": "Anna", "bought": "2024-05-01"}
        layer.update(0, dataclasses.replace(layer.get(0), tags=("parcel", "box"), attributes=more))

    (found,) = objects(mapped(back_and_forth(20), edited(mapped(back_and_forth(0)), tell)))
    assert found.tags == ("parcel", "box")
    assert (found.attributes["owner"], found.attributes["evidence"]) == ("Anna", 16)
    assert found.attributes["by_hand"] == ["tags", "attributes"]


def test_what_was_deleted_by_hand_does_not_come_back(edited) -> None:
    hypermap = edited(mapped(back_and_forth(0)), lambda layer: layer.remove(0))
    for first in (20, 40, 60):
        hypermap = edited(mapped(back_and_forth(first), hypermap), lambda _: None)
        assert objects(hypermap) == []
        assert hypermap.metadata["by_hand"] == {"deleted": [0]}


def test_something_else_in_the_place_of_what_was_deleted_is_mapped(edited) -> None:
    hypermap = edited(mapped(back_and_forth(0)), lambda layer: layer.remove(0))
    (found,) = objects(mapped(back_and_forth(20), hypermap, crates))
    assert (found.name, found.id != 0) == ("crate", True)


def test_what_was_deleted_and_put_back_is_there(edited) -> None:
    first = mapped(back_and_forth(0))
    (box,) = objects(first)
    hypermap = mapped(back_and_forth(20), edited(first, lambda layer: layer.remove(0)))
    hypermap = mapped(back_and_forth(40), edited(hypermap, lambda layer: layer.add(box)))
    (found,) = objects(hypermap)
    assert (found.id, found.name) == (0, "box")
    assert found.footprint.equals_exact(box.footprint, 0)


def test_what_is_drawn_elsewhere_under_the_id_of_what_was_deleted_does_not_bring_it_back(
    edited,
) -> None:
    hypermap = edited(mapped(back_and_forth(0)), lambda layer: layer.remove(0))
    hypermap = mapped(back_and_forth(20), hypermap)
    desk = SemanticObject("desk", shapely.box(5, 5, 6, 6), id=0)
    for first in (40, 60):
        hypermap = edited(hypermap, lambda layer: layer.add(desk) if not len(layer) else None)
        hypermap = mapped(back_and_forth(first), hypermap)
        assert [(item.id, item.name) for item in objects(hypermap)] == [(0, "desk")]


def test_what_was_drawn_by_hand_stays_and_is_not_found_again_beside_it(edited) -> None:
    drawn = SemanticObject("box", MOVED, tags=("mine",), attributes={"color": "red"})
    zone = SemanticObject("wet floor", shapely.box(5, 5, 6, 6))
    early = mapped(back_and_forth(0, 1))  # a track with the id 0 that is not published yet
    assert objects(early) == []
    hypermap = edited(early, lambda layer: layer.add([drawn, zone]))
    for first in (20, 40):
        hypermap = edited(mapped(back_and_forth(first), hypermap), lambda _: None)
    found = objects(hypermap)
    assert [(item.id, item.name) for item in found] == [(0, "box"), (1, "wet floor")]
    assert found[0].footprint.equals_exact(MOVED, 0)
    assert found[0].tags == ("mine",)
    assert found[0].attributes == {"color": "red", "by_hand": ["drawn"]}
    assert hypermap.metadata["by_hand"] == {"drawn": [0, 1]}


def test_what_was_drawn_and_deleted_is_as_if_never_there(edited) -> None:
    drawn = SemanticObject("box", shapely.box(-0.2, -0.2, 0.2, 0.2))
    hypermap = edited(mapped(back_and_forth(0, 1)), lambda layer: layer.add(drawn))
    hypermap = edited(mapped(back_and_forth(20), hypermap), lambda layer: layer.remove(0))
    (found,) = objects(mapped(back_and_forth(40), hypermap))
    assert (found.name, found.id != 0) == ("box", True)


def test_what_people_have_edited_stays_where_it_is_seen_no_more() -> None:
    evidence = EvidenceMap(THESIS)
    for _ in range(4):
        evidence.update(seen(square(0), square(3)))
    evidence.go_on_with(evidence.tracks(), {0: HandEdit(name="Anna's chair")})
    for _ in range(60):
        evidence.update(seen())
    (found,) = evidence.objects()
    assert (found.name, found.existence) == ("Anna's chair", THESIS.forget_below)


@pytest.mark.parametrize(
    "edit",
    [
        HandEdit(name="Anna's chair"),
        HandEdit(footprint=square(0.1)),
        HandEdit(drawn=SemanticObject("chair", square(0), id=0)),
    ],
)
def test_what_people_have_edited_and_drives_have_missed_comes_back_as_itself(
    edit: HandEdit,
) -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6 if edit.drawn is None else 0):
        evidence.update(seen(square(0), stamp=second))
    evidence.go_on_with(evidence.tracks(), {0: edit})
    for second in range(60):
        evidence.update(seen(stamp=DAY + second))
    for second in range(3):
        evidence.update(seen(square(0), stamp=2 * DAY + second))
    (found,) = evidence.objects()
    assert (found.id, found.name) == (0, edit.name or "chair")
    (track,) = evidence.tracks().objects
    assert track.by_hand == edit
    assert evidence.tracks().existence[0] > 0


def test_a_map_without_its_layer_of_objects_is_refused() -> None:
    hypermap = mapped(back_and_forth(0))
    hypermap.rename("semantic", "things")
    with pytest.raises(CannotGoOn, match="its semantic layer is missing"):
        Mapper.onto(hypermap, boxes)


def test_objects_may_come_after_a_drive_without_them(edited) -> None:
    bare = mapped(back_and_forth(0), source=None)
    (found,) = objects(mapped(back_and_forth(20), bare))
    assert found.name == "box"


@pytest.mark.parametrize("config", [DEFAULT, THESIS], ids=["default", "thesis"])
def test_of_two_that_become_one_the_edited_one_stays_and_two_edited_ones_stay_two(config) -> None:
    def two() -> EvidenceMap:
        evidence = EvidenceMap(config)
        for _ in range(4):
            evidence.update(seen(square(0), square(1.2)))
        return evidence

    far, near = HandEdit(name="far"), HandEdit(name="near")
    wide = seen(shapely.box(-0.5, -0.5, 1.7, 0.5))
    for edits, expected in (
        ({1: near}, [(1, "near")]),
        ({0: far, 1: near}, [(0, "far"), (1, "near")]),
    ):
        evidence = two()
        evidence.go_on_with(evidence.tracks(), edits)
        for _ in range(30):
            evidence.update(wide)
        found = [(item.id, item.name) for item in evidence.objects()]
        assert [one for one in found if one in expected] == expected
        assert not any(name == "chair" and number in edits for number, name in found)


BOW_TIE = shapely.Polygon([(-0.5, -0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, 0.5)])
STAR = shapely.Polygon([(0, 0.6), (0.35, -0.5), (-0.57, 0.2), (0.57, 0.2), (-0.35, -0.5)])
TO_AND_FRO = shapely.Polygon([(-0.5, 0), (0.5, 0), (0.5, 0.5), (0.5, 0), (0, 0), (0, 0.5)])
LINE = shapely.Polygon([(-0.5, 0), (0.5, 0), (0, 0)])


@pytest.mark.parametrize("later", [0.0, DAY], ids=["in the same drive", "in the next one"])
@pytest.mark.parametrize("is_drawn", [False, True], ids=["reshaped", "drawn"])
@pytest.mark.parametrize(
    "outline", [BOW_TIE, STAR, TO_AND_FRO, LINE], ids=["bow tie", "star", "spike", "line"]
)
def test_an_outline_that_crosses_itself_can_be_mapped_onto(
    outline: shapely.Polygon, is_drawn: bool, later: float
) -> None:
    evidence, rng = EvidenceMap(DEFAULT), np.random.default_rng(0)
    for second in range(6):
        evidence.update(seen(square(0.0, side=0.6), stamp=second))
    drawn = SemanticObject("chair", outline, id=7)
    edits = {7: HandEdit(drawn=drawn)} if is_drawn else {0: HandEdit(footprint=outline)}
    evidence.go_on_with(evidence.tracks(), edits)
    for second in range(100, 140):
        places = rng.uniform((-0.4, -0.4, 0.3), (0.4, 0.4, 0.9), (1 + second % 2, 3))
        shapes = [square(x, y, side) for x, y, side in places]
        evidence.update(seen(*shapes, stamp=later + second))
    found = {item.id: item.footprint for item in evidence.objects()}
    assert found[7 if is_drawn else 0].equals_exact(outline, 0)


ACTIONS = st.sampled_from(["rename", "move", "delete", "draw", "nothing"])


@settings(max_examples=12, deadline=None)
@given(actions=st.lists(ACTIONS, min_size=1, max_size=4))
def test_after_any_edits_and_drives_the_map_is_as_people_left_it(actions: list[str]) -> None:
    hypermap = mapped(back_and_forth(0))
    wanted: dict[int, tuple[str | None, shapely.Polygon | None]] = {0: (None, None)}
    for i, action in enumerate(actions):
        layer = hypermap.semantic()
        chosen = max(wanted, default=None)
        if action == "draw":
            shape = shapely.box(3 + i, 3, 3.5 + i, 4)
            wanted[layer.add(SemanticObject("desk", shape))] = ("desk", shape)
        elif chosen is not None and action == "rename":
            layer.rename(chosen, f"name {i}")
            wanted[chosen] = (f"name {i}", wanted[chosen][1])
        elif chosen is not None and action == "move":
            shape = shapely.affinity.translate(layer.get(chosen).footprint, 0.03, 0.0)
            layer.update(chosen, dataclasses.replace(layer.get(chosen), footprint=shape))
            wanted[chosen] = (wanted[chosen][0], shape)
        elif chosen is not None and action == "delete":
            layer.remove(chosen)
            del wanted[chosen]
        hypermap = mapped(back_and_forth(20 * (i + 1)), hypermap)
        found = {item.id: item for item in objects(hypermap)}
        assert found.keys() == wanted.keys()
        for number, (name, shape) in wanted.items():
            assert found[number].name == (name or "box")
            assert shape is None or found[number].footprint.equals_exact(shape, 0)


def test_the_page_marks_what_was_done_there(tmp_path: Path) -> None:
    save_map(mapped(back_and_forth(0)), tmp_path / "a.hmap")
    document = MapDocument(tmp_path / "a.hmap")
    box = document.current.hypermap.semantic().get(0)
    zone = SemanticObject("zone", shapely.box(5, 5, 6, 6))
    version = document.current.version
    renamed = dataclasses.replace(box, name="Anna's box")
    document.edit(version, lambda draft: draft.update("semantic", 0, renamed))
    document.edit(version + 1, lambda draft: draft.add("semantic", zone))
    document.save()
    saved = open_map(tmp_path / "a.hmap")
    marks = {item.name: item.attributes["by_hand"] for item in objects(saved)}
    assert marks == {"Anna's box": ["name"], "zone": ["drawn"]}
    assert saved.metadata["by_hand"] == {"changed": [0], "drawn": [1]}
    assert [item.name for item in objects(mapped(back_and_forth(20), saved))] == list(marks)
