"""Names of things: synonyms, plurals and kinds."""

from __future__ import annotations

from pathlib import Path

import pytest

from hypermap.core.errors import FileMissing, FormatError
from hypermap.perception.detectors.labels import COCO
from hypermap.questions import load_taxonomy


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        ("couch", ["sofa"]),
        ("seating", ["sofa", "chair"]),
        ("cup", ["mug", "cup"]),
        ("mug", ["mug"]),
        ("TV", ["tvmonitor"]),
        ("monitors", ["tvmonitor"]),
        ("furniture", ["sofa", "chair", "dining_table"]),
        ("shelves", []),
        ("Zorblax 3000", ["Zorblax 3000"]),
        ("things", ["sofa", "mug", "cup", "chair", "tvmonitor", "dining_table", "Zorblax 3000"]),
    ],
)
def test_a_name_finds_synonyms_and_kinds(asked: str, found: list[str]) -> None:
    names = ["sofa", "mug", "cup", "chair", "tvmonitor", "dining_table", "Zorblax 3000"]
    assert load_taxonomy().matching(asked, names) == found


def test_all_classes_of_coco_are_known() -> None:
    taxonomy = load_taxonomy()
    assert [name for name in COCO if taxonomy.usual_name(name) is None] == []


def test_a_file_of_the_user_adds_and_replaces(tmp_path: Path) -> None:
    file = tmp_path / "ours.yaml"
    file.write_text("espresso cup: {is: cup, also: [tiny cup], plural: [espresso cups]}\nmug:\n")
    taxonomy = load_taxonomy(file)
    names = ["espresso_cup", "mug"]
    assert taxonomy.matching("cup", names) == ["espresso_cup"]
    assert taxonomy.matching("tiny cups", names) == ["espresso_cup"]
    assert load_taxonomy().matching("cup", names) == ["mug"]  # ours is as it was


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- cup", "expected names of things"),
        ("cup: [1", "not a taxonomy"),
        ("cup: {was: mug}", "cup: expected a mapping with `is`, `also` and `plural`"),
        ("cup: {also: mug}", "cup: `is` is a name; `also` and `plural` are lists"),
        ("cup: {is: vessel}", "cup: its kind 'vessel' is not in the taxonomy"),
        ("a: {is: b}\nb: {is: a}", "a: is of its own kind, by way of 'a'"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text(text)
    with pytest.raises(FormatError, match=message):
        load_taxonomy(file)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileMissing, match=r"none.yaml: no such file"):
        load_taxonomy(tmp_path / "none.yaml")
