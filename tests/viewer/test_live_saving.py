"""Saving what was changed: to the map's file, under another name, and where that goes wrong."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from datetime import date, datetime, time

import numpy as np
import pytest
from PIL import Image

from hypermap.core.history import MAP_ID, MAP_VERSION, Mapped
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.history import begun
from hypermap.testing import square
from hypermap.viewer.live import document

from .live_tools import Window, a_map, files_in, rename, saved, serving


def test_the_file_as_it_was_stays_beside_it(tmp_path):
    path = saved(tmp_path)
    before = path.read_bytes()
    with serving(path) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))
        assert window.post("/api/save")["saved"]
    assert (tmp_path / "room.hmap.bak").read_bytes() == before
    assert open_map(path)["things"].get(0).name == "mug"
    assert files_in(tmp_path) == ["room.hmap", "room.hmap.bak"]


def test_the_file_as_it_was_stays_however_often_is_saved(tmp_path):
    path = saved(tmp_path)
    before = path.read_bytes()
    with serving(path) as client:
        window = Window(client)
        for name in ("mug", "pot"):
            window.edit(rename(0, name))
            window.post("/api/save")
        assert (tmp_path / "room.hmap.bak").read_bytes() == before
        save_map(open_map(path), path)  # as another program does
        theirs = path.read_bytes()
        window.edit(rename(0, "jug"))
        window.post("/api/save", overwrite=True)
        assert (tmp_path / "room.hmap.bak").read_bytes() == theirs


@pytest.mark.parametrize(("hours", "is_spared"), [(0, True), (24, False)])
def test_what_was_there_before_today_stays_although_a_node_has_mapped_since(
    tmp_path, hours, is_spared
):
    """A live node keeps the map that it found; what it has saved since is not worth that."""
    today = datetime.combine(date.today(), time(0, 0, 1)).timestamp()
    yesterday = a_map()
    yesterday.metadata.update({MAP_ID: "00ff", MAP_VERSION: 3})
    yesterday.history = begun(yesterday)
    path, backup = tmp_path / "room.hmap", tmp_path / "room.hmap.bak"
    save_map(yesterday, path)
    backup.write_bytes(path.read_bytes())
    kept = path.read_bytes()
    live = open_map(path)
    live["things"].add(square("crate", 3, 3))
    live.history = replace(live.history, mapped=Mapped("live", today - 3600 * hours))
    save_map(live, path)
    mapped = path.read_bytes()
    with serving(path) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))
        window.post("/api/save")
    assert backup.read_bytes() == (kept if is_spared else mapped)


def test_the_copy_of_a_live_node_is_read_once_and_not_at_each_save(tmp_path, monkeypatch):
    """Reading that of a large map takes a third of the time of a save."""
    path, asked = saved(tmp_path), []

    def is_todays(backup, _):
        asked.append(backup.name)
        return True

    monkeypatch.setattr(document, "is_from_before_today", is_todays)
    (tmp_path / "room.hmap.bak").write_bytes(kept := path.read_bytes())
    with serving(path) as client:
        window = Window(client)
        for name in ("mug", "pot"):
            window.edit(rename(0, name))
            window.post("/api/save")
    assert asked == ["room.hmap.bak"]
    assert (tmp_path / "room.hmap.bak").read_bytes() == kept


def test_a_map_that_was_edited_says_so_and_one_whose_edits_were_taken_back_does_not(tmp_path):
    path = saved(tmp_path)
    before = path.read_bytes()
    with serving(path) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))
        window.post("/api/save")
        assert open_map(path).metadata["edited_with"] == "hypermap view"
        window.go("/api/undo")
        window.post("/api/save")
        assert path.read_bytes() == before


def test_a_map_that_changed_on_disk_is_replaced_only_on_a_second_word(tmp_path):
    path = saved(tmp_path)
    with serving(path) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))
        theirs = Hypermap([SemanticLayer("things", "lab", [square("theirs", 0, 0)])])
        save_map(theirs, path)
        reply = window.post("/api/save", 409)
        assert reply["reason"] == "disk"
        assert "room.hmap has changed on disk since it was opened" in reply["error"]
        their_bytes = path.read_bytes()
        assert open_map(path)["things"].get(0).name == "theirs"
        window.post("/api/save", overwrite=True)
        assert (tmp_path / "room.hmap.bak").read_bytes() == their_bytes
        assert window.post("/api/save")["saved"], "now it is the same file again"
    assert open_map(path)["things"].get(0).name == "mug"


def test_what_changed_on_disk_can_be_loaded_instead(tmp_path):
    path = saved(tmp_path)
    with serving(path) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))
        save_map(Hypermap([SemanticLayer("things", "lab", [square("theirs", 0, 0)])]), path)
        reply = window.post("/api/reload")
        assert reply["layers"] == ["things"]
        assert not reply["unsaved"]
        assert not reply["can_undo"]
        assert window.names() == {0: "theirs"}
        assert window.edit(rename(0, "x"), expected=409)["reason"] == "behind"
        path.write_bytes(b"no map")
        assert "room.hmap" in window.post("/api/reload", 400)["error"]
        assert window.names() == {0: "theirs"}


def test_a_map_that_vanished_is_written_anew(tmp_path):
    path = saved(tmp_path)
    with serving(path) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))
        path.unlink()
        window.post("/api/save")
    assert open_map(path)["things"].get(0).name == "mug"
    assert files_in(tmp_path) == ["room.hmap"]


def test_a_folder_that_vanished_is_said_so_and_nothing_is_lost(tmp_path):
    folder = tmp_path / "maps"
    folder.mkdir()
    with serving(saved(folder)) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))
        shutil.rmtree(folder)
        assert "there is no such folder" in window.post("/api/save", 400)["error"]
        assert window.get("/api/map")["unsaved"]
        assert window.names()[0] == "mug"


def test_saving_under_another_name_asks_if_that_exists(tmp_path):
    path = saved(tmp_path)
    before = path.read_bytes()
    saved(tmp_path, Hypermap([SemanticLayer("a", "map")]), "other.hmap")
    with serving(path) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))
        reply = window.post("/api/save", 409, path="other.hmap")
        assert reply["reason"] == "exists"
        reply = window.post("/api/save", path="new.hmap")
        assert (reply["name"], reply["unsaved"]) == ("new.hmap", False)
        assert window.get("/api/map")["path"] == str(tmp_path / "new.hmap")
        window.edit(rename(0, "pot"))
        window.post("/api/save")
        window.post("/api/save", path="other.hmap", overwrite=True)
    assert path.read_bytes() == before
    assert open_map(tmp_path / "new.hmap")["things"].get(0).name == "pot"
    assert "a" in open_map(tmp_path / "other.hmap.bak")


@pytest.mark.parametrize(
    ("name", "status", "reason"),
    [
        ("../out.hmap", 403, "../out.hmap"),
        ("/tmp/out.hmap", 403, "/tmp/out.hmap"),
        ("link/out.hmap", 403, "leads out of the map's folder"),
        ("a\0b.hmap", 403, ""),
        ("x" * 300 + ".hmap", 400, "is not a valid file name: File name too long"),
        ("notes.txt", 400, "give a name that ends in .hmap"),
        ("no/such.hmap", 400, "there is no such folder"),
        (7, 400, "path: a text is expected, got 7"),
    ],
)
def test_nothing_is_saved_outside_of_the_maps_folder(tmp_path, name, status, reason):
    folder, outside = tmp_path / "maps", tmp_path / "outside"
    folder.mkdir(), outside.mkdir()
    (folder / "link").symlink_to(outside)
    with serving(saved(folder)) as client:
        reply = Window(client).post("/api/save", status, path=name)
        assert reason in reply["error"]
    assert files_in(folder) == ["link", "room.hmap"]
    assert files_in(outside) == []


def test_a_write_protected_map_is_replaced_only_when_that_is_said(tmp_path):
    path = saved(tmp_path)
    path.chmod(0o444)
    with serving(path) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))
        reply = window.post("/api/save", 409)
        assert reply["error"] == "room.hmap is write-protected; saving would replace it"
        assert open_map(path)["things"].get(0).name == "cup"
        window.post("/api/save", overwrite=True)
    assert open_map(path)["things"].get(0).name == "mug"
    assert path.stat().st_mode & 0o777 == 0o444


def test_half_of_a_character_is_in_no_name(tmp_path):
    with serving(saved(tmp_path)) as client:
        content = b'{"path": "caf\\ud83d.hmap"}'
        answer = client.post("/api/save", content=content, headers=Window(client).headers)
    assert answer.status_code == 400
    assert answer.json()["error"] == r"'caf\ud83d.hmap' is not a valid file name"
    assert files_in(tmp_path) == ["room.hmap"]


def test_a_map_in_a_folder_is_saved_there_and_kept_as_an_archive(tmp_path):
    folder = tmp_path / "maps"
    folder.mkdir()
    save_map(a_map(), folder)
    with serving(folder) as client:
        window = Window(client)
        assert window.info["name"] == "hmap_config.yaml"
        window.edit(rename(0, "mug"))
        (folder / "things").write_text("[]")
        assert window.post("/api/save", 409)["reason"] == "disk", "its layers' files count too"
        window.post("/api/save", overwrite=True)
    assert open_map(folder)["things"].get(0).name == "mug"
    assert len(open_map(folder / "hmap_config.yaml.bak.hmap")["things"]) == 0


def test_a_map_server_map_is_not_turned_into_something_else(tmp_path):
    Image.fromarray(np.array([[0, 254], [254, 205]], np.uint8)).save(tmp_path / "map.pgm")
    described = {"image": "map.pgm", "resolution": 0.05, "origin": [0, 0, 0], "negate": 0}
    described |= {"occupied_thresh": 0.65, "free_thresh": 0.196}
    (tmp_path / "map.yaml").write_text(json.dumps(described))
    before = (tmp_path / "map.yaml").read_bytes()
    with serving(tmp_path / "map.yaml") as client:
        window = Window(client)
        assert "save as NAME.hmap" in window.post("/api/save", 400, path="map.yaml")["error"]
        assert window.post("/api/save")["name"] == "map.hmap"
        window.post("/api/save")
        assert window.get("/api/map")["path"] == str(tmp_path / "map.hmap")
    with serving(tmp_path / "map.yaml") as client:
        assert Window(client).post("/api/save", 409)["reason"] == "exists"
    assert (tmp_path / "map.yaml").read_bytes() == before
    assert (tmp_path / "map.hmap").exists()


def test_a_full_disk_leaves_everything_as_it_was(tmp_path, monkeypatch):
    path = saved(tmp_path)
    before = path.read_bytes()
    with serving(path) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))

        def full(*_: object) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("os.fsync", full)
        said = window.post("/api/save", 400)["error"]
        assert "No space left on device; free space there, or save elsewhere" in said
        monkeypatch.undo()
        assert window.get("/api/map")["unsaved"]
    assert path.read_bytes() == before
    assert files_in(tmp_path) == ["room.hmap"]


def test_real_maps_are_edited_saved_and_opened_again(shared_data, tmp_path):
    for name in ("lab", "floor", "office", "example"):
        path = tmp_path / f"{name}.hmap"
        path.write_bytes((shared_data / "maps" / f"{name}.hmap").read_bytes())
        before = open_map(path)
        with serving(path) as client:
            window = Window(client)
            layer = next(part for part in window.info["layers"] if part["editable"])["name"]
            number = min(window.names(layer))
            zone = [[0, 0], [1, 0], [1, 1]]
            window.edit(
                {"op": "add", "layer": layer, "name": "zone", "polygon": zone},
                {"op": "update", "layer": layer, "id": number, "name": "renamed"},
            )
            window.post("/api/save")
        after = open_map(path)
        assert after[layer].get(number).name == "renamed"
        assert len(after[layer]) == len(before[layer]) + 1
        assert after[layer].rejected == before[layer].rejected
        untouched = [i for i in before[layer].ids.tolist() if i != number]
        for i in untouched:
            assert after[layer].get(i).footprint.equals(before[layer].get(i).footprint)
