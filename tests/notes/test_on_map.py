from __future__ import annotations

import math
from datetime import datetime, timedelta, timezone

import pytest
import shapely

from hypermap import FrameTree, Hypermap, HypermapError, Note, NotesLayer, Pose2D, Transform
from hypermap.core.errors import FrameError, ObjectNotFound
from hypermap.core.notes import MAX_TEXT_BYTES
from hypermap.notes import add_note, attachment_of_bytes, described, find_notes, notes_layer
from hypermap.testing import occupancy_from_text

NOON = datetime(2026, 3, 2, 12, tzinfo=timezone(timedelta(hours=1)))


def hypermap() -> Hypermap:
    """A map whose layer "room" lies turned by 90 degrees at (10, 0), without notes."""
    frames = FrameTree([Transform("map", "room", Pose2D(10.0, 0.0, math.pi / 2))])
    return Hypermap([occupancy_from_text("....\n....", resolution=1.0)], frames)


def at(x: float, y: float, text: str = "note", **more) -> Note:
    return Note(shapely.Point(x, y), text, **{"time": NOON, **more})


def test_the_first_note_makes_the_layer():
    office = hypermap()
    found = add_note(office, at(1, 1))
    assert (found.layer, found.note.id) == ("notes", 1)
    assert notes_layer(office).frame_id == "map"
    assert add_note(office, at(2, 2)).note.id == 2
    assert len(notes_layer(office)) == 2


def test_a_note_is_given_in_any_frame_and_found_in_the_base_frame():
    office = hypermap()
    office.add(NotesLayer("notes", "room"))
    added = add_note(office, at(1, 0), frame_id="room")
    assert shapely.equals_exact(added.note.place, shapely.Point(10, 1), 1e-9)
    assert shapely.equals_exact(notes_layer(office)[1].place, shapely.Point(1, 0), 1e-9)
    (found,) = find_notes(office, area=shapely.box(9.5, 0.5, 10.5, 1.5))
    assert shapely.equals_exact(found.note.place, shapely.Point(10, 1), 1e-9)
    (again,) = find_notes(office, near=(0, 0), within=1.1, frame_id="room")
    assert again.distance == pytest.approx(1)
    with pytest.raises(FrameError):
        add_note(office, at(1, 0), frame_id="moon")


@pytest.mark.parametrize(
    ("asked", "ids"),
    [
        ({}, [1, 2, 3]),
        ({"words": "TILE"}, [1]),
        ({"words": "loose ada"}, [1]),
        ({"words": "manual.txt"}, [2]),
        ({"words": "example.org"}, [2]),
        ({"words": "tile manual"}, []),
        ({"author": "ada"}, [1, 3]),
        ({"since": NOON + timedelta(hours=1)}, [2, 3]),
        ({"until": NOON + timedelta(hours=1)}, [1, 2]),
        ({"area": shapely.box(0, 0, 1.5, 1.5)}, [1]),
        ({"area": shapely.box(5.9, 5, 6, 6)}, [3]),
        ({"near": (5, 5)}, [3, 2, 1]),
        ({"near": (1, 1), "within": 0.5}, [1]),
    ],
)
def test_notes_are_found_by_words_time_author_and_place(asked, ids):
    office = hypermap()
    manual = attachment_of_bytes(b"turn left", "manual.txt")
    link = ("https://example.org/pump",)
    for note in (
        at(1, 1, "# Loose tile", author="Ada"),
        at(3, 1, "pump", time=NOON + timedelta(hours=1), attachments=(manual,), links=link),
        Note(shapely.box(5, 5, 6, 6), "wet", "Ada", NOON + timedelta(hours=2)),
    ):
        add_note(office, note)
    assert [found.note.id for found in find_notes(office, **asked)] == ids


def test_times_of_different_zones_are_compared_as_moments():
    office = hypermap()
    add_note(office, at(1, 1))
    same = NOON.astimezone(timezone.utc)
    assert len(find_notes(office, since=same, until=same)) == 1


