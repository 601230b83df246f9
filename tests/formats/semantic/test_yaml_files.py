from __future__ import annotations

import contextlib
import logging
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import FormatError
from hypermap.core.semantic import Rejected, SemanticObject
from hypermap.formats.semantic.yaml_files import PLUGIN, dump_objects, parse_objects, parse_table
from hypermap.formats.store import MemoryStore

from ..strategies import object_facts

SQUARE = "POLYGON((0 0, 1 0, 1 1, 0 1, 0 0))"
SCRIBBLE = shapely.Polygon(np.random.default_rng(0).random((3000, 2)) * 10).wkt


def parse(text: str) -> tuple[list[SemanticObject], list[Rejected]]:
    return parse_objects(text.encode(), "t.hmap/semantic")


def test_an_old_file_gives_objects_whose_ids_are_their_positions() -> None:
    objects, rejected = parse(
        "- name: chair\n"
        "  shape: POLYGON((0 0,0 1,1 1,1 0,0 0))\n"
        "  tags: [furniture, chair, table]\n"
        "  confidence: [0.8, 0.6, 0.3]\n"
        "- name: bin\n"
        "  shape: POLYGON((3 4,2.5 5,3.5 4.5))  # left open\n"
    )
    assert rejected == []
    assert [(item.id, item.name) for item in objects] == [(0, "chair"), (1, "bin")]
    assert objects[0].tags == ("furniture", "chair", "table")
    assert objects[0].confidence == (0.8, 0.6, 0.3)
    assert objects[1].tags == ()
    assert objects[1].footprint.equals(shapely.Polygon([(3, 4), (2.5, 5), (3.5, 4.5)]))
    assert not objects[0].footprint.exterior.is_ccw  # as it was written


def test_what_the_first_program_could_not_hold_stands_under_keys_of_its_own() -> None:
    item = SemanticObject(
        name="cup",
        footprint=shapely.Polygon([(0, 0), (0.1 + 0.2, 0), (1, 1)]),
        id=7,
        tags=("cup", "bowl"),
        confidence=(0.5, 0.25),
        existence=2.5,
        first_seen=1305031229.5287,
        last_seen=1305031230.0,
        attributes={"z_max": 1.2, "color": "red", "shape": "round"},
    )
    text = dump_objects([item])
    assert text.decode() == (
        "- name: cup\n"
        "  shape: POLYGON((0 0, 0.30000000000000004 0, 1 1, 0 0))\n"
        "  tags: [cup, bowl]\n"
        "  confidence: [0.5, 0.25]\n"
        "  existence: 2.5\n"
        "  first_seen: 1305031229.5287\n"
        "  last_seen: 1305031230.0\n"
        "  attributes:\n"
        "    shape: round\n"
        "  z_max: 1.2\n"
        "  color: red\n"
        "  id: 7\n"
    )
    ((again,), rejected) = parse_objects(text, "t")
    assert rejected == []
    assert object_facts(again) == object_facts(item)


@pytest.mark.parametrize("number", ["nan", "1e999", "-inf"])
def test_a_coordinate_that_is_not_finite_is_said_once_and_by_us(number: str) -> None:
    text = f"- name: cup\n  shape: POLYGON((0 0, {number} 0, 1 1, 0 0))\n"
    table, (rejected,) = parse_table(text.encode(), "t")  # without a warning of numpy's
    assert len(table) == 0
    assert rejected.reason.startswith("a footprint must be finite and within 1e+09 m")


def test_an_entry_that_claims_the_id_of_an_object_does_not_take_it_when_saved() -> None:
    text = f"""
- {{name: cup, shape: "{SQUARE}"}}
- {{name: mug, shape: "{SQUARE}", id: 1}}
- {{name: jug, shape: "{SQUARE}", id: 1}}
- {{name: bowl, shape: "{SQUARE}", id: 2}}
"""
    objects, rejected = parse(text)
    assert [(item.id, item.name) for item in objects] == [(0, "cup"), (1, "mug"), (2, "bowl")]
    again, rejected_again = parse(dump_objects(objects, rejected).decode())
    assert [object_facts(item) for item in again] == [object_facts(item) for item in objects]
    assert [entry.entry for entry in rejected_again] == [entry.entry for entry in rejected]


