from __future__ import annotations

import gc
import string
import time
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import limits
from hypermap.formats.columns.footprints import footprint_to_wkt
from hypermap.formats.semantic.records import record_from_object
from hypermap.formats.semantic.regular_yaml import read_regular
from hypermap.formats.semantic.yaml_files import parse_objects
from hypermap.formats.semantic.yaml_writing import dump_table
from hypermap.formats.yaml_text import write_yaml

from ..strategies import object_facts, semantic_layers

SQUARE = "POLYGON((0 0, 1 0, 1 1, 0 1, 0 0))"
ENTRY = f"- name: cup\n  shape: {SQUARE}\n"

words = st.sampled_from(
    ["cup", "potted plant", "no", "12", "1.5", "2019-05-06", "2019-13-45", "'no'", "''", "t-shirt",
     "é", "~", "a: b", "a #b", "x ", "&a", "*a", "!!str a", "[a]", "a,b", "null", "'", '"a"', "-"]
)  # fmt: skip
numbers = st.sampled_from(
    ["0.5", "1", "-0", "0.1e5", "1e5", "1E-5", "1.0e-05", "+1", ".5", "1.", "010", "0o7", "1_0",
     "1:30", ".inf", "1e999", "nan", "true", "12345678901234567890123", "''", "~", "1,2", "- 1"]
)  # fmt: skip
shapes = st.sampled_from(
    [SQUARE, "POLYGON((0 0,1 0,1 1))", "POLYGON ((0 0, 2 0, 2 2, 0 0))", "POLYGON((0 0, 1 0, 0 0))",
     "POLYGON((0 0, 3 0, 3 3, 0 3, 0 0), (1 1, 2 1, 2 2, 1 1))", "POLYGON((0 0, 1 0))",
     "MULTIPOLYGON(((0 0, 1 0, 1 1, 0 0)), ((5 5, 6 5, 6 6, 5 5)))", "POLYGON((0 0 1 0 1 1))",
     "POLYGON((0 0, 1 0, 1 1))#", "POLYGON((0  0, 1 0, 1 1))", "POLYGON((-0 +1, .5 1., 1e1 1E-1))",
     "POLYGON EMPTY", "5POLYGON((0 0, 1 0, 1 1))", "POLYGON((0 0, 1e400 0, 1 1))", "POINT(0 0)",
     "POLYGON((0.1 0.30000000000000004, 123456.78901234567 2, -7 1e-7))", f"'{SQUARE}'"]
)  # fmt: skip
lines = (
    st.builds("  name: {}".format, words)
    | st.builds("  shape: {}".format, shapes)
    | st.builds("  tags: [{}]".format, st.lists(words, max_size=3).map(", ".join))
    | st.builds("  confidence: [{}]".format, st.lists(numbers, max_size=3).map(",".join))
    | st.builds(
        "  {}: {}".format, st.sampled_from(["existence", "first_seen", "last_seen"]), numbers
    )
    | st.builds("  id: {}".format, st.sampled_from(["0", "1", "7", "01", "-1", "2147483648", "x"]))
    | st.builds(
        "  {}: {}".format,
        st.sampled_from(["mass", "no", "attributes", "z_max", "A", "on", "y", "12"]),
        words | numbers,
    )
    | st.sampled_from(["", "# hello", "  - a", "---", "  z: {a: 1}", "  mass: 1 ", "\tx: 1"])
)
regular_lines = st.tuples(
    st.none() | st.lists(words, max_size=3).map(lambda tags: f"  tags: [{', '.join(tags)}]"),
    st.none() | st.lists(numbers, max_size=3).map(lambda c: f"  confidence: [{', '.join(c)}]"),
    *(st.none() | numbers.map(f"  {key}: {{}}".format) for key in ("existence", "last_seen")),
    st.none() | (words | numbers).map("  mass: {}".format),
    st.none() | st.sampled_from(["  id: 0", "  id: 2", "  id: 5"]),
).map(lambda chosen: [line for line in chosen if line is not None])


@st.composite
def files(draw: st.DrawFn) -> str:
    """Files of the regular form, or nearly so."""
    text = ""
    for _ in range(draw(st.integers(1, 4))):
        rest = draw(regular_lines | st.lists(lines, max_size=3))
        text += "\n".join([f"- name: {draw(words)}", f"  shape: {draw(shapes)}", *rest]) + "\n"
    return text[: len(text) - draw(st.integers(0, 1))]