def test_notes_change_and_ids_are_not_used_again():
    layer = NotesLayer("notes", "map", [at(1, 1), at(2, 2)])
    before = layer.copy()
    new = layer.update(2, lambda old: at(3, 3, old.text + "!", author="Bo"))
    assert (new.id, new.text, new.author) == (2, "note!", "Bo")
    assert new.changed is not None
    layer.remove(2)
    assert layer.add(at(0, 0)) == 3
    assert [note.id for note in before] == [1, 2]
    for what in (lambda: layer[2], lambda: layer.remove(2), lambda: layer.update(2, lambda n: n)):
        with pytest.raises(ObjectNotFound, match="no note 2"):
            what()


def test_near_a_point_stands_what_lies_there_before_what_lies_around():
    hall = Note(shapely.box(0, 0, 10, 10), "hall")
    layer = NotesLayer("notes", "map", [hall, at(2, 2, "far"), at(2.3, 2, "near")])
    assert layer.labels_at((2.4, 2)).tolist() == ["near", "far", "hall"]
    assert layer.labels_at((9, 9)).tolist() == ["hall"]
    assert layer.labels_at((-0.1, 5)).tolist() == ["Empty"]  # an area ends where it ends
    assert layer.value_at([[2.4, 2.0], [20.0, 0.0]]).tolist() == [3, -1]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"text": "x" * (MAX_TEXT_BYTES + 1)}, "attach it as a file"),
        ({"text": "é" * (MAX_TEXT_BYTES // 2 + 1)}, "1.0 MB"),
        ({"text": "\ud800"}, "half a character"),
        ({"text": " "}, "needs a text"),
        ({"author": "A\nB"}, "one line"),
        ({"time": datetime(2026, 1, 1)}, "no time zone"),
        ({"links": ("javascript:alert(1)",)}, "begins with http"),
        ({"links": ("https://",)}, "begins with http"),
        ({"links": ("https://a.org/ b",)}, "begins with http"),
        ({"links": ("https://a.org",) * 101}, "at most 100 links"),
        ({"place": shapely.LineString([(0, 0), (1, 1)])}, "at a point or in an area"),
        ({"place": shapely.Point()}, "empty"),
        ({"place": shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)])}, "crosses itself"),
        ({"place": shapely.Point(1e12, 0)}, "farther away"),
    ],
)
def test_what_cannot_be_a_note_is_refused(wrong, said):
    with pytest.raises(HypermapError, match=said):
        Note(**{"place": shapely.Point(0, 0), "text": "x", "time": NOON, **wrong})


@pytest.mark.parametrize(
    ("text", "title"),
    [
        ("# Loose tile\nmore", "Loose tile"),
        ("\n\n- first\n- second", "first"),
        ("**Wet** `floor`", "Wet floor"),
        ("x" * 100, "x" * 59 + "…"),
        ("", "a.txt"),
    ],
)
def test_a_title_is_the_first_line_without_marks(text, title):
    assert at(0, 0, text, attachments=(attachment_of_bytes(b"x", "a.txt"),)).title == title


def test_programs_get_all_of_a_note_but_its_files():
    office = hypermap()
    found = add_note(office, at(1, 2, "pump", attachments=(attachment_of_bytes(b"abc", "a.txt"),)))
    told = described(found)
    assert (told["id"], told["x"], told["y"], told["place"]) == (1, 1.0, 2.0, "POINT (1 2)")
    assert told["time"] == "2026-03-02T12:00:00+01:00"
    assert told["files"][0]["size"] == 3
    assert "content" not in told["files"][0]


def test_several_layers_of_notes_must_be_named():
    office = hypermap()
    office.add(NotesLayer("a", "map"))
    office.add(NotesLayer("b", "map"))
    with pytest.raises(HypermapError, match="name one of a, b"):
        add_note(office, at(1, 1))
    assert add_note(office, at(1, 1), layer="b").layer == "b"
    assert add_note(office, at(1, 1), layer="c").layer == "c"
