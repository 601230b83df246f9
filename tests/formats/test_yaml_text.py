from __future__ import annotations

import contextlib
import datetime
import math
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import FormatError, HypermapError
from hypermap.formats import limits
from hypermap.formats.yaml_text import read_yaml, write_yaml


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", None),
        ("# nothing\n", None),
        ("a: 1\nb: [x, 0.5, yes, ~]", {"a": 1, "b": ["x", 0.5, True, None]}),
        ("\ufeffa: 1", {"a": 1}),
        ("é: 'no'", {"é": "no"}),
        ("a: !!str 12", {"a": "12"}),
        ("day: 2019-05-06", {"day": datetime.date(2019, 5, 6)}),
        ("a: &x {b: 1}\nc: *x", {"a": {"b": 1}, "c": {"b": 1}}),
        # Keys are not merged: the first program knew no merging either.
        ("a: &x {b: 1}\n<<: *x", {"a": {"b": 1}, "<<": {"b": 1}}),
    ],
)
def test_yaml_gives_plain_values(text: str, value: Any) -> None:
    assert read_yaml(text.encode(), "f") == value


def test_text_places_take_words_as_they_are_written() -> None:
    text = b"layers:\n- {name: no, frame_id: 010, size: 010}\n- {name: ~, frame_id: 1.50}\n"
    places = {("layers", "*", "name"), ("layers", "*", "frame_id")}
    assert read_yaml(text, "f", places) == {
        "layers": [{"name": "no", "frame_id": "010", "size": 8}, {"name": "~", "frame_id": "1.50"}]
    }


DEEP = limits.MAX_YAML_DEPTH
LAUGHS = b"a: &a [x,x,x,x,x,x,x,x,x,x]\n" + b"".join(
    b"%c: &%c [%s]\n" % (98 + i, 98 + i, b",".join([b"*%c" % (97 + i)] * 10)) for i in range(9)
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"a: 1\nb: 2\na: 3", "f: line 3: the key 'a' appears twice"),
        (b"x:\n  a: 1\n  'a': 3", "f: line 3: the key 'a' appears twice"),
        (
            b"a: b: c",
            "f: is not valid YAML: mapping values are not allowed in this",
        ),
        (b"{a: 1", "f: is not valid YAML: "),
        (b"a: 'x", "f: is not valid YAML: found unexpected end of stream"),
        (b"\x00\x01", "f: is not valid YAML: "),
        (b"a: \xff", "f: is not text in UTF-8; if it is text, save it in this encoding"),
        (b"--- 1\n--- 2", "f: line 2: a second document begins; one is expected"),
        (b"? [1, 2]\n: 3", "f: line 1: a key must be a single word or number"),
        (b"a: *b", "f: line 1: the alias *b has no finished anchor"),
        (b"a: &a [*a]", "f: line 1: the alias *a has no finished anchor"),
        (b"a: 2019-13-45", "f: line 1: '2019-13-45' is not a valid timestamp"),
        (b"a: !!int x", "f: line 1: 'x' is not a valid int"),
        (b"a: !!int ''", "f: line 1: '' is not a valid int"),
        (b"a: !!int '-'", "f: line 1: '-' is not a valid int"),
        (b"a: !!float _", "f: line 1: '_' is not a valid float"),
        (b"a: " + b"1" * 5000, f"f: line 1: '{'1' * 40}' is not a valid int"),
        (b"a: !!set {b}", "f: line 1: the tag tag:yaml.org,2002:set is not allowed"),
        (
            b"a: !!python/object/apply:os.system [ls]",
            "f: line 1: the tag tag:yaml.org,2002:python/object/apply:os.system is not allowed",
        ),
        (b"a: !foo bar", "f: line 1: the tag !foo is not allowed"),
        (b"[" * 100_000, f"f: line 1: is nested more than {DEEP} deep"),
        (b"- " * 100_000, f"f: line 1: is nested more than {DEEP} deep"),
        (LAUGHS, f"f: line 7: holds more than {limits.MAX_YAML_VALUES} values"),
    ],
    ids=lambda value: repr(value[:30]),
)
def test_bad_yaml_is_one_clear_error(text: bytes, message: str) -> None:
    with pytest.raises(FormatError) as error:
        read_yaml(text, "f")
    assert str(error.value).startswith(message)


@pytest.mark.parametrize(("limit", "value"), [("MAX_YAML_BYTES", 22), ("MAX_YAML_VALUES", 5)])
def test_what_could_not_be_read_again_is_not_written(
    monkeypatch: pytest.MonkeyPatch, limit: str, value: int
) -> None:
    document = {"a": [1, 2], "b": {"c": "text"}}  # six values in 23 bytes
    monkeypatch.setattr(limits, limit, value + 1)
    assert read_yaml(write_yaml(document), "f") == document
    monkeypatch.setattr(limits, limit, value)
    with pytest.raises(HypermapError, match="23 bytes of YAML are too large to read back"):
        write_yaml(document)


def test_a_text_that_is_too_large_is_not_parsed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MAX_YAML_BYTES", 10)
    with pytest.raises(FormatError, match="f: is larger than 10 bytes"):
        read_yaml(b"a: 12345678", "f")


@given(st.binary(max_size=60))
def test_any_bytes_are_yaml_or_a_format_error(content: bytes) -> None:
    with contextlib.suppress(FormatError):
        read_yaml(content, "f")


scalars = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=["Cs"]))
    | st.dates()
    | st.binary(max_size=8)
)
keys = st.text(st.characters(exclude_categories=["Cs"]), max_size=8) | st.integers(2)
values = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4)
)


@given(values)
def test_what_is_written_is_read_again(value: Any) -> None:
    again = read_yaml(write_yaml(value), "f")
    assert repr(again) == repr(value)  # repr tells 1 from True, and -0.0 from 0.0


def test_not_a_number_is_written_and_read() -> None:
    assert math.isnan(read_yaml(write_yaml([math.nan]), "f")[0])


class Color(str, Enum):
    RED = "red"


def test_values_of_other_libraries_become_plain() -> None:
    value = {
        "a": np.float64(0.1),
        "b": np.arange(2),
        "c": (1, 2),
        "d": Path("x/y"),
        "e": Color.RED,
        "f": np.str_("text"),
    }
    assert read_yaml(write_yaml(value), "f") == {
        "a": 0.1,
        "b": [0, 1],
        "c": [1, 2],
        "d": "x/y",
        "e": "red",
        "f": "text",
    }


def test_what_yaml_cannot_hold_is_a_type_error_with_its_place() -> None:
    with pytest.raises(TypeError) as error:
        write_yaml({"a": [1, {"b": object()}]})
    assert (
        str(error.value)
        == "the value['a'][1]['b'] cannot be saved: YAML cannot store the type object"
    )
    with pytest.raises(
        TypeError, match=r"a key of the value cannot be saved: YAML cannot store the type tuple"
    ):
        write_yaml({(1, 2): 3})
    endless: list[Any] = []
    endless.append(endless)
    with pytest.raises(HypermapError, match="nested too deeply"):
        write_yaml(endless)


def test_the_same_list_twice_is_written_twice() -> None:
    shared = ["a"]
    assert write_yaml([shared, shared]) == b"- [a]\n- [a]\n"


@pytest.mark.parametrize("digits", ["9" * 1001, "0x" + "f" * 1000, ":".join(["1"] * 600)])
def test_a_whole_number_too_long_to_be_written_again_is_refused(digits: str) -> None:
    with pytest.raises(FormatError) as error:
        read_yaml(f"size: {digits}".encode(), "objects")
    assert str(error.value) == f"objects: line 1: {digits[:40]!r} is not a valid int"
