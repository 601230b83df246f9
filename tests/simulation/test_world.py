"""World files, good and bad."""

from __future__ import annotations

from pathlib import Path

import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.formats import open_map
from hypermap.simulation.scene import footprint, placed, wall_parts
from hypermap.simulation.trajectory import planar_poses
from hypermap.simulation.world import (
    Doorway,
    FloorPlan,
    Wall,
    World,
    WorldObject,
    built_in_world,
    built_in_worlds,
    demo_world,
    load_world,
)

BASE = "name: w\nfloor: {rectangle: [0, 0, 4, 3]}\n"


def load(folder: Path, text: str) -> object:
    path = folder / "w.yaml"
    path.write_text(text, encoding="utf-8")
    return load_world(path)


def test_a_world_need_not_have_objects(tmp_path: Path) -> None:
    world = load(tmp_path, BASE)
    assert isinstance(world, World)
    assert world.objects == ()


def test_a_world_file_becomes_plain_data(tmp_path: Path) -> None:
    text = BASE + (
        "walls: [{line: [[0, 0], [4, 0]], doors: [{at: [2, 0]}]}]\n"
        "objects:\n"
        "  - {model: table, at: [1, 2.5]}\n"
        "  - {model: cup, name: no, at: [1, 2.5], z: 0.74, yaw_deg: 90, size: {height: 0.2}}\n"
        "drive: {waypoints: [[1, 1], [2, 1, 90]], speed: 1}\n"
    )
    world = load(tmp_path, text)
    assert world.floor == FloorPlan((0, 0, 4, 3))
    assert world.walls == (Wall(line=((0, 0), (4, 0)), doors=(Doorway((2, 0), 0.9),)),)
    assert world.objects == (
        WorldObject("table", (1, 2.5)),
        WorldObject("cup", (1, 2.5), yaw_deg=90, z=0.74, name="no", size={"height": 0.2}),
    )
    assert world.objects[1].label == "no"
    assert world.drive.waypoints == ((1, 1), (2, 1, 90))
    assert (world.drive.speed, world.drive.camera_height) == (1, 1.2)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "w.yaml: a world file has keys such as 'floor' and 'objects'"),
        ("- 1", "w.yaml: a world file has keys such as 'floor' and 'objects'"),
        ("a: [", "w.yaml: is not valid YAML: did not find expected node content (line 2)"),
        ("a: !!python/object:os.system {}", "w.yaml: line 1: the tag"),
        ("name: w", "w.yaml: floor: is missing"),
        (BASE + "objcts: []", "w.yaml: objcts: unknown key; did you mean 'objects'?"),
        (BASE + "objects: 3", "w.yaml: objects: input should be a valid list, found 3"),
        (BASE + "objects: [3]", "w.yaml: objects[0]: expected keys and values, found 3"),
        (
            BASE + "objects: [{model: char, at: [1, 1]}]",
            "w.yaml: objects[0]: unknown model 'char'; did you mean 'chair'?",
        ),
        (
            BASE + "objects: [{model: chair, at: [1, 1], siz: {}}]",
            "w.yaml: objects[0].siz: unknown key; did you mean 'size'?",
        ),
        (
            BASE + "objects: [{model: chair, at: [1, 1], size: {widht: 1}}]",
            "w.yaml: objects[0]: chair has no size 'widht'; did you mean 'width'?",
        ),
        (
            BASE + "objects: [{model: chair, at: [1, 1], size: {width: 30}}]",
            "w.yaml: objects[0]: width must be above 0 and at most 20 m, got 30.0",
        ),
        (
            BASE + "objects: [{model: chair, at: [1, 1], size: {seat_height: 2}}]",
            "w.yaml: objects[0]: these sizes do not work together: a part would have no extent",
        ),
        (
            BASE + "objects: [{model: chair, at: [1, 1], color: bluu}]",
            "w.yaml: objects[0]: 'bluu' is not a color; write it like '#b5835a' or 'teal'",
        ),
        (
            BASE + "objects: [{model: cup}]",
            "w.yaml: objects[0]: an object needs either a place ('at') or an outline",
        ),
        (
            BASE + "objects: [{model: cup, outline: [[0, 0], [1, 1], [1, 0], [0, 1]]}]",
            "w.yaml: objects[0]: the corners of an outline must go around a convex shape",
        ),
        (
            "name: w\nfloor: {color: teal}",
            "w.yaml: floor: a floor needs either a rectangle or rectangles",
        ),
        (BASE + "objects: [{model: cup, at: [1]}]", "w.yaml: objects[0].at[1]: is missing"),
        (
            BASE + "objects: [{model: cup, at: [1, .nan]}]",
            "w.yaml: objects[0].at[1]: input should be less than or equal to 1000, found nan",
        ),
        (
            BASE + "objects: [{model: cup, at: [1, yes]}]",
            "w.yaml: objects[0].at[1]: input should be a valid number, found True",
        ),
        (
            BASE + "objects: [{model: cup, at: [1, 1], yaw_deg: 720}]",
            "w.yaml: objects[0].yaw_deg: input should be less than or equal to 360, found 720",
        ),
        (BASE + "walls: [{}]", "w.yaml: walls[0]: a wall needs either a line or a rectangle"),
        (
            BASE + "walls: [{line: [[0, 0], [4, 0]], doors: [{at: [2, 1]}]}]",
            "w.yaml: walls[0]: the door at (2, 1) is not in the wall",
        ),
        (
            BASE + "drive: {waypoints: []}",
            "w.yaml: drive.waypoints: list should have at least 1 item, not 0, found a list",
        ),
        (
            "name: w\nfloor: {rectangle: [4, 0, 0, 3]}",
            "w.yaml: floor: a rectangle is xmin, ymin, xmax, ymax, each minimum below its maximum",
        ),
        (
            BASE + "objects: [{model: table, at: [1, 1]}, {model: sofa, at: [1.2, 1]}]",
            "w.yaml: objects[1]: the sofa at (1.2, 1) stands in the table at (1, 1), "
            "which is objects[0]; move one of them, or raise its z",
        ),
        (
            BASE + "objects: [{model: table, at: [2, 2]}, {model: cup, at: [2, 2], z: 0.9}]",
            "w.yaml: objects[1]: the cup at (2, 2) hangs in the air: nothing ends at its z of 0.9 "
            "below it, and no wall is next to it; set its z to the height of what it stands on",
        ),
        (
            BASE + "objects: [{model: table, at: [2, 2]}, {model: cup, at: [3, 2], z: 0.74}]",
            "w.yaml: objects[1]: the cup at (3, 2) hangs in the air",
        ),
        (
            BASE + "walls: [{line: [[0, 1], [4, 1]], doors: [{at: [1, 1], width: 0.8}]}]\n"
            "drive: {waypoints: [[2, 0.5], [1, 0.5], [1, 2], [2, 2], [2, 0.5, 90]]}",
            "w.yaml: drive.waypoints[4]: on its way to (2, 0.5), the camera passes through a wall; "
            "add a waypoint before, or move this one",
        ),
        (
            BASE + "objects: [{model: cupboard, at: [2, 2]}, {model: bin, at: [1, 1]}]\n"
            "drive: {waypoints: [[1, 0.3], [1, 2], [2, 2]]}",
            "w.yaml: drive.waypoints[2]: on its way to (2, 2), the camera passes through the "
            "cupboard at (2, 2)",
        ),
        (
            BASE + "objects: [{model: cupboard, at: [2, 2]}]\ndrive: {waypoints: [[2, 2]]}",
            "w.yaml: drive.waypoints[0]: on its way to (2, 2), the camera passes through",
        ),
        (
            BASE + "walls: [{line: [[0, 1], [4, 1]]}]\nobjects: [{model: bin, at: [2, 1.02]}]",
            "w.yaml: objects[0]: the bin at (2, 1.02) stands in a wall; move it away from there",
        ),
        (
            BASE + "objects: [{model: bin, at: [9, 9]}]",
            "w.yaml: objects[0]: the bin at (9, 9) is beside the floor; move it onto the floor, or "
            "add a rectangle there",
        ),
        (BASE + "variation: {mov: 1}", "w.yaml: variation.mov: unknown key; did you mean 'move'?"),
    ],
)
def test_a_bad_world_file_is_named_with_its_key_and_the_remedy(
    tmp_path: Path, text: str, message: str
) -> None:
    with pytest.raises(FormatError) as caught:
        load(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path}/{message}")


