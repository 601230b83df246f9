"""Changes of a map: what they do, what is refused, and how two windows stand to each other."""

from __future__ import annotations

import threading
from dataclasses import replace

import pytest
import shapely

from hypermap.core.hypermap import Hypermap
from hypermap.formats import open_map
from hypermap.testing import square
from hypermap.viewer.live.document import MapDocument

from .live_tools import BED, Window, a_map, add, remove, rename, saved, serving


def test_an_object_is_drawn_in_the_base_frame_and_kept_in_the_layers(tmp_path):
    path = saved(tmp_path)
    with serving(path) as client:
        window = Window(client)
        before = window.version
        reply = window.edit(add(tags=["furniture"]))
        assert reply["ids"] == [3]
        assert reply["layers"] == ["things"]
        assert reply["version"] == before + 1
        assert reply["unsaved"]
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
            reply = window.go("/api/undo")
            assert window.names() == expected
        assert (reply["can_undo"], reply["can_redo"], reply["unsaved"]) == (False, True, False)
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
        reply = other.edit(rename(1, "desk"), add("lamp"))
        assert reply["version"] == one.version + 1
        stale = Window(client)
        stale.version = one.info["version"]
        for operation in (rename(0, "glass"), remove(0), {**rename(1, "x"), "tags": ["t"]}):
            reply = stale.edit(operation, expected=409)
            assert reply["reason"] == "behind"
            assert reply["version"] == other.version
            assert "has been changed in another window" in reply["error"]
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
    version = document.current.version

    def draw(start: int) -> None:
        for i in range(20):
            item = square(f"{start}-{i}", start, i, 0.5)
            document.edit(version, lambda draft, item=item: draft.add("things", item))

    threads = [threading.Thread(target=draw, args=(start,)) for start in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    layer = document.current.hypermap["things"]
    assert len(set(layer.names)) == len(layer) == 3 + 160
    assert document.current.version == version + 160
    assert len(a_map()["things"]) == 3


def test_who_hears_of_a_change_at_once_hears_all_of_it(tmp_path):
    class Listened(MapDocument):
        def __setattr__(self, name, value):
            super().__setattr__(name, value)
            if name == "event_count" and value:
                heard.append(self.status())

    heard = []
    document = Listened(saved(tmp_path))

    def now():
        return document.current.version

    for change in (
        lambda: document.edit(now(), lambda draft: draft.remove("things", 0)),
        lambda: document.undo(now()),
        lambda: document.redo(now()),
        document.save,
        document.reload,
    ):
        change()
        assert heard.pop() == document.status()
        assert heard == []


@pytest.mark.parametrize(
    ("operation", "status", "reason"),
    [
        (
            {"op": "paint", "layer": "things", "id": 0},
            400,
            "op: expected one of add, update, merge, split, remove, add_layer, find_rooms",
        ),
        ({"op": "add", "layer": "things", "name": "x"}, 400, "needs a name and a polygon"),
        ({"op": "add", "polygon": BED, "name": "x"}, 400, "layer: the operation must name one"),
        (
            add(polygon=[[0, 0], [2, 2], [2, 0], [0, 2]]),
            400,
            "polygon: the outline crosses itself, near (1.00, 1.00)",
        ),
        (
            add(polygon=[[1, 1], [1, 1], [1, 1], [1, 1]]),
            400,
            "polygon: fewer than three corners differ, near (1.00, 1.00)",
        ),
        (
            {**add(), "polygon": None, "polygons": [[BED, [[5, 5], [6, 5], [6, 6]]]]},
            400,
            "a hole is not inside the outline, or touches another, near (5.00, 5.00)",
        ),
        (
            add(polygon=[[0, 0], [1e8, 0], [0, 1]]),
            400,
            "the shape is 100000 km long, more than 100 km; corners are given in meters",
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
        ({**add(), "layer": "occupancy"}, 400, "has no objects; only those can be edited"),
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
        assert "read-only" in window.edit(add(), expected=403)["error"]
        for path_ in ("/api/undo", "/api/save"):
            assert window.post(path_, 403, version=window.version)["error"]


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


def add_layer(name: str) -> dict:
    return {"op": "add_layer", "layer": name}


def layers_of(window: Window) -> list[str]:
    return [layer["name"] for layer in window.get("/api/map")["layers"]]


def test_a_zone_is_drawn_on_a_new_layer_beneath_the_objects(tmp_path):
    path = saved(tmp_path)
    with serving(path) as client:
        window = Window(client)
        zone = {**add("kitchen", tags=["zone"]), "layer": "zones"}
        reply = window.edit(add_layer("zones"), zone)
        assert reply["ids"] == [0]
        assert reply["layers"] == ["zones"]
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
            "things": "layer 'things' already exists",
            "  ": "a text is expected",
            "a\nb": "cannot be shown",
            "x" * 201: "too long",
        }.items():
            reply = window.edit(add_layer(name), expected=400)
            assert said in reply["error"]
        # Neither the layer nor what was drawn with it stays if one of the two is refused.
        window.edit(add_layer("zones"), {**add(), "layer": "zones", "polygon": []}, expected=400)
        assert layers_of(window) == ["occupancy", "things"]
        assert not window.get("/api/map")["can_undo"]


def test_objects_are_merged_into_one_and_parted_again_by_undo(tmp_path):
    hypermap = a_map()
    first = square("mug", 1.2, 1, 0.2, tags=("blue",), existence=2.0, last_seen=7.0)
    things = hypermap.semantic()
    (mug,) = things.add([replace(first, attributes={"evidence": 3, "z_max": 1.2, "maker": "x"})])
    (far,) = things.add([replace(square("cup", 5, 1, 0.2), attributes={"evidence": 4})])
    path = saved(tmp_path, hypermap)
    with serving(path) as client:
        window = Window(client)
        before = window.names()
        reply = window.edit({"op": "merge", "layer": "things", "id": 0, "others": [mug, far]})
        assert reply["ids"] == [0]
        assert window.names() == {0: "cup", 1: "table", 2: "rug"}
        window.post("/api/save")
        merged = open_map(path).semantic().get(0)
        assert merged.footprint.area == pytest.approx(0.04 + 0.04 + 0.04)
        assert merged.tags == ("mug", "glass", "blue")
        assert merged.confidence == ()  # that of the new tag is not known
        assert (merged.existence, merged.first_seen, merged.last_seen) == (2.0, None, 7.0)
        assert merged.attributes == {"evidence": 7, "z_max": 1.2, "maker": "x"}
        window.go("/api/undo")
        assert window.names() == before
        window.post("/api/save")
    cup = open_map(path).semantic().get(0)
    assert cup.footprint.equals(things.get(0).footprint)
    assert (cup.tags, cup.confidence) == (("mug", "glass"), (0.7, 0.2))
    assert (cup.last_seen, cup.attributes) == (None, {})


def test_a_copy_of_an_object_has_been_seen_by_nobody(tmp_path):
    path = saved(tmp_path)
    copy = {**add("table"), "like": 1, "tags": ["wooden"]}
    with serving(path) as client:
        window = Window(client)
        (number,) = window.edit(copy)["ids"]
        (other,) = window.edit({**add("rug"), "like": 2})["ids"]
        window.post("/api/save")
    things = open_map(path).semantic()
    table = things.get(number)
    assert (table.name, table.tags) == ("table", ("wooden",))
    assert (table.existence, table.first_seen, table.last_seen) == (None, None, None)
    assert things.get(other).attributes == {"color": "red"}


@pytest.mark.parametrize("others", [None, [], [0, 1], ["x"], 3])
def test_a_merge_without_others_is_refused(tmp_path, others):
    with serving(saved(tmp_path)) as client:
        operation = {"op": "merge", "layer": "things", "id": 0, "others": others}
        assert "others: " in Window(client).edit(operation, expected=400)["error"]
