"""Notes in files: what is attached is in the map or next to it, and never half there."""

from __future__ import annotations

import json
import logging
import os
import zipfile
from pathlib import Path
from typing import Any

import pytest
import shapely

from hypermap import (
    FormatError,
    Hypermap,
    HypermapError,
    Note,
    NotesLayer,
    OpaqueLayer,
    open_map,
    save_map,
)
from hypermap.formats import atomic
from hypermap.formats.beside import export_files, unused_beside
from hypermap.notes import attachment_of, attachment_of_bytes, notes_layer
from hypermap.testing import occupancy_from_text
from hypermap.testing.comparing import assert_same_map

from .maps import archive, files_of

SMALL, LARGE = b"small", b"large " * 50


def map_with(*notes: Note, inside_up_to: int = 100) -> Hypermap:
    layer = NotesLayer("notes", "map", notes, inside_up_to=inside_up_to)
    return Hypermap([occupancy_from_text("..\n..", resolution=1.0), layer])


def note_with(*contents: bytes) -> Note:
    files = tuple(attachment_of_bytes(each, f"{i}.log") for i, each in enumerate(contents))
    return Note(shapely.Point(1, 1), "note", attachments=files)


def contents_in(hypermap: Hypermap) -> list[bytes]:
    found = []
    for each in (file for note in notes_layer(hypermap) for file in note.attachments):
        with each.open() as opened:
            found.append(opened.read())
    return found


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "office.hmap"
    save_map(map_with(note_with(SMALL, LARGE)), path)
    return path


def test_small_files_are_in_the_map_and_large_ones_next_to_it(saved: Path):
    (beside,) = (saved.parent / "office.hmap.media").iterdir()
    assert beside.read_bytes() == LARGE
    names = zipfile.ZipFile(saved).namelist()
    assert [name.partition("/")[0] for name in names if "/" in name] == ["notes"]
    assert contents_in(open_map(saved)) == [SMALL, LARGE]


def test_the_limit_is_kept_in_the_map(saved: Path):
    assert notes_layer(open_map(saved)).inside_up_to == 100


def test_a_folder_map_keeps_them_too(tmp_path: Path):
    save_map(map_with(note_with(SMALL, LARGE)), tmp_path / "map.yaml")
    assert contents_in(open_map(tmp_path / "map.yaml")) == [SMALL, LARGE]
    assert (tmp_path / "map.yaml.media").is_dir()


def test_a_copy_under_another_name_has_files_of_its_own(saved: Path, tmp_path: Path):
    other = tmp_path / "other"
    other.mkdir()
    save_map(open_map(saved), other / "copy.hmap")
    for file in (saved.parent / "office.hmap.media").iterdir():
        file.unlink()
    assert contents_in(open_map(other / "copy.hmap")) == [SMALL, LARGE]


def test_a_renamed_map_finds_the_folder_that_it_names(saved: Path):
    renamed = saved.rename(saved.with_name("hall.hmap"))
    assert contents_in(open_map(renamed)) == [SMALL, LARGE]


def test_a_map_whose_files_were_left_behind_opens_says_so_and_saves(saved: Path, caplog):
    moved = saved.rename(saved.parent.parent / f"{saved.parent.name}.hmap")
    hypermap = open_map(moved)
    small, large = notes_layer(hypermap)[1].attachments
    assert small.is_there
    assert not large.is_there
    with pytest.raises(FileNotFoundError, match=r"'1\.log' is missing; copy it next to the map"):
        large.open()
    with caplog.at_level(logging.WARNING):
        save_map(hypermap, moved)
    assert "missing" in caplog.text
    assert [each.sha256 for each in notes_layer(open_map(moved))[1].attachments] == [
        small.sha256,
        large.sha256,
    ]
    moved.unlink()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
def test_what_is_no_regular_file_next_to_the_map_is_missing_and_nobody_waits_for_it(saved: Path):
    (large,) = (saved.parent / "office.hmap.media").iterdir()
    large.unlink()
    os.mkfifo(large)
    kept = notes_layer(open_map(saved))[1].attachments[1]
    assert not kept.is_there
    with pytest.raises(FileNotFoundError, match="is missing"):
        kept.open()