def facts(table: ObjectTable) -> list[Any]:
    return [object_facts(table.object(row)) for row in range(len(table))]


@given(files())
def test_whatever_is_read_here_means_the_same_to_the_reader_of_all_yaml(text: str) -> None:
    table = read_regular(text.encode())
    if table is not None:
        objects, rejected = parse_objects(text.encode(), "t")
        assert rejected == []
        assert facts(table) == [object_facts(item) for item in objects]


@given(st.text(string.printable + "é\u2028\x85\ufeff", max_size=12), st.integers(0, len(ENTRY) - 1))
def test_odd_letters_anywhere_mean_the_same_or_are_left_to_the_other(text: str, at: int) -> None:
    content = (ENTRY[:at] + text + ENTRY[at:] + ENTRY).encode()
    table = read_regular(content)
    if table is not None:
        objects, rejected = parse_objects(content, "t")
        assert rejected == []
        assert facts(table) == [object_facts(item) for item in objects]


def test_many_beginnings_in_one_line_are_not_tried_each_to_its_end() -> None:
    started = time.process_time()
    assert read_regular(b"- name: " * 50_000) is None  # once, this took minutes
    assert time.process_time() - started < 5


@given(semantic_layers())
def test_text_is_as_the_writer_of_all_yaml_writes_it(layer: SemanticLayer) -> None:
    entries = []
    for position, item in enumerate(layer.objects()):
        record = record_from_object(item)
        entry = {"name": record.pop("name"), "shape": footprint_to_wkt(item.footprint), **record}
        entries.append(entry if item.id == position else {**entry, "id": item.id})
    assert dump_table(layer.table) == write_yaml(entries)


def many(count: int) -> list[SemanticObject]:
    rng = np.random.default_rng(0)
    corners = rng.uniform(-100, 100, (count, 2))
    return [
        SemanticObject(
            name=["cup", "potted plant", "no"][k % 3],
            footprint=shapely.box(*corner, *(corner + rng.uniform(0.1, 2, 2))),
            id=k,
            tags=("cup", "bowl", "12")[: k % 4],
            confidence=tuple(rng.uniform(0, 1, k % 4).tolist()),
            existence=float(k) if k % 2 else None,
            first_seen=1305031229.5 + k,
            attributes={"z_max": k * 1e-7, "evidence": k, "state": "yes"} if k % 5 else {},
        )
        for k, corner in enumerate(corners)
    ]


def test_what_we_write_is_of_the_regular_form() -> None:
    objects = many(5000)  # of several chunks
    content = dump_table(ObjectTable.of(objects))
    table = read_regular(content)
    assert table is not None
    assert facts(table) == [object_facts(item) for item in objects]


@pytest.mark.parametrize(
    "text",
    [
        ENTRY + "- name: bin\n  shape: POLYGON((3 4,2.5 5,3.5 4.5))\n",
        ENTRY + "  tags: [furniture, chair, table]\n  confidence: [0.8, 0.6, 0.3]\n",
        ENTRY + "  z_min: 0\n  state: on\n  id: 7\n" + ENTRY,
        "- name: é\n" + ENTRY[ENTRY.index("  shape") :],
    ],
)
def test_files_of_the_first_program_are_of_the_regular_form(text: str) -> None:
    table = read_regular(text.encode())
    assert table is not None
    assert facts(table) == [object_facts(item) for item in parse_objects(text.encode(), "t")[0]]


@pytest.mark.parametrize("limit", ["MAX_YAML_BYTES", "MAX_YAML_VALUES"])
def test_the_limits_are_those_of_the_other_reader(
    monkeypatch: pytest.MonkeyPatch, limit: str
) -> None:
    text = (ENTRY + "  tags: [a, b]\n  id: 7\n").encode()
    value = {"MAX_YAML_BYTES": len(text), "MAX_YAML_VALUES": 8}[limit]
    monkeypatch.setattr(limits, limit, value)
    assert read_regular(text) is not None
    assert dump_table(ObjectTable.of(parse_objects(text, "t")[0])) == text
    monkeypatch.setattr(limits, limit, value - 1)
    assert read_regular(text) is None


def test_what_is_read_is_freed_without_the_collector() -> None:
    """It counts objects, not how large they are."""
    gc.disable()
    try:
        gc.collect(0)
        assert read_regular(ENTRY.encode()) is not None
        assert gc.collect(0) == 0
    finally:
        gc.enable()