def test_a_missing_world_file_is_said_to_be_missing(tmp_path: Path) -> None:
    with pytest.raises(FileMissing, match=r"none.yaml: there is no such world file"):
        load_world(tmp_path / "none.yaml")


def test_a_cup_on_a_table_and_a_chair_under_it_do_not_overlap(tmp_path: Path) -> None:
    text = BASE + (
        "objects:\n"
        "  - {model: table, at: [2, 1.5]}\n"
        "  - {model: cup, at: [2, 1.5], z: 0.74}\n"
        "  - {model: chair, at: [2.45, 1.5], yaw_deg: 180}\n"  # seat below the top, back outside
    )
    assert len(load(tmp_path, text).objects) == 3


def test_the_demo_room_holds_a_dozen_objects_and_more_of_several_classes() -> None:
    world = demo_world()
    assert len(world.objects) >= 12
    assert len({thing.label for thing in world.objects}) >= 6
    room = shapely.box(*world.floor.rectangle)
    assert all(room.covers(footprint(placed(thing))) for thing in world.objects)


@pytest.mark.parametrize("name", built_in_worlds())
def test_the_drive_through_a_world_hits_nothing(name: str) -> None:
    world = built_in_world(name)
    _, poses = planar_poses(world.drive, rate=5)
    walls = [footprint(wall_parts(wall)) for wall in world.walls]
    things = [footprint(placed(thing)) for thing in world.objects]
    assert shapely.union_all([*walls, *things]).distance(shapely.LineString(poses[:, :2])) > 0.2