def test_what_was_replaced_by_a_link_since_is_missing_and_not_followed(saved: Path, tmp_path: Path):
    opened = open_map(saved)
    (large,) = (saved.parent / "office.hmap.media").iterdir()
    large.rename(tmp_path / "elsewhere")
    large.symlink_to(tmp_path / "elsewhere")
    kept = notes_layer(opened)[1].attachments[1]
    assert not kept.is_there
    with pytest.raises(FileNotFoundError, match="is missing"):
        kept.open()


def test_a_link_with_the_name_of_a_file_to_come_is_not_written_through(saved: Path, tmp_path: Path):
    """Whoever made the map knows what will be written next to it, and where to."""
    opened = open_map(saved)
    layer = notes_layer(opened)
    layer.inside_up_to = 0
    link = saved.parent / "office.hmap.media" / layer[1].attachments[0].sha256
    link.symlink_to(tmp_path / "profile")
    for exists in (False, True):
        with pytest.raises(HypermapError, match="is a link that leads out of the folder"):
            save_map(opened, saved)
        assert (tmp_path / "profile").exists() == exists
        (tmp_path / "profile").write_text("precious")
    assert (tmp_path / "profile").read_text() == "precious"


def test_a_name_that_no_folder_can_have_is_that_of_a_missing_one(saved: Path, tmp_path: Path):
    document = json.loads(zipfile.ZipFile(saved).read("notes.geojson"))
    document["beside"] = "x" * 300
    content = {**files_of(saved), "notes.geojson": json.dumps(document)}
    opened = open_map(archive(tmp_path / "long.hmap", content))
    assert [each.is_there for each in notes_layer(opened)[1].attachments] == [True, False]


def test_the_same_file_at_two_notes_is_kept_once(tmp_path: Path):
    save_map(map_with(note_with(LARGE), note_with(LARGE, SMALL)), tmp_path / "m.hmap")
    assert len(list((tmp_path / "m.hmap.media").iterdir())) == 1
    assert contents_in(open_map(tmp_path / "m.hmap")) == [LARGE, LARGE, SMALL]


