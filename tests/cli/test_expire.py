"""`hypermap expire`: say until when an object is in force."""

from __future__ import annotations

import shutil

import pytest

from hypermap.formats import open_map

from .conftest import assert_one_error


@pytest.fixture
def room(room_map, tmp_path):
    return shutil.copy(room_map, tmp_path / "room.hmap")


def chairs(hypermap, path) -> int:
    return hypermap("query", path, "--name", "chair").out.count("chair")


def test_what_has_expired_answers_no_query_until_its_limit_is_removed(hypermap, room):
    layer = open_map(room).semantic()
    number = next(one.id for one in layer.objects() if one.name == "chair")
    before = chairs(hypermap, room)
    assert "expires on" in hypermap("expire", room, number, "--until", "2h").out
    assert chairs(hypermap, room) == before
    past = hypermap("expire", room, number, "--until", "2020-01-01T10:00")
    assert past.code == 0
    assert "warning: that is in the past" in past.err
    assert chairs(hypermap, room) == before - 1
    assert "never expires" in hypermap("expire", room, number, "--until", "never").out
    assert chairs(hypermap, room) == before


def test_an_object_of_a_map_in_a_folder_expires(hypermap, room, tmp_path):
    (tmp_path / "folder").mkdir()
    open_map(room).save(tmp_path / "folder")
    assert hypermap("expire", tmp_path / "folder", 1, "--until", "2h").code == 0


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["99999", "--until", "2h"], "99999"),
        (["1", "--until", "someday"], "--until"),
        (["1", "--until", "2h", "--layer", "nowhere"], "nowhere"),
        (["1", "--until", "2h", "--layer", "a", "--layer", "b"], "give --layer once"),
    ],
)
def test_what_cannot_expire_is_one_error(hypermap, room, arguments, reason):
    before = room.read_bytes()
    assert_one_error(hypermap("expire", room, *arguments), reason)
    assert room.read_bytes() == before
