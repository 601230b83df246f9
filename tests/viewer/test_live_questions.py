from __future__ import annotations

import contextlib
import csv
import io
import json
import shlex

import numpy as np
import pytest
import shapely

from hypermap.cli.main import main
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.opaque import OpaqueLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map
from hypermap.formats.semantic.geojson import from_geojson
from hypermap.testing import square

from .live_tools import Window, a_map, saved, serving

SQUARE = [[5.0, -1.0], [11.0, -1.0], [11.0, 3.0], [5.0, 3.0]]
SCRIBBLE = (np.random.default_rng(0).random((2000, 2)) * 10).tolist()


def answers_of(command: str) -> list[dict]:
    """Run a command that the page shows, as a shell would, and return its rows."""
    program, *arguments = shlex.split(command)
    assert program == "hypermap"
    said = io.StringIO()
    with contextlib.redirect_stdout(said), pytest.raises(SystemExit) as end:
        main([*arguments, "--json"])
    assert not end.value.code
    return json.loads(said.getvalue())["answers"]


def lines_of(python: str) -> list[str]:
    """Run the Python that the page shows, and return what it prints."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(python, "<page>", "exec"), {"__name__": "__main__"})
    return said.getvalue().splitlines()


def all_said(layer) -> list[tuple[str, object]]:
    """Return each object's name and id that the page shows, or else the layer's own answer."""
    objects = [(found["name"], found["id"]) for found in layer["objects"]]
    assert objects[:1] in ([], [(layer["label"], layer["value"])])
    return objects or [(layer["label"], layer["value"])]


@pytest.mark.parametrize("frame", [None, "map", "lab"])
@pytest.mark.parametrize("point", [(9.0, 1.0), (1.0, 1.0), (-3.25, 4.0), (4.5, 0.5)])
def test_at_a_point_every_layer_answers_as_the_shown_calls_do(tmp_path, point, frame):
    with serving(saved(tmp_path)) as client:
        values = {"x": point[0], "y": point[1], **({"frame": frame} if frame else {})}
        reply = client.get("/api/at", params=values).json()
    hypermap = a_map()
    rows = answers_of(reply["command"])
    assert [(row["layer"], row["label"], row["value"]) for row in rows] == [
        (layer["name"], *said) for layer in reply["layers"] for said in all_said(layer)
    ]
    assert [rows[0]["x"], rows[0]["y"]] == pytest.approx(reply["point"])
    assert lines_of(reply["python"]) == [
        " ".join([layer["name"], *(label for label, _ in all_said(layer))])
        for layer in reply["layers"]
    ]
    for layer in reply["layers"]:
        assert layer["label"] == hypermap.label_at(layer["name"], point, frame)[0]


def test_objects_at_a_point_are_reported_the_smallest_first(tmp_path):
    with serving(saved(tmp_path)) as client:
        reply = client.get("/api/at", params={"x": 1, "y": 1, "frame": "lab"}).json()
    things = reply["layers"][1]
    assert [found["name"] for found in things["objects"]] == ["cup", "table"]
    assert things["objects"][1]["existence"] == 4.5
    assert things["objects"][0]["tags"] == ["mug", "glass"]


@pytest.mark.parametrize("frame", [None, "lab"])
def test_in_an_area_the_shown_calls_find_the_same(tmp_path, frame):
    corners = SQUARE if frame is None else [[-1, -1], [3, -1], [3, 3], [-1.5, 3.25]]
    with serving(saved(tmp_path)) as client:
        reply = Window(client).post("/api/area", polygon=corners, frame=frame)
    rows = answers_of(reply["command"])
    objects = [row for row in rows if "object" in row]
    assert [(row["layer"], row["id"], row["name"]) for row in reply["rows"]] == [
        (row["layer"], row["value"], row["label"]) for row in objects
    ]
    assert reply["rows"]
    for ours, theirs in zip(reply["rows"], objects, strict=True):
        assert [ours["x"], ours["y"]] == pytest.approx([theirs["x"], theirs["y"]])
        assert ours["existence"] == theirs["object"]["existence"]
        exact = shapely.from_wkt(theirs["object"]["footprint"])
        assert ours["area"] == pytest.approx(exact.area, rel=1e-4)
    labels = [row["label"] for row in rows if "object" not in row]
    assert {cell["label"]: cell["count"] for cell in reply["cells"]} == {
        label: labels.count(label) for label in set(labels)
    }
    lines = lines_of(reply["python"])
    assert lines[:-1] == [f"{r['layer']} {r['id']} {r['name']}" for r in reply["rows"]]
    assert lines[-1] == f"occupancy {len(labels)} cells"


def test_the_cells_of_an_area_are_counted_as_the_layer_lists_them(tmp_path):
    cells = np.random.default_rng(0).choice([-1, 0, 40, 100], (60, 80))
    hypermap = a_map()
    grid = hypermap["occupancy"].grid
    big = OccupancyLayer("big", "lab", type(grid)(80, 60, 0.1, grid.origin), cells)
    hypermap.add(big)
    area = [[-7.3, 0.2], [9.1, -3.0], [8.0, 5.5], [9.0, 7.0]]
    with serving(saved(tmp_path, hypermap)) as client:
        reply = Window(client).post("/api/area", polygon=area)
    listed = hypermap.labels_in("big", shapely.Polygon(area)).values.tolist()
    counted = {c["label"]: c["count"] for c in reply["cells"] if c["layer"] == "big"}
    assert counted == {label: listed.count(label) for label in set(listed)}
    assert len(counted) == 3


@pytest.mark.parametrize("frame", [None, "lab"])
@pytest.mark.parametrize("near", [None, "1,2", "-7.5,0.25"])
def test_what_is_looked_for_is_found_nearest_first_as_the_shown_calls_find_it(
    tmp_path, near, frame
):
    hypermap = a_map()
    cups = [square("cup", x, y, 0.3) for x, y in [(5, 5), (2, 1), (-4, 0), (0.5, 7)]]
    hypermap.add(SemanticLayer("more", "map", cups))
    values = {
        "name": "cup",
        **({"near": near} if near else {}),
        **({"frame": frame} if frame else {}),
    }
    with serving(saved(tmp_path, hypermap)) as client:
        reply = client.get("/api/find", params=values).json()
    rows = answers_of(reply["command"])
    assert [(r["layer"], r["id"]) for r in reply["rows"]] == [
        (r["layer"], r["value"]) for r in rows
    ]
    assert len(rows) == reply["total"] == 5
    assert len(lines_of(reply["python"])) == 5
    if near:
        distances = [row["distance"] for row in reply["rows"]]
        assert distances == sorted(distances)
        assert distances == pytest.approx([row["distance"] for row in rows])
    else:
        assert all(row["distance"] is None for row in reply["rows"])


def a_kitchen():
    """The map of the other tests, with things near, in and beside each other on another layer."""
    hypermap = a_map()
    cups = [square("cup", x, y, 0.3) for x, y in [(5, 5), (2, 1), (-4, 0), (0.5, 7)]]
    things = [*cups, square("kitchen", 4, 4, 6.0), square("2,3", 2.5, 3, 0.5)]
    hypermap.add(SemanticLayer("more", "map", things))
    return hypermap


POLYGON = "1,0,6,0,6,6,1,6"


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        ({"name": "cup", "near": "kitchen"}, ["cup"] * 5),
        ({"name": "cup", "near": "kitchen", "within": "0"}, ["cup", "cup"]),
        ({"name": "cup", "near": "cup", "within": "3.5"}, []),
        ({"name": "cup", "near": "-4,0", "within": "1"}, ["cup"]),
        ({"near": "kitchen", "within": "0.5"}, ["cup", "cup", "cup", "2,3", "rug"]),
        ({"name": "cup", "near": "2,3", "within": "1.8"}, ["cup"]),  # a thing of that name
        ({"inside": "kitchen"}, ["cup", "cup", "2,3"]),
        ({"inside": "kitchen", "near": "1,1", "name": "cup"}, ["cup", "cup"]),
        ({"polygon": POLYGON}, ["cup", "cup", "kitchen", "2,3", "rug"]),
        ({"name": "cup", "polygon": POLYGON, "near": "kitchen", "within": "0"}, ["cup", "cup"]),
        ({"name": "cup", "polygon": POLYGON, "frame": "lab", "near": "0,0"}, ["cup"] * 2),
    ],
)
def test_what_is_near_inside_and_in_an_area_is_found_as_the_shown_calls_find_it(
    tmp_path, asked, names
):
    with serving(saved(tmp_path, a_kitchen())) as client:
        reply = client.get("/api/find", params=asked).json()
    rows = answers_of(reply["command"])
    objects = [row for row in rows if "object" in row]
    assert [(r["layer"], r["id"]) for r in reply["rows"]] == [
        (r["layer"], r["value"]) for r in objects
    ]
    assert sorted(row["name"] for row in reply["rows"]) == sorted(names)
    assert [row["distance"] for row in reply["rows"]] == [row.get("distance") for row in objects]
    assert len(lines_of(reply["python"])) == reply["total"] == len(names)
    assert reply["unknown"] == {}


@pytest.mark.parametrize(
    ("asked", "understood", "unknown"),
    [
        ({"name": "cup", "near": "kitchn"}, "kitchen", {"kitchn": ["kitchen"]}),
        ({"name": "cup", "inside": "tabel"}, "table", {"tabel": ["table"]}),
        ({"name": "cup", "near": "u"}, "u", {"u": ["cup", "rug"]}),
        ({"name": "zebra", "near": "giraffe"}, "giraffe", {"zebra": [], "giraffe": []}),
    ],
)
def test_of_names_that_nothing_has_the_page_tells_which_may_be_meant(
    tmp_path, asked, understood, unknown
):
    with serving(saved(tmp_path, a_kitchen())) as client:
        reply = client.get("/api/find", params=asked).json()
    assert understood in (reply["near"], reply["inside"])
    assert reply["unknown"] == unknown


@pytest.mark.parametrize(
    ("asked", "name", "total", "names"),
    [
        ("tab", "table", 1, ["table"]),
        ("TABLE", "table", 1, ["table"]),
        ("u", "u", 0, ["cup", "rug"]),
        ("tabel", "table", 1, ["table"]),
        ("zebra", "zebra", 0, []),
    ],
)
def test_names_are_suggested(tmp_path, asked, name, total, names):
    with serving(saved(tmp_path)) as client:
        reply = client.get("/api/find", params={"name": asked}).json()
    assert (reply["name"], reply["total"], reply["names"]) == (name, total, names)


def test_a_limit_is_kept_and_the_total_reported(tmp_path):
    hypermap = a_map()
    hypermap.add(SemanticLayer("more", "map", [square("cup", i, 0) for i in range(30)]))
    with serving(saved(tmp_path, hypermap)) as client:
        values = {"name": "cup", "near": "0,0", "limit": 7}
        reply = client.get("/api/find", params=values).json()
    assert (len(reply["rows"]), reply["total"]) == (7, 31)


def test_names_that_shells_and_python_would_read_otherwise_are_quoted(tmp_path, monkeypatch):
    name = 'the $HOME\'s `table`; "rm" <script>alert(1)</script>'
    hypermap = a_map()
    hypermap.add(SemanticLayer("more", "map", [square(name, 3, 0)]))
    folder = tmp_path / "my maps"
    folder.mkdir()
    path = saved(folder, hypermap, "it's.hmap")
    monkeypatch.chdir(folder)
    with serving(type(path)("it's.hmap")) as client:
        reply = client.get("/api/find", params={"name": name, "near": "0,0"}).json()
        assert [row["name"] for row in reply["rows"]] == [name]
        assert [row["label"] for row in answers_of(reply["command"])] == [name]
        assert len(lines_of(reply["python"])) == 1


def test_an_area_is_downloaded_as_csv_and_geojson(tmp_path):
    corners = ",".join(f"{x},{y}" for x, y in SQUARE)
    with serving(saved(tmp_path)) as client:
        reply = Window(client).post("/api/area", polygon=SQUARE)
        table = client.get("/api/area.csv", params={"polygon": corners})
        drawn = client.get("/api/area.geojson", params={"polygon": corners})
    assert table.headers["content-disposition"] == 'attachment; filename="area.csv"'
    rows = list(csv.DictReader(io.StringIO(table.text)))
    assert [(row["layer"], int(row["id"]), row["name"]) for row in rows] == [
        (row["layer"], row["id"], row["name"]) for row in reply["rows"]
    ]
    assert rows[0]["tags"] == "mug;glass"
    assert float(rows[1]["existence"]) == 4.5
    assert rows[0]["existence"] == ""
    layer = from_geojson(drawn.text)
    assert layer.frame_id == "map"
    hypermap = a_map()
    for row in reply["rows"]:
        item = layer.get(row["id"])
        placed = hypermap.frames.lookup("map", "lab").apply_geometry(
            hypermap["things"].get(row["id"]).footprint
        )
        assert item.footprint.equals_exact(placed, 1e-9)
        assert item.attributes["layer"] == "things"


def test_equal_ids_of_two_layers_are_numbered_anew_in_geojson(tmp_path):
    hypermap = a_map()
    hypermap.add(SemanticLayer("more", "map", [square("lamp", 9, 1)]))
    corners = ",".join(f"{x},{y}" for x, y in SQUARE)
    with serving(saved(tmp_path, hypermap)) as client:
        drawn = client.get("/api/area.geojson", params={"polygon": corners})
    layer = from_geojson(drawn.text)
    assert sorted(layer.ids.tolist()) == list(range(len(layer)))
    assert "lamp" in layer.names


def test_all_that_is_known_of_an_object(tmp_path):
    with serving(saved(tmp_path)) as client:
        reply = client.get("/api/objects/things/1").json()
        rug = client.get("/api/objects/things/2").json()
        assert client.get("/api/objects/things/9").status_code == 404
        assert client.get("/api/objects/things/9?if_there=1").json() is None
        assert client.get("/api/objects/things/1?if_there=1").json() == reply
        assert client.get("/api/objects/occupancy/0").status_code == 400
    assert (reply["name"], reply["existence"], reply["first_seen"]) == ("table", 4.5, 1.0)
    assert reply["area"] == pytest.approx(4.0)
    hypermap = a_map()
    exact = hypermap.frames.lookup("map", "lab").apply_geometry(hypermap["things"].get(1).footprint)
    assert shapely.from_wkt(reply["wkt"]).equals_exact(exact, 1e-12)
    assert rug["attributes"] == {"color": "red"}
    assert len(rug["polygons"][0]) == 2


def test_what_the_page_needs_to_know_of_a_map(tmp_path):
    hypermap = a_map()
    hypermap.add(
        OpaqueLayer("Strange", "strange", "map", {"strange": b"?"}, settings={"file": "strange"})
    )
    with serving(saved(tmp_path, hypermap)) as client:
        info = client.get("/api/map").json()
    assert (info["name"], info["base_frame"], info["editable"]) == ("room.hmap", "map", True)
    assert (info["can_undo"], info["can_redo"], info["unsaved"]) == (False, False, False)
    grid, things, strange = info["layers"]
    assert (grid["kind"], grid["count"], grid["resolution"]) == ("raster", 6, 2.0)
    assert grid["legend"][1] == {"label": "Occupied", "color": "#68707e"}
    assert (things["kind"], things["count"], things["editable"]) == ("shapes", 3, True)
    assert [part["name"] for part in things["classes"]] == ["cup", "rug", "table"]
    assert len({part["color"] for part in things["classes"]}) == 3
    assert (strange["kind"], strange["class_name"]) == ("none", "Strange")
    # The unknown cells on the right are left out: 0..6 m along x, of which 4 are known above.
    assert grid["extent"] == [0.0, 0.0, 6.0, 4.0]


def test_the_view_begins_with_what_is_known(tmp_path):
    cells = np.full((50, 100), -1, np.int8)
    cells[10:20, 30:60] = 0
    cells[15, :] = 0  # a ray that went through a window does not count
    hypermap = a_map()
    grid = OccupancyLayer("grid", "map", type(hypermap["occupancy"].grid)(100, 50, 0.5), cells)
    with serving(saved(tmp_path, type(hypermap)([grid]))) as client:
        assert client.get("/api/map").json()["extent"] == [15.0, 5.0, 30.0, 10.0]


@pytest.mark.parametrize(
    ("path", "values", "reason"),
    [
        ("/api/at", {"x": "a", "y": 1}, "x: a number within 1e+09 m is expected, got 'a'"),
        ("/api/at", {"x": 1}, "y: a number within 1e+09 m is expected, got None"),
        ("/api/at", {"x": 1, "y": 1, "frame": "lba"}, "frame 'lba' is unknown to the map; did you"),
        ("/api/find", {}, "name: missing; give name, near, inside or polygon"),
        ("/api/find", {"name": "cup", "near": "1"}, "near: a point x,y is expected, got '1'"),
        ("/api/find", {"name": "cup", "within": "1"}, "within: needs near"),
        ("/api/find", {"name": "cup", "near": "rug", "within": "-1"}, "within: must not be neg"),
        ("/api/find", {"near": "1,2"}, "name: missing; give name, near, inside or polygon"),
        ("/api/find", {"name": "cup", "polygon": "1,2,3,4"}, "a polygon needs at least three"),
        ("/api/find", {"name": "cup", "limit": 0}, "limit: must be from 1 to 5000, got 0"),
        ("/api/area.csv", {"polygon": "0,0,1,1"}, "at least three corners, got 2"),
        ("/api/area.csv", {"polygon": "0,0,1,1,1"}, "each corner must be a point [x, y]"),
        ("/api/area.csv", {}, "polygon: a number within 1e+09 m is expected, got ''"),
        ("/api/objects/things/x", {}, "id: a whole number is expected, got 'x'"),
    ],
)
def test_a_question_without_meaning_is_refused(tmp_path, path, values, reason):
    with serving(saved(tmp_path)) as client:
        answer = client.get(path, params=values)
        assert answer.status_code == 400
        assert reason in answer.json()["error"]


@pytest.mark.parametrize(
    ("polygon", "reason"),
    [
        ([[0, 0], [2, 2], [2, 0], [0, 2]], "polygon: the outline crosses itself"),
        ([[0, 0], [1, 1], [2, 2]], "polygon: the"),
        (SCRIBBLE, "polygon: an outline of 2001 corners crosses or touches itself too often"),
        ([[0, 0], [1, 1]], "at least three corners, got 2"),
        ([[0, 0], [1, "x"], [2, 2]], "a number within 1e+09 m is expected, got 'x'"),
        ([[0, 0], [1, float(10**12)], [2, 2]], "a number within 1e+09 m is expected"),
        ("POLYGON", "a list of corners [x, y] is expected, got 'POLYGON'"),
        (None, "a list of corners [x, y] is expected, got None"),
        ([[0, i] for i in range(2_001)], "has 2001 corners, more than 2000; draw it coarser"),
    ],
)
def test_an_area_that_is_none_is_refused(tmp_path, polygon, reason):
    with serving(saved(tmp_path)) as client:
        assert reason in Window(client).post("/api/area", 400, polygon=polygon)["error"]


def test_the_facts_of_a_real_map(shared_data):
    with serving(shared_data / "maps" / "lab.hmap") as client:
        window = Window(client)
        reply = window.get("/api/at", x=3, y=-2)
        assert reply["layers"][1]["label"] == "table"
        corners = [[2, -2], [3, -2], [3, -1], [2, -1]]
        rows = window.post("/api/area", polygon=corners)["rows"]
        assert sorted(row["name"] for row in rows) == ["chair", "table", "tvmonitor"]
        (sink,) = window.get("/api/find", name="sink")["rows"]
        assert (sink["x"], sink["y"]) == pytest.approx((3.259, 2.378), abs=1e-3)


@pytest.mark.parametrize("name", ["lab", "floor", "office", "example"])
def test_the_shown_calls_work_on_real_maps(shared_data, name):
    path = shared_data / "maps" / f"{name}.hmap"
    hypermap = open_map(path)
    layer = next(layer for layer in hypermap if isinstance(layer, SemanticLayer))
    x, y = layer.table.centroids[0].tolist()
    with serving(path) as client:
        window = Window(client)
        at = window.get("/api/at", x=x, y=y)
        assert [row["label"] for row in answers_of(at["command"])] == [
            reply["label"] for reply in at["layers"]
        ]
        found = window.get("/api/find", name=layer.names[0], near=f"{x},{y}", limit=5000)
        assert [row["value"] for row in answers_of(found["command"])] == [
            row["id"] for row in found["rows"]
        ]
        corners = [[x - 1, y - 1], [x + 1, y - 1], [x + 1.5, y + 1], [x - 1, y + 1]]
        area = window.post("/api/area", polygon=corners)
        rows = answers_of(area["command"])
        assert [row["value"] for row in rows if "object" in row] == [
            row["id"] for row in area["rows"]
        ]