def test_a_file_that_changed_after_it_was_attached_stops_the_save(tmp_path: Path):
    big = tmp_path / "big.bin"
    big.write_bytes(b"x" * 3_000_000)
    hypermap = map_with(Note(shapely.Point(1, 1), "n", attachments=(attachment_of(big),)))
    big.write_bytes(b"y" * 3_000_000)
    with pytest.raises(HypermapError, match=r"big\.bin: the file has changed since"):
        save_map(hypermap, tmp_path / "m.hmap")
    assert not (tmp_path / "m.hmap").exists()
    assert list((tmp_path / "m.hmap.media").iterdir()) == []
    big.unlink()
    with pytest.raises(FileNotFoundError, match="is missing"):
        save_map(hypermap, tmp_path / "m.hmap")


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_save_that_fails_leaves_the_old_map_whole(saved: Path, monkeypatch, call: str):
    before = open_map(saved)
    hypermap = open_map(saved)
    notes_layer(hypermap).add(note_with(b"another large file " * 20))

    def fail(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    target = atomic.os if call == "fsync" else Path
    monkeypatch.setattr(target, call, fail)
    with pytest.raises(HypermapError, match="No space left"):
        save_map(hypermap, saved)
    monkeypatch.undo()
    assert_same_map(open_map(saved), before)
    assert len(list((saved.parent / "office.hmap.media").iterdir())) == 1


def test_files_that_no_note_uses_any_more_are_known(saved: Path):
    hypermap = open_map(saved)
    folder = saved.parent / "office.hmap.media"
    (folder / "notes.txt").write_text("not ours")
    used = notes_layer(hypermap)[1].attachments
    assert unused_beside(folder, used) == []
    assert [path.name for path in unused_beside(folder, ())] == [used[1].sha256]
    assert unused_beside(folder / "none", ()) == []
    (folder / "link").symlink_to(folder)
    with pytest.raises(HypermapError, match="is a link, so nothing in it is deleted"):
        unused_beside(folder / "link", ())


def test_exported_files_have_the_names_that_people_know(tmp_path: Path):
    names = ("tile.jpg.txt", "../../evil", "a/b\\c", "CON\n", ".bashrc", "tile.jpg.txt")
    files = tuple(attachment_of_bytes(name.encode(), name) for name in names)
    layer = NotesLayer("notes", "map", [Note(shapely.Point(0, 0), "n", attachments=files)])
    written = export_files(layer, tmp_path / "out")
    assert {path.parent for path in written} == {tmp_path / "out"}
    assert [path.name for path in written] == [
        "1-tile.jpg.txt",
        "1-evil",
        "1-c",
        "1-CON",
        "1-bashrc",
        "1-6-tile.jpg.txt",
    ]
    assert written[1].read_bytes() == b"../../evil"
    assert export_files(layer, tmp_path / "out") == written
    written[1].write_bytes(b"of another")  # as long
    with pytest.raises(HypermapError, match="1-evil: already exists with different content"):
        export_files(layer, tmp_path / "out")
    assert written[1].read_bytes() == b"of another"


def test_a_folder_for_which_there_is_no_room_is_named(tmp_path: Path, monkeypatch):
    def full(self: Path, **_: bool) -> None:
        raise OSError(28, "No space left on device", str(self))

    monkeypatch.setattr(Path, "mkdir", full)
    with pytest.raises(HypermapError, match=r"out: cannot be created: No space .*; free space"):
        export_files([], tmp_path / "out")


def test_old_readers_keep_the_notes_byte_for_byte(saved: Path, tmp_path: Path, monkeypatch):
    monkeypatch.setattr("hypermap.formats.hmap.plugin_for", lambda name: _old_plugin(name))
    old = open_map(saved)
    assert isinstance(old["notes"], OpaqueLayer)
    save_map(old, saved)
    monkeypatch.undo()
    assert contents_in(open_map(saved)) == [SMALL, LARGE]


def _old_plugin(name: str) -> Any:
    from hypermap.formats.plugins import plugin_for

    return None if name == "NotesLayer" else plugin_for(name)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.update(hypermap_notes=2), "is of version 2"),
        (lambda d: d.update(beside="../elsewhere"), "not a folder next to the map"),
        (lambda d: d.update(beside=".."), "not a folder next to the map"),
        (lambda d: d.pop("beside"), "but not where"),
        (lambda d: d["features"][0].update(id=-1), r"features\[0\].id"),
        (lambda d: d["features"].append(d["features"][0]), "note 1 already"),
        (lambda d: d["features"][0]["geometry"].update(type="LineString"), "geometry.type"),
        (lambda d: d["features"][0]["geometry"].update(coordinates=["x"]), "geometry"),
        (lambda d: d["features"][0]["geometry"].update(coordinates=[1e300, 0]), "farther"),
        (lambda d: d["features"][0]["properties"].update(time="2026-01-01T00:00"), "time zone"),
        (lambda d: d["features"][0]["properties"].update(time="soon"), "soon"),
        (lambda d: d["features"][0]["properties"].update(links=["javascript:1"]), "http"),
        (lambda d: _file(d).update(sha256="../../etc/passwd"), "sha256"),
        (lambda d: _file(d).update(sha256="0" * 64), "no such file"),
        (lambda d: _file(d).update(size=7), "the size of the file"),
    ],
)
def test_a_wrong_file_is_refused_with_its_place(saved: Path, tmp_path: Path, change, said: str):
    document = json.loads(zipfile.ZipFile(saved).read("notes.geojson"))
    change(document)
    wrong = archive(
        tmp_path / "wrong.hmap", {**files_of(saved), "notes.geojson": json.dumps(document)}
    )
    with pytest.raises(FormatError, match=said):
        open_map(wrong)


def _file(document: Any) -> Any:
    return document["features"][0]["properties"]["files"][0]


def test_a_link_in_place_of_a_file_is_refused(saved: Path):
    (beside,) = (saved.parent / "office.hmap.media").iterdir()
    beside.unlink()
    beside.symlink_to("/etc/passwd")
    with pytest.raises(FormatError, match="is a link"):
        open_map(saved)


def test_a_file_claims_no_media_type_that_its_content_is_not(saved: Path, tmp_path: Path):
    document = json.loads(zipfile.ZipFile(saved).read("notes.geojson"))
    _file(document)["media_type"] = "text/html"
    claimed = archive(
        tmp_path / "claimed.hmap", {**files_of(saved), "notes.geojson": json.dumps(document)}
    )
    assert notes_layer(open_map(claimed))[1].attachments[0].media_type == "application/octet-stream"
