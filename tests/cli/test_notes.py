"""`hypermap notes`: notes are added, found, shown, changed and removed."""

from __future__ import annotations

import shutil
from datetime import datetime
from pathlib import Path

import pytest
import shapely
from PIL import Image

from hypermap import Note, OccupancyLayer, SemanticLayer, SemanticObject, open_map, save_map
from hypermap.formats.backup import why_precious
from hypermap.notes import add_note, attachment_of, notes_layer
from hypermap.rooms import rooms_of_map, with_rooms
from hypermap.viewer.picture import compose

from .conftest import assert_one_error

NOON = datetime(2026, 3, 2, 12).astimezone()


@pytest.fixture
def office(room_map, tmp_path) -> Path:
    return Path(shutil.copy(room_map, tmp_path / "office.hmap"))


@pytest.fixture(scope="module")
def noted_map(room_map, tmp_path_factory) -> Path:
    """A map with two notes."""
    folder = tmp_path_factory.mktemp("noted")
    Image.new("RGB", (40, 30), "orange").save(folder / "tile.jpg")
    picture = attachment_of(folder / "tile.jpg")
    loose, link = "# Loose tile\nDrive *slowly*.", "https://example.org/wet"
    office = open_map(room_map)
    add_note(office, Note(shapely.Point(2.1, 0.8), loose, "Ada", NOON, (picture,)))
    add_note(office, Note(shapely.box(4, 4, 6, 6), "wet floor", "Ada", NOON, links=(link,)))
    save_map(office, folder / "office.hmap")
    return folder / "office.hmap"


@pytest.fixture
def noted(noted_map, tmp_path) -> Path:
    return Path(shutil.copy(noted_map, tmp_path / "office.hmap"))


def test_a_note_is_added_and_saved(hypermap, office):
    result = hypermap("notes", office, "--write", "-", "--place", "-1,2", stdin="# Over\nthere")
    assert result.code == 0, result.err
    assert "Over" in result.out
    assert "saved" in result.err
    note = notes_layer(open_map(office))[1]
    assert (note.text, note.place.wkt) == ("# Over\nthere", "POINT (-1 2)")
    assert office.with_name("office.hmap.bak").exists()
    assert why_precious(office) == "it was edited by hand, with hypermap notes"


def test_notes_are_listed(hypermap, noted):
    out = hypermap("notes", noted).out
    assert "Loose tile" in out
    assert "1 picture" in out
    assert "2026-03-02 12:00" in out
    assert "1 link" in out


@pytest.mark.parametrize(
    ("options", "ids"),
    [
        ((), [1, 2]),
        (("--word", "tile"), [1]),
        (("--in", "5,5,9,9"), [2]),
        (("--around", "6,6"), [2, 1]),
        (("--around", "6,6", "--radius", "1"), [2]),
        (("--around", "0,0", "--frame", "room", "--radius", "6"), [2]),
        (("--author", "ada", "--after", "2026-03-01", "--before", "2026-03-03"), [1, 2]),
        (("--before", "2026-03-01"), []),
        (("--show", 2), [2]),
        (("--word", "nowhere said"), []),
    ],
)
def test_programs_read_the_notes_that_are_asked_for(hypermap, noted, options, ids):
    result = hypermap("notes", noted, *options, "--json")
    assert [note["id"] for note in result.json["notes"]] == ids


def test_a_room_is_an_area(hypermap, noted):
    cells = open_map(noted).layer("occupancy", OccupancyLayer)
    found = with_rooms(open_map(noted), rooms_of_map(open_map(noted)))
    assert cells.grid is not None
    save_map(found, noted)
    (room,) = found.semantic("rooms")
    result = hypermap("notes", noted, "--in", room.name, "--json")
    assert [note["id"] for note in result.json["notes"]] == [2]


def test_a_note_is_shown_whole(hypermap, noted):
    out = hypermap("notes", noted, "--show", 1).out
    for part in ("Drive *slowly*.", "Ada", "tile.jpg (picture", "2.10, 0.80"):
        assert part in out


def test_a_note_is_changed(hypermap, noted):
    hypermap("notes", noted, "--edit", 1, "--text", "fixed", "--place", "3,1", "--author", "Bo")
    note = notes_layer(open_map(noted))[1]
    assert (note.text, note.author, note.place.wkt) == ("fixed", "Bo", "POINT (3 1)")
    assert note.changed is not None
    assert [each.name for each in note.attachments] == ["tile.jpg"]


def test_notes_are_removed_and_unused_files_tidied_away(hypermap, noted):
    hypermap("notes", noted, "--inside-up-to", 0)
    beside = noted.with_name("office.hmap.media")
    assert len(list(beside.iterdir())) == 1
    hypermap("notes", noted, "--remove", 1)
    assert [note.id for note in notes_layer(open_map(noted))] == [2]
    assert "deleted 0 files" in hypermap("notes", noted, "--tidy").err, "the backup uses it"
    hypermap("notes", noted, "--edit", 2, "--text", "dry")
    assert "deleted 1 file " in hypermap("notes", noted, "--tidy").err
    assert list(beside.iterdir()) == []


