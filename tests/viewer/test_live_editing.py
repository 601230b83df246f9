from __future__ import annotations

import json
import shutil
import threading

import numpy as np
import pytest
import shapely
from PIL import Image

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.testing import square
from hypermap.viewer.live.document import MapDocument

from .live_tools import Window, a_map, files_in, saved, serving

BED = [[8.0, 5.0], [9.0, 5.0], [9.0, 7.0], [8.0, 7.0]]


def add(name: str = "bed", polygon: object = BED, **others: object) -> dict:
    return {"op": "add", "layer": "things", "name": name, "polygon": polygon, **others}


def rename(number: int, name: str) -> dict:
    return {"op": "update", "layer": "things", "id": number, "name": name}


def remove(number: int) -> dict:
    return {"op": "remove", "layer": "things", "id": number}


def test_an_object_is_drawn_in_the_base_frame_and_kept_in_the_layers(tmp_path):
    path = saved(tmp_path)
    with serving(path) as client:
        window = Window(client)
        before = window.version
        told = window.edit(add(tags=["furniture"]))
        assert told["ids"] == [3]
        assert told["layers"] == ["things"]
        assert told["version"] == before + 1
        assert told["unsaved"]
        assert window.get("/api/at", x=8.5, y=6)["layers"][1]["label"] == "bed"
        assert window.get("/api/objects/things/3")["tags"] == ["furniture"]
        assert "bed" not in open_map(path)["things"].names, "nothing is written before it is saved"
        assert not window.post("/api/save")["unsaved"]
    hypermap = open_map(path)
    assert hypermap.label_at("things", [8.5, 6.0])[0] == "bed"
    assert (
        hypermap["things"]
        .get(3)
        .footprint.equals_exact(
            hypermap.frames.lookup("lab", "map").apply_geometry(shapely.Polygon(BED)), 1e-9
        )
    )


def test_reshaping_renaming_and_tagging_leave_the_rest_of_an_object(tmp_path):
    with serving(saved(tmp_path)) as client:
        window = Window(client)
        rings = [[[5, 5], [9, 5], [9, 9], [5, 9]], [[6, 6], [8, 6], [8, 8], [6, 8]]]
        parts = [rings, [[[0, 8], [1, 8], [1, 9], [0, 9]]]]
        window.edit({"op": "update", "layer": "things", "id": 1, "polygons": parts})
        window.edit(rename(1, "desk"), {"op": "update", "layer": "things", "id": 1, "tags": ["a"]})
        desk = window.get("/api/objects/things/1")
        assert (desk["name"], desk["tags"], desk["existence"]) == ("desk", ["a"], 4.5)
        assert desk["area"] == pytest.approx(13.0)
        assert len(desk["polygons"]) == 2
        window.edit({"op": "update", "layer": "things", "id": 0, "tags": ["glass"]})
        assert window.get("/api/objects/things/0")["confidence"] == [0.2]
        window.edit({"op": "update", "layer": "things", "id": 0, "tags": ["glass", "new"]})
        assert window.get("/api/objects/things/0")["confidence"] == []


def test_every_step_is_undone_and_made_again(tmp_path):
    with serving(saved(tmp_path)) as client:
        window = Window(client)
        states = [window.names()]
        for operations in [
            [add()],
            [rename(0, "mug"), rename(0, "pot"), remove(1)],
            [remove(3), add("sofa"), rename(4, "couch")],
        ]:
            window.edit(*operations)
            states.append(window.names())
        assert states[-1] == {0: "pot", 2: "rug", 4: "couch"}
        for expected in reversed(states[:-1]):
            told = window.go("/api/undo")
            assert window.names() == expected
        assert (told["can_undo"], told["can_redo"], told["unsaved"]) == (False, True, False)
        table = window.get("/api/objects/things/1")
        assert (table["existence"], table["last_seen"]) == (4.5, 9.0)
        assert "nothing to undo" in window.go("/api/undo", 400)["error"]
        for expected in states[1:]:
            window.go("/api/redo")
            assert window.names() == expected
        assert "nothing to redo" in window.go("/api/redo", 400)["error"]
        window.go("/api/undo")
        window.edit(rename(2, "mat"))
        assert "nothing to redo" in window.go("/api/redo", 400)["error"]


def test_a_request_is_carried_out_as_a_whole_or_not_at_all(tmp_path):
    with serving(saved(tmp_path)) as client:
        window = Window(client)
        before = window.names()
        answer = window.edit(add(), rename(0, "mug"), remove(77), expected=404)
        assert answer["error"] == "layer 'things' has no object with id 77"
        assert window.names() == before
        assert not window.get("/api/map")["unsaved"]


