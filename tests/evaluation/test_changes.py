"""What changed between two maps, with cases that are worked out by hand."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import affinity

from hypermap import (
    GridGeometry,
    Hypermap,
    HypermapError,
    OccupancyLayer,
    Pose2D,
    SemanticLayer,
    SemanticObject,
)
from hypermap.core.history import KINDS
from hypermap.evaluation import Change, Changes, changes_between, knowledge_of, objects_in_frame
from hypermap.viewer.changes import render_changes

CHAIR = shapely.box(0, 0, 0.5, 0.5)
TABLE = shapely.box(0, 0, 1.6, 0.8)


def thing(name: str, x: float, y: float, shape: shapely.Geometry = CHAIR) -> SemanticObject:
    """Return an object whose lower left corner is at x, y."""
    return SemanticObject(name, affinity.translate(shape, x, y))


def map_of(*things: SemanticObject, layer: str = "semantic") -> Hypermap:
    return Hypermap([SemanticLayer(layer, "map", list(things))])


def between(first: Hypermap, second: Hypermap, **options: object) -> Changes:
    maps = [objects_in_frame(one, "a map", "map", Pose2D()) for one in (first, second)]
    return changes_between(*maps, **options)  # type: ignore[arg-type]


def said(changes: Changes) -> list[tuple[str, str]]:
    return [(change.kind, change.object.name) for change in changes.changes]


def only(changes: Changes) -> Change:
    (change,) = changes.changes
    return change


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ([thing("chair", 0, 0)], [thing("chair", 0.05, 0)], []),
        ([thing("chair", 0, 0)], [thing("chair", 1.5, 0)], [("moved", "chair")]),
        ([thing("chair", 0, 0)], [], [("gone", "chair")]),
        ([], [thing("chair", 0, 0)], [("added", "chair")]),
        ([thing("chair", 0, 0)], [thing("sofa", 0, 0)], [("renamed", "sofa")]),
        ([thing("chair", 0, 0)], [thing("sofa", 3, 0)], [("added", "sofa"), ("gone", "chair")]),
        # A cup that is 8 cm wide and 10 cm off overlaps nothing, and has not moved.
        (
            [thing("cup", 0, 0, shapely.box(0, 0, 0.08, 0.08))],
            [thing("cup", 0.1, 0, shapely.box(0, 0, 0.08, 0.08))],
            [],
        ),
        # Half of a table is an incomplete view of it, a tenth is another shape.
        ([thing("table", 0, 0, TABLE)], [thing("table", 0, 0, shapely.box(0, 0, 0.9, 0.8))], []),
        (
            [thing("table", 0, 0, TABLE)],
            [thing("table", 0.7, 0.3, shapely.box(0, 0, 0.2, 0.2))],
            [("reshaped", "table")],
        ),
        # Turned by a quarter, a table is still itself.
        (
            [thing("table", 0, 0, TABLE)],
            [thing("table", 3, 0, shapely.box(0, 0, 0.8, 1.6))],
            [("moved", "table")],
        ),
        # A table does not become a stool, wherever that is.
        (
            [thing("seat", 0, 0, TABLE)],
            [thing("seat", 3, 0, shapely.box(0, 0, 0.2, 0.2))],
            [("added", "seat"), ("gone", "seat")],
        ),
    ],
)
def test_a_change_has_the_kind_that_one_would_give_it(
    before: Sequence[SemanticObject],
    after: Sequence[SemanticObject],
    expected: Sequence[tuple[str, str]],
) -> None:
    changes = between(map_of(*before), map_of(*after))
    assert said(changes) == list(expected)
    assert changes.unchanged == (1 if not expected else 0)


def test_a_move_says_how_far_and_how_likely_it_is_the_same_object() -> None:
    change = only(between(map_of(thing("chair", 0, 0)), map_of(thing("chair", 3, 4))))
    assert (change.distance, change.confidence) == (pytest.approx(5), pytest.approx(1))
    # Two equal chairs, of which any may be the other one: the shortest ways, half as sure.
    before = map_of(thing("chair", 0, 0), thing("chair", 0, 5))
    after = map_of(thing("chair", 2, 0), thing("chair", 2, 5))
    found = between(before, after).changes
    assert [change.distance for change in found] == [pytest.approx(2)] * 2
    assert [change.confidence for change in found] == [pytest.approx(1 / 2)] * 2


def test_another_chair_in_the_old_place_is_the_same_chair() -> None:
    before = map_of(thing("chair", 0, 0), thing("chair", 3, 0))
    after = map_of(thing("chair", 3, 0))
    change = only(between(before, after))
    assert (change.kind, change.object.footprint.centroid.x) == ("gone", pytest.approx(0.25))


def test_equal_ids_are_the_same_object_in_a_map_and_its_continuation() -> None:
    before = map_of(
        dataclasses.replace(thing("chair", 0, 0), id=4),
        dataclasses.replace(thing("chair", 5, 0), id=7),
    )
    after = map_of(
        dataclasses.replace(thing("armchair", 0, 0), id=4),
        dataclasses.replace(thing("chair", 5, 2), id=7),
        dataclasses.replace(thing("chair", 1, 0), id=9),
    )
    found = between(before, after, same_ids=True)
    assert said(found) == [("added", "chair"), ("moved", "chair"), ("renamed", "armchair")]
    moved = found.changes[1]
    assert (moved.confidence, moved.distance) == (1.0, pytest.approx(2))


def test_what_mapping_has_found_to_be_moved_is_so_though_its_outline_differs() -> None:
    before = map_of(dataclasses.replace(thing("lamp", 0, 0), id=4))
    thin = thing("lamp", 2, 0, shapely.box(0, 0, 0.1, 0.5))
    moved = dataclasses.replace(thin, id=4, attributes={"moved": {"confidence": 0.7}})
    change = only(between(before, map_of(moved), same_ids=True))
    assert (change.kind, change.confidence) == ("moved", 0.7)
    unsaid = map_of(dataclasses.replace(moved, attributes={}))
    assert only(between(before, unsaid, same_ids=True)).kind == "reshaped"


def test_layers_and_rooms_are_compared_with_their_like() -> None:
    zone = thing("zone", 0, 0, TABLE)
    first = Hypermap([SemanticLayer("semantic", "map", [zone]), SemanticLayer("zones", "map", [])])
    second = Hypermap([SemanticLayer("semantic", "map", []), SemanticLayer("zones", "map", [zone])])
    found = between(first, second)
    assert [(change.kind, change.layer) for change in found.changes] == [
        ("added", "zones"),
        ("gone", "semantic"),
    ]
    rooms = map_of(thing("office", 0, 0, TABLE), layer="rooms")
    others = map_of(thing("office", 5, 0, TABLE), layer="rooms")
    assert said(between(rooms, others)) == [("added", "office"), ("gone", "office")]


def test_what_only_one_map_knows_has_neither_come_nor_gone() -> None:
    def grid(x: float) -> OccupancyLayer:
        return OccupancyLayer(
            "grid", "map", GridGeometry(10, 10, 0.5, Pose2D(x)), np.zeros((10, 10), int)
        )

    left, right = thing("chair", 1, 1), thing("sofa", 8, 1)
    middle = thing("plant", 4, 1), thing("cup", 3.5, 3)
    first = Hypermap([grid(0), SemanticLayer("semantic", "map", [left, middle[0]])])
    second = Hypermap([grid(3), SemanticLayer("semantic", "map", [right, middle[1]])])
    known = knowledge_of(first, Pose2D()), knowledge_of(second, Pose2D())
    assert said(between(first, second, is_known=known)) == [
        ("added", "cup"),
        ("gone", "plant"),
        ("first seen", "sofa"),
        ("not revisited", "chair"),
    ]
    # A map without walls knows everything.
    assert knowledge_of(map_of(left), Pose2D())(right.footprint)


def test_only_some_names_are_asked_for_and_an_unknown_one_is_an_error() -> None:
    first, second = map_of(thing("chair", 0, 0), thing("cup", 2, 2)), map_of(thing("cup", 5, 5))
    assert said(between(first, second, names=["cup"])) == [("moved", "cup")]
    assert said(between(first, second, names="cup")) == [("moved", "cup")]
    with pytest.raises(HypermapError, match="no object is called 'chiar'; did you mean 'chair'"):
        between(first, second, names=["chiar"])


PLACES = st.lists(
    st.tuples(st.sampled_from(["chair", "cup"]), st.integers(0, 12), st.integers(0, 12)),
    max_size=8,
    unique_by=lambda place: place[1:],
)


@settings(max_examples=60, deadline=None)
@given(before=PLACES, after=PLACES)
def test_every_object_of_both_maps_is_accounted_for_once(
    before: list[tuple[str, int, int]], after: list[tuple[str, int, int]]
) -> None:
    first, second = (map_of(*(thing(*place) for place in places)) for places in (before, after))
    found = between(first, second)
    old = sum(change.before is not None for change in found.changes) + found.unchanged
    new = sum(change.after is not None for change in found.changes) + found.unchanged
    assert (old, new) == (len(before), len(after))
    assert {change.kind for change in found.changes} <= set(KINDS)
    stayed = len(set(before) & set(after))
    assert found.unchanged >= stayed
    back = between(second, first)
    assert back.unchanged == found.unchanged
    opposite = {"added": "gone", "gone": "added"}
    assert sorted(opposite.get(c.kind, c.kind) for c in back.changes) == sorted(
        c.kind for c in found.changes
    )


def test_the_picture_shows_every_kind_and_an_arrow(tmp_path: Path) -> None:
    before = map_of(
        thing("chair", 0, 0), thing("cup", 2, 2), thing("plant", 6, 1), thing("tv", 8, 1)
    )
    after = map_of(
        thing("chair", 4, 3), thing("vase", 6, 1), thing("sofa", 1, 5), thing("tv", 8, 1)
    )
    changes = between(before, after)
    assert [change.kind for change in changes.changes] == ["added", "gone", "moved", "renamed"]
    path = tmp_path / "changes.svg"
    render_changes(before, changes, path, title="monday to tuesday")
    svg = path.read_text()
    for words in ("monday to tuesday", "plant: now vase", "sofa", "4 changes, 1 object unchanged"):
        assert words in svg, words
    added = between(before, map_of(*before["semantic"].objects(), thing("sofa", 1, 5)))
    render_changes(before, added, path)
    assert "as it is now" in path.read_text()
    assert "as it was" not in path.read_text()  # nothing is drawn as it was
    path = tmp_path / "none.png"
    grid = OccupancyLayer("grid", "map", GridGeometry(9, 9, 1.0), np.zeros((9, 9), int))
    render_changes(Hypermap([grid]), Changes((), 3), path)
    assert path.read_bytes().startswith(b"\x89PNG")