def test_attached_files_are_exported(hypermap, noted, tmp_path):
    result = hypermap("notes", noted, "--save-files", tmp_path / "out", "--word", "tile")
    assert "wrote 1 file" in result.err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["1-tile.jpg"]


def test_a_changed_map_can_be_saved_elsewhere(hypermap, noted, tmp_path):
    before = noted.read_bytes()
    hypermap("notes", noted, "--remove", 1, "-o", tmp_path / "other.hmap")
    assert noted.read_bytes() == before
    assert len(notes_layer(open_map(tmp_path / "other.hmap"))) == 1
    assert_one_error(
        hypermap("notes", noted, "--remove", 1, "-o", tmp_path / "other.hmap"), "--force"
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--write", "x"), "where is the note"),
        (("--write", "x", "--place", "1,1", "--in", "0,0,1,1"), "place of a note is --place"),
        (("--write", "x", "--place", "1"), "an area is a rectangle"),
        (("--write", "x", "--place", "1,nan"), "a point is X,Y"),
        (("--write", " ", "--place", "1,1"), "needs a text"),
        (("--write", "x" * 1_000_001, "--place", "1,1"), "attach it as a file"),
        (("--write", "x", "--place", "1,1", "--link", "ftp://x"), "begins with http"),
        (
            ("--write", "x", "--place", "1,1", "--attach", "none.jpg"),
            "none.jpg: there is no such file",
        ),
        (("--write", "x", "--place", "1,1", "--time", "soon"), "expected a time"),
        (("--write", "x", "--place", "1,1", "--frame", "moon"), "moon"),
        (("--write", "x", "--place", "1,1", "--layer", "semantic"), "is of the kind SemanticLayer"),
        (("--write", "x", "--remove", 1), "only one of"),
        (("--place", "1,1"), "--around finds notes there"),
        (("--radius", 1), "--radius needs --around"),
        (("--show", 9), "no note 9"),
        (("--remove", 9), "no note 9"),
        (("--edit", 9, "--text", "x"), "no note 9"),
        (("--in", "nowhere"), "rooms"),
    ],
)
def test_wrong_input_is_one_clear_error_and_changes_nothing(hypermap, noted, options, said):
    before = noted.read_bytes()
    assert_one_error(hypermap("notes", noted, *options), said)
    assert noted.read_bytes() == before


def test_a_map_without_notes_says_so(hypermap, office):
    assert hypermap("notes", office).out == "no notes found\n"
    assert_one_error(hypermap("notes", office, "--remove", 1), "0 layers of notes")


def test_other_commands_know_of_notes(hypermap, noted, tmp_path):
    (layer,) = (
        each for each in hypermap("info", noted, "--json").json["layers"] if each["name"] == "notes"
    )
    assert (layer["notes"], layer["files"], layer["missing_files"]) == (2, 1, [])
    assert "2 notes with 1 file" in hypermap("info", noted).out
    at = hypermap("query", noted, "--at", "2,1", "--json").json["answers"]
    (found,) = (row["note"] for row in at if row["layer"] == "notes")
    assert found["title"] == "Loose tile"
    inside = hypermap("query", noted, "--in", "0,0,9,9", "--layer", "notes")
    assert "Loose tile" in inside.out
    assert "wet floor" in inside.out
    nearest = hypermap(
        "query", noted, "--name", "wet floor", "--nearest", "--from", "0,4", "--json"
    )
    (row,) = nearest.json["answers"]
    assert (row["value"], row["distance"]) == (2, 4.0)


def test_pictures_number_the_notes(hypermap, noted, tmp_path):
    drawing = compose(open_map(noted))
    marks = [(mark.number, mark.title, mark.x, mark.y) for mark in drawing.marks]
    assert marks == [(1, "Loose tile", 2.1, 0.8), (2, "wet floor", 5.0, 5.0)]
    assert drawing.marks[1].area is not None
    assert hypermap("render", noted, "-o", tmp_path / "map.svg").code == 0
    text = (tmp_path / "map.svg").read_text()
    assert "Loose tile" in text
    assert compose(open_map(noted), layers=["semantic"]).marks == ()


def test_objects_and_notes_of_one_name_are_both_found(hypermap, office):
    layer = SemanticLayer("more", "map", [SemanticObject("pump", shapely.box(0, 0, 1, 1))])
    both = open_map(office)
    both.add(layer)
    save_map(both, office)
    hypermap("notes", office, "--write", "pump", "--place", "3,3")
    rows = hypermap("query", office, "--name", "pump", "--json").json["answers"]
    assert [row["layer"] for row in rows] == ["more", "notes"]