def test_two_windows_never_lose_a_change(tmp_path):
    with serving(saved(tmp_path)) as client:
        one, other = Window(client), Window(client)
        one.edit(rename(0, "mug"))
        # The other has not seen that: it may change what is its own, but not the same object.
        told = other.edit(rename(1, "desk"), add("lamp"))
        assert told["version"] == one.version + 1
        stale = Window(client)
        stale.version = one.info["version"]
        for operation in (rename(0, "glass"), remove(0), {**rename(1, "x"), "tags": ["t"]}):
            told = stale.edit(operation, expected=409)
            assert told["reason"] == "behind"
            assert told["version"] == other.version
            assert "has changed meanwhile, in another window" in told["error"]
        assert one.names() == {0: "mug", 1: "desk", 2: "rug", 3: "lamp"}
        assert one.go("/api/undo", 409)["reason"] == "behind", "it has not seen the last step"
        one.version = other.version
        one.go("/api/undo")
        assert one.names() == {0: "mug", 1: "table", 2: "rug"}
        other.version = one.version
        one.edit(remove(2))
        assert other.edit(rename(2, "mat"), expected=409)["reason"] == "behind"


def test_changes_from_many_threads_are_all_kept(tmp_path):
    path = saved(tmp_path)
    document = MapDocument(path)
    version = document.snapshot.version

    def draw(start: int) -> None:
        for i in range(20):
            item = square(f"{start}-{i}", start, i, 0.5)
            document.edit(version, lambda draft, item=item: draft.add("things", item))

    threads = [threading.Thread(target=draw, args=(start,)) for start in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    layer = document.snapshot.hypermap["things"]
    assert len(set(layer.names)) == len(layer) == 3 + 160
    assert document.snapshot.version == version + 160
    assert len(a_map()["things"]) == 3


@pytest.mark.parametrize(
    ("operation", "status", "reason"),
    [
        (
            {"op": "paint", "layer": "things", "id": 0},
            400,
            "op: expected add, update, remove or add_layer",
        ),
        ({"op": "add", "layer": "things", "name": "x"}, 400, "needs a name and a polygon"),
        ({"op": "add", "polygon": BED, "name": "x"}, 400, "layer: the operation must name one"),
        (add(polygon=[[0, 0], [2, 2], [2, 0], [0, 2]]), 400, "the outline crosses itself"),
        (
            add(polygon=[[0, 0], [1e8, 0], [0, 1]]),
            400,
            "the shape is 100000 km long, more than 100 km; corners are given in metres",
        ),
        (
            {**add(), "polygon": None, "polygons": [[BED], [[[2e5, 0], [2e5, 1], [2e5 + 1, 0]]]]},
            400,
            "polygons: the shape is 200 km long",
        ),
        (add(polygon=[[0, i] for i in range(10_001)]), 400, "has 10001 corners, more than 10000"),
        (add(name="  "), 400, "name: a text is expected"),
        (add(name="a\nb"), 400, "has letters that cannot be shown"),
        (add(name="x" * 300), 400, "a text of 300 letters is too long; at most 200"),
        (add(tags="mug"), 400, "tags: a list of at most 100 texts"),
        ({**add(), "layer": "occupancy"}, 400, "holds no objects; only those can be edited"),
        ({**add(), "layer": "thing"}, 404, "there is no layer 'thing'; did you mean 'things'?"),
        (rename(9, "x"), 404, "layer 'things' has no object with id 9"),
        ({**rename(0, "x"), "id": "zero"}, 400, "id: a whole number is expected, got 'zero'"),
        ({**add(), "polygon": None, "polygons": []}, 400, "a list of polygons is expected"),
        ({**add(), "polygon": None, "polygons": [[BED], [BED]]}, 400, "parts of the shape overlap"),
    ],
)
def test_a_change_that_is_not_possible_is_refused(tmp_path, operation, status, reason):
    with serving(saved(tmp_path)) as client:
        window = Window(client)
        assert reason in window.edit(operation, expected=status)["error"]
        assert window.get("/api/map")["version"] == window.version


def test_script_in_a_name_stays_text(tmp_path):
    name = "<script>alert(1)</script>"
    with serving(saved(tmp_path)) as client:
        window = Window(client)
        window.edit(add(name))
        answer = client.get("/api/objects/things/3")
        assert answer.json()["name"] == name
        assert answer.headers["content-type"] == "application/json"
        assert answer.headers["x-content-type-options"] == "nosniff"


def test_who_may_only_read_changes_nothing(tmp_path):
    path = saved(tmp_path)
    with serving(path, is_editable=False) as client:
        window = Window(client)
        assert not window.info["editable"]
        assert not any(layer["editable"] for layer in window.info["layers"])
        assert "for reading only" in window.edit(add(), expected=403)["error"]
        for path_ in ("/api/undo", "/api/save"):
            assert window.post(path_, 403, version=window.version)["error"]


# Saving


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


def test_a_map_that_changed_on_disk_is_replaced_only_on_a_second_word(tmp_path):
    path = saved(tmp_path)
    with serving(path) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))
        theirs = Hypermap([SemanticLayer("things", "lab", [square("theirs", 0, 0)])])
        save_map(theirs, path)
        told = window.post("/api/save", 409)
        assert told["reason"] == "disk"
        assert "room.hmap has changed on disk since it was opened" in told["error"]
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
        told = window.post("/api/reload")
        assert told["layers"] == ["things"]
        assert not told["unsaved"]
        assert not told["can_undo"]
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
        told = window.post("/api/save", 409, path="other.hmap")
        assert told["reason"] == "exists"
        told = window.post("/api/save", path="new.hmap")
        assert (told["name"], told["unsaved"]) == ("new.hmap", False)
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
        told = Window(client).post("/api/save", status, path=name)
        assert reason in told["error"]
    assert files_in(folder) == ["link", "room.hmap"]
    assert files_in(outside) == []


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