def test_an_object_that_could_not_be_read_again_cannot_be_made() -> None:
    with pytest.raises(ValueError, match=r"confidence must be finite, got \(nan,\)"):
        SemanticObject("cup", shapely.box(0, 0, 1, 1), confidence=(float("nan"),))


def test_words_that_yaml_takes_for_something_else_are_names() -> None:
    objects, _ = parse(
        f"- {{name: no, shape: '{SQUARE}', tags: [12, ~, 1.50]}}\n"
        f"- {{name: 2019-05-06, shape: '{SQUARE}'}}\n"
        f"- {{name: '', shape: '{SQUARE}', tags: }}\n"
    )
    assert [item.name for item in objects] == ["no", "2019-05-06", ""]
    assert objects[0].tags == ("12", "~", "1.50")
    assert parse_objects(dump_objects(objects), "t")[0][1].name == "2019-05-06"


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        (f"{{shape: '{SQUARE}'}}", "its name is missing"),
        (f"{{name: [a], shape: '{SQUARE}'}}", "its name must be text, found a list"),
        ("{name: cup}", "its shape is missing"),
        ("{name: cup, shape: [1, 2]}", "its shape must be text, found a list"),
        ("just text", "expected a name and a shape, found 'just text'"),
        ("[1, 2]", "expected a name and a shape, found a list"),
        ("", "expected a name and a shape, found nothing"),
        ("{name: cup, shape: 'POLYGON(())'}", "point 0 of its shape has 0 numbers, not 2"),
        ("{name: cup, shape: POLYGON EMPTY}", "a footprint must not be empty"),
        (
            "{name: cup, shape: 'POLYGON((0 0, 1 0, 1 1, 0 0), EMPTY)'}",
            "a hole of a footprint must have corners; leave out the empty hole",
        ),
        (
            "{name: cup, shape: POINT(0 0)}",
            "a footprint must be a polygon or multipolygon, got Point",
        ),
        (
            "{name: cup, shape: 'LINESTRING(0 0, 1 1)'}",
            "a footprint must be a polygon or multipolygon, got LineString",
        ),
        (
            "{name: cup, shape: 'POLYGON((0 0 1, 1 0 1, 1 1 1, 0 0 1))'}",
            "a footprint is 2D; its points must have two coordinates",
        ),
        (
            "{name: cup, shape: 'POLYGON((0 0, nan 0, 1 1))'}",
            "its shape has a coordinate that is not finite",
        ),
        (f"{{name: cup, shape: '{SQUARE}', id: -1}}", "id: input should be greater than or equal"),
        (f"{{name: cup, shape: '{SQUARE}', id: x}}", "id: input should be a valid integer"),
        (f"{{name: cup, shape: '{SQUARE}', tags: cup}}", "tags: input should be a list, found"),
        (
            f"{{name: cup, shape: '{SQUARE}', confidence: [1, .nan]}}",
            "confidence[1]: input should be a finite number, found nan",
        ),
        (
            f"{{name: cup, shape: '{SQUARE}', existence: .inf}}",
            "existence: input should be a finite number, found inf",
        ),
        (
            f"{{name: cup, shape: '{SQUARE}', attributes: 3}}",
            "attributes: input should be a valid dictionary, found 3",
        ),
        (f"{{name: cup, shape: '{SQUARE}', id: 2}}", "its id 2 is that of another object"),
        (
            f"{{name: cup, shape: '{SCRIBBLE}'}}",
            "an outline of 3001 corners crosses or touches itself too often",
        ),
    ],
)
def test_a_broken_entry_is_reported_and_the_others_load(entry: str, reason: str) -> None:
    before = f"- {{name: a, shape: '{SQUARE}', id: 2}}\n"
    after = f"- {{name: b, shape: '{SQUARE}', id: 3}}\n"
    objects, rejected = parse(f"{before}- {entry}\n{after}")
    assert [(item.id, item.name) for item in objects] == [(2, "a"), (3, "b")]
    assert len(rejected) == 1
    assert rejected[0].position == 1
    assert rejected[0].reason.startswith(reason)
    # It is kept, and reported again.
    text = dump_objects(objects, rejected)
    again = parse_objects(text, "t")
    assert [object_facts(item) for item in again[0]] == [object_facts(item) for item in objects]
    assert [item.reason for item in again[1]] == [rejected[0].reason]
    assert parse_objects(dump_objects(*again), "t")[1] == again[1]