@pytest.mark.parametrize(("name", "duration"), [("lab", 143), ("floor", 420)])
def test_the_drives_take_as_long_as_those_of_the_real_recordings(name: str, duration: int) -> None:
    stamps, _ = planar_poses(built_in_world(name).drive, rate=5)
    assert stamps[-1] == pytest.approx(duration, abs=3)


# A hand-drawn outline of a round thing or a person is a quadrilateral; what is built in it is not.
ROUND = {"cup", "fan", "person", "pottedplant"}


@pytest.mark.parametrize("name", ["lab", "floor"])
def test_worlds_made_after_real_ones_have_their_objects(name: str, shared_data: Path) -> None:
    real = open_map(shared_data / "maps" / f"{name}.hmap")["semantic"].objects()
    ours = [(thing.label, footprint(placed(thing))) for thing in built_in_world(name).objects]
    assert [label for label, _ in ours] == [thing.name for thing in real]
    for (label, shape), thing in zip(ours, real, strict=True):
        iou = shape.intersection(thing.footprint).area / shape.union(thing.footprint).area
        assert iou > (0.6 if label in ROUND else 0.94)
        # float64 sums leave something of the last digits
        assert thing.footprint.buffer(1e-9).covers(shape)


def test_an_unknown_world_is_named_with_the_known_ones() -> None:
    with pytest.raises(HypermapError, match=r"no world 'ofice'; did you mean 'office'\?"):
        built_in_world("ofice")


@given(
    st.lists(st.tuples(*[st.integers(-9, 9)] * 2), min_size=4, max_size=4, unique=True),
    st.floats(-180, 180),
)
def test_a_table_fills_its_outline_exactly(corners: list[tuple[int, int]], yaw: float) -> None:
    outline = shapely.Polygon(corners)
    assume(outline.is_valid and outline.convex_hull.area == outline.area)
    assume(outline.minimum_clearance > 0.3)
    table = WorldObject("table", yaw_deg=yaw, outline=tuple((x / 2, y / 2) for x, y in corners))
    filled = shapely.Polygon(table.outline)
    assert footprint(table.parts()).symmetric_difference(filled).area < 1e-6 * filled.area


@pytest.mark.parametrize(("yaw", "back"), [(0, (0, 1)), (90, (1, 0)), (180, (2, 1)), (-90, (1, 2))])
@pytest.mark.parametrize("turn", [1, -1])
def test_an_outline_faces_the_given_way(yaw: float, back: tuple[int, int], turn: int) -> None:
    square = ((0, 0), (2, 0), (2, 2), (0, 2))[::turn]
    chair = WorldObject("chair", yaw_deg=yaw, outline=square)
    highest = max(chair.parts(), key=lambda part: part.vertices[:, 2].max())
    assert shapely.Point(back).distance(footprint([highest])) < 0.1
    assert shapely.Point(1, 1).distance(footprint([highest])) > 0.5