def test_rooms_can_be_drawn_on_a_map_that_has_only_a_grid(tmp_path):
    path = saved(tmp_path, Hypermap([a_map()["occupancy"]]))
    with serving(path, is_editable=False) as client:
        assert [layer["name"] for layer in Window(client).info["layers"]] == ["occupancy"]
    with serving(path) as client:
        window = Window(client)
        layer = window.info["layers"][1]
        assert (layer["name"], layer["count"], layer["editable"]) == ("semantic", 0, True)
        assert not window.info["unsaved"]
        window.edit({**add("kitchen"), "layer": "semantic"})
        window.post("/api/save")
    assert open_map(path).label_at("semantic", [8.5, 6.0])[0] == "kitchen"


def test_a_full_disk_leaves_everything_as_it_was(tmp_path, monkeypatch):
    path = saved(tmp_path)
    before = path.read_bytes()
    with serving(path) as client:
        window = Window(client)
        window.edit(rename(0, "mug"))

        def full(*_: object) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("os.fsync", full)
        assert "No space left on device" in window.post("/api/save", 400)["error"]
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


def add_layer(name: str) -> dict:
    return {"op": "add_layer", "layer": name}


def layers_of(window: Window) -> list[str]:
    return [layer["name"] for layer in window.get("/api/map")["layers"]]


def test_a_zone_is_drawn_on_a_new_layer_beneath_the_objects(tmp_path):
    path = saved(tmp_path)
    with serving(path) as client:
        window = Window(client)
        zone = {**add("kitchen", tags=["zone"]), "layer": "zones"}
        told = window.edit(add_layer("zones"), zone)
        assert told["ids"] == [0]
        assert told["layers"] == ["zones"]
        assert layers_of(window) == ["occupancy", "zones", "things"]
        window.post("/api/save")
    hypermap = open_map(path)
    assert hypermap["zones"].frame_id == "map"
    assert hypermap.label_at("zones", [8.5, 6.0])[0] == "kitchen"
    assert hypermap["zones"].get(0).tags == ("zone",)
    assert len(hypermap["things"]) == 3


def test_a_new_layer_is_undone_and_made_again_with_what_was_drawn_on_it(tmp_path):
    with serving(saved(tmp_path)) as client:
        window = Window(client)
        zone = {**add("kitchen"), "layer": "zones"}
        window.edit(add_layer("zones"), zone)
        window.edit({**rename(0, "pantry"), "layer": "zones"})
        window.go("/api/undo")
        assert window.names("zones") == {0: "kitchen"}
        assert window.go("/api/undo")["unsaved"] is False
        assert layers_of(window) == ["occupancy", "things"]
        assert window.go("/api/redo")["ids"] == [0]
        window.go("/api/redo")
        assert window.names("zones") == {0: "pantry"}
        assert layers_of(window) == ["occupancy", "zones", "things"]


def test_a_new_layer_needs_a_name_that_no_other_has(tmp_path):
    with serving(saved(tmp_path)) as client:
        window = Window(client)
        for name, said in {
            "things": "there is a layer 'things' already",
            "  ": "a text is expected",
            "a\nb": "cannot be shown",
            "x" * 201: "too long",
        }.items():
            told = window.edit(add_layer(name), expected=400)
            assert said in told["error"]
        # Neither the layer nor what was drawn with it stays if one of the two is refused.
        window.edit(add_layer("zones"), {**add(), "layer": "zones", "polygon": []}, expected=400)
        assert layers_of(window) == ["occupancy", "things"]
        assert not window.get("/api/map")["can_undo"]
