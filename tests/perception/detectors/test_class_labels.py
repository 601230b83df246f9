from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import FileMissing, FormatError
from hypermap.perception.detectors.labels import COCO, parse_literal, parse_names, read_labels

names = st.lists(
    st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]), min_size=1), min_size=1
).map(tuple)


def test_coco_has_the_80_names_in_their_order() -> None:
    known = {0: "person", 9: "traffic light", 10: "fire hydrant", 39: "bottle", 41: "cup"}
    known |= {56: "chair", 57: "couch", 58: "potted plant", 62: "tv", 63: "laptop", 64: "mouse"}
    known |= {66: "keyboard", 67: "cell phone", 73: "book", 78: "hair drier", 79: "toothbrush"}
    assert len(set(COCO)) == len(COCO) == 80
    assert {number: COCO[number] for number in known} == known
    assert all(re.fullmatch("[a-z]+( [a-z]+)?", name) for name in COCO)


@pytest.mark.parametrize(
    ("file_name", "text"),
    [
        ("labels.txt", "cup\nwine glass\n"),
        ("labels.txt", "\ufeffcup\r\nwine glass"),
        ("coco.names", "cup \nwine glass\n\n"),
        ("labels.yaml", "[cup, wine glass]"),
        ("labels.yml", "1: wine glass\n0: cup\n"),
        ("data.yaml", "path: ../coco\nnames:\n  0: cup\n  1: wine glass\n"),
        ("labels.json", '["cup", "wine glass"]'),
        ("labels.JSON", '{"names": ["cup", "wine glass"]}'),
    ],
)
def test_labels_are_read_from(file_name: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / file_name
    path.write_text(text, encoding="utf-8", newline="")
    assert read_labels(path) == ("cup", "wine glass")


@pytest.mark.parametrize(
    ("file_name", "content", "expected"),
    [
        ("labels.txt", b"", "not a file of labels: the name of class 0 is ''; expected words"),
        (
            "labels.txt",
            b"cup\n\nbowl\n",
            "not a file of labels: the name of class 1 is ''; expected words",
        ),
        (
            "labels.txt",
            b"\xff\xd8\xff\xe0",
            "is not text in UTF-8; if it is text, save it in this encoding",
        ),
        (
            "labels.yaml",
            b"",
            "not a file of labels: expected a list of names, or a mapping from number to name",
        ),
        (
            "labels.yaml",
            b"names: 3",
            "not a file of labels: expected a list of names, or a mapping from number to name",
        ),
        (
            "labels.yaml",
            b"[cup, no]",
            "not a file of labels: the name of class 1 is False; expected words",
        ),
        (
            "labels.yaml",
            b"{1: cup, 2: bowl}",
            "not a file of labels: classes must be numbered from 0 to 1",
        ),
        (
            "labels.yaml",
            b"!!python/object/apply:os.system [exit]",
            "not a file of labels: could not determine a constructor for the tag "
            "'tag:yaml.org,2002:python/object/apply:os.system' in ",
        ),
        ("labels.json", b"[" * 5000, "not a file of labels: "),
        ("labels.txt", b"x" * 1_000_001, "labels take at most 1000000 bytes"),
    ],
)
def test_other_files_are_an_error(
    file_name: str, content: bytes, expected: str, tmp_path: Path
) -> None:
    path = tmp_path / file_name
    path.write_bytes(content)
    with pytest.raises(FormatError) as error:
        read_labels(path)
    assert str(error.value).startswith(f"{path}: {expected}")
    assert "\n" not in str(error.value)


def test_a_missing_file_of_labels_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileMissing, match=r"labels\.txt: there is no such file of labels$"):
        read_labels(tmp_path / "labels.txt")


@given(names)
def test_names_in_metadata_are_read_as_python_writes_them(expected: tuple[str, ...]) -> None:
    assert parse_names(str(dict(enumerate(expected)))) == expected
    assert parse_names(str(list(expected))) == expected


@given(names)
def test_names_come_back_from_yaml_and_json(
    tmp_path_factory: pytest.TempPathFactory, expected: tuple[str, ...]
) -> None:
    folder = tmp_path_factory.mktemp("labels")
    (folder / "a.yaml").write_text(yaml.safe_dump(dict(enumerate(expected))), encoding="utf-8")
    (folder / "a.json").write_text(json.dumps({"names": expected}), encoding="utf-8")
    assert read_labels(folder / "a.yaml") == read_labels(folder / "a.json") == expected


@pytest.mark.parametrize("text", ["(" * 1000, "-" * 100_000 + "1", "open('/etc/passwd')", "\0", ""])
def test_what_is_no_literal_is_not_evaluated(text: str) -> None:
    with pytest.raises(ValueError, match="expected a Python literal, got"):
        parse_literal(text)


def test_a_literal_has_a_bounded_length() -> None:
    with pytest.raises(ValueError, match="longer than 1000000 characters"):
        parse_literal("1" * 1_000_001)