def test_a_broken_entry_goes_to_the_end_with_its_id_where_old_readers_stop() -> None:
    objects, rejected = parse(
        f"- {{name: a, shape: '{SQUARE}'}}\n"
        "- {name: broken, shape: 'POLYGON((0 0, 1', color: red}\n"
        f"- {{name: b, shape: '{SQUARE}'}}\n"
    )
    assert [item.id for item in objects] == [0, 2]
    assert rejected[0].entry == {"name": "broken", "shape": "POLYGON((0 0, 1", "color": "red"}
    text = dump_objects(objects, rejected)
    assert text.decode() == (
        f"- name: a\n  shape: {SQUARE}\n"
        f"- name: b\n  shape: {SQUARE}\n  id: 2\n"
        "- name: broken\n  shape: POLYGON((0 0, 1\n  color: red\n  id: 1\n"
    )
    again = parse_objects(text, "t")
    assert [item.id for item in again[0]] == [0, 2]
    assert again[1] == rejected


def test_the_log_names_a_broken_entry_with_its_number(caplog: pytest.LogCaptureFixture) -> None:
    store = MemoryStore({"semantic": b"- {name: cup, shape: POLYGON EMPTY}"}, where="t.hmap")
    with caplog.at_level(logging.WARNING):
        layer = PLUGIN.load(store, "semantic", "objects", "map", {})
    assert caplog.messages == [
        "t.hmap/semantic: object 0 'cup' is left out: a footprint must not be empty"
    ]
    assert len(layer) == 0
    PLUGIN.save(layer, store, "semantic")
    assert b"POLYGON EMPTY" in store.read("semantic")


def test_an_object_whose_position_is_claimed_by_another_gets_a_free_id() -> None:
    objects, rejected = parse(
        f"- {{name: a, shape: '{SQUARE}', id: 1}}\n"
        f"- {{name: b, shape: '{SQUARE}'}}\n"
        f"- {{name: c, shape: '{SQUARE}', id: 3}}\n"
    )
    assert rejected == []
    assert [item.id for item in objects] == [1, 4, 3]


def test_keys_of_other_programs_are_kept_beside_ours() -> None:
    ((item,), _) = parse(f"- {{name: a, shape: '{SQUARE}', mass: 3, 7: seven, on: [1, {{}}]}}")
    assert item.attributes == {"mass": 3, 7: "seven", True: [1, {}]}
    ((again,), _) = parse_objects(dump_objects([item]), "t")
    assert again.attributes == item.attributes


@pytest.mark.parametrize("text", ["", "# nothing\n", "[]", "~"])
def test_a_file_without_entries_is_an_empty_layer(text: str) -> None:
    assert parse(text) == ([], [])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name: chair", "t.hmap/semantic: expected a list of objects, found keys and values"),
        ("hello", "t.hmap/semantic: expected a list of objects, found 'hello'"),
        ("- [", "t.hmap/semantic: is not valid YAML: "),
        ("- {name: a, name: b}", "t.hmap/semantic: line 1: the key 'name' appears twice"),
        ("- !!python/name:os.system a", "t.hmap/semantic: line 1: the tag "),
    ],
)
def test_a_file_that_is_no_list_is_an_error(text: str, message: str) -> None:
    with pytest.raises(FormatError) as error:
        parse(text)
    assert str(error.value).startswith(message)


INTACT = dump_objects(
    [
        SemanticObject("chair", shapely.box(0, 0, 1, 1), 4, ("a",), (0.5,), 1.0, 2.0, 3.0, {"x": 1})
        for _ in range(2)
    ]
)


@given(st.data())
def test_damage_never_gives_another_error(data: Any) -> None:
    content = bytearray(INTACT)
    for _ in range(data.draw(st.integers(1, 6))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    with contextlib.suppress(FormatError):
        objects, rejected = parse_objects(bytes(content), "t")
        again = parse_objects(dump_objects(objects, rejected), "t")
        assert [object_facts(item) for item in again[0]] == [object_facts(i) for i in objects]
