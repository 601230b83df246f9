"""Maps of one place in frames of their own: drawn anew in each, so that no cell is copied."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from hypermap import (
    GridGeometry,
    Hypermap,
    HypermapError,
    OccupancyLayer,
    Pose2D,
    SemanticLayer,
    SemanticObject,
    open_map,
)
from hypermap.alignment import NotAligned, align, in_frame_of
from hypermap.alignment.grids import Field, scan_of
from hypermap.core.errors import LayerNotFound
from hypermap.simulation import built_in_world, ground_truth, varied

FLAT = shapely.Polygon([(0, 0), (9, 0), (9, 4), (5.5, 4), (5.5, 7), (0, 7)])
WALLS = shapely.MultiLineString(
    [list(FLAT.exterior.coords), [(3, 0), (3, 2.5)], [(3, 3.6), (3, 7)], [(5.5, 4), (5.5, 1.2)]]
)
THINGS = [("chair", 1.0, 1.0), ("cup", 4.2, 2.0), ("chair", 7.5, 3.2), ("sofa", 1.5, 6.0)]

HALL = shapely.box(0, 0, 6, 4)  # looks the same from both ends
HALL_THINGS = [("chair", 1, 1), ("cup", 1, 3), ("sofa", 2, 2), ("plant", 0.5, 2), ("table", 3, 3)]


def drawn(
    pose: Pose2D,
    outline: shapely.Polygon = FLAT,
    walls: shapely.Geometry = WALLS,
    things: Sequence[tuple[str, float, float]] = (),
    resolution: float = 0.05,
    seen: shapely.Geometry | None = None,
) -> Hypermap:
    """Return a map of a place in a frame whose pose in that of the place is given."""
    corners = np.array(outline.buffer(0.5).exterior.coords)
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    turn = np.array([[cos, -sin], [sin, cos]])
    local = (corners - [pose.x, pose.y]) @ turn  # the inverse of the pose
    low, high = local.min(axis=0), local.max(axis=0)
    width, height = np.ceil((high - low) / resolution).astype(int).tolist()
    cols, rows = np.meshgrid(np.arange(width), np.arange(height))
    centers = np.stack([cols, rows], axis=-1) * resolution + resolution / 2 + low
    world = centers @ turn.T + [pose.x, pose.y]
    points = shapely.points(world)
    cells = np.full((height, width), -1, dtype=np.int8)
    cells[shapely.contains(outline, points)] = 0
    cells[shapely.dwithin(walls, points, 0.06)] = 100
    if seen is not None:
        cells[~shapely.contains(seen, points)] = -1
    origin = Pose2D(float(low[0]), float(low[1]), 0.0)
    objects = []
    for name, x, y in things:
        if seen is None or seen.contains(shapely.Point(x, y)):
            place = (np.array([x, y]) - [pose.x, pose.y]) @ turn
            objects.append(SemanticObject(name, shapely.Point(place).buffer(0.2)))
    grid = OccupancyLayer(
        "occupancy", "map", GridGeometry(width, height, resolution, origin), cells
    )
    return Hypermap([grid, SemanticLayer("semantic", "map", objects)])


def assert_is(found: Pose2D, expected: Pose2D, center: Sequence[float] = (4.0, 3.0)) -> None:
    """Assert that a pose is right to 3 cm in the middle of the place, and to half a degree."""
    middle = expected.inverse().apply(center)
    off = found.apply(middle) - expected.apply(middle)
    assert np.linalg.norm(off) < 0.03
    assert abs(math.remainder(found.yaw - expected.yaw, 2 * math.pi)) < math.radians(0.5)


POSES = st.builds(
    Pose2D, st.floats(-30, 30), st.floats(-30, 30), st.floats(-math.pi, math.pi, exclude_max=True)
)


@settings(max_examples=6, deadline=None)
@given(POSES)
def test_any_transform_is_found(pose: Pose2D) -> None:
    first = drawn(Pose2D(), things=THINGS, resolution=0.1)
    found = align(first, drawn(pose, things=THINGS, resolution=0.08))
    assert_is(found.a_T_b, pose)
    assert (found.objects, found.others) == (4, 0)
    assert found.agreement > 0.95
    assert found.overlap > 0.95


@settings(max_examples=50, deadline=None)
@given(st.integers(-2000, 2000), st.integers(-2000, 2000), st.sampled_from([0.0, 0.05, 1.0]))
def test_no_map_is_off_itself_by_rounding(col: int, row: int, margin: float) -> None:
    """Wherever its grid begins; walls that were a cell off moved maps by up to 0.7 cells."""
    grid = GridGeometry(9, 9, 0.05, Pose2D(0.05 * col, 0.05 * row))
    layer = OccupancyLayer("occupancy", "map", grid, 100 * np.eye(9, dtype=np.int8))
    scan = scan_of(Hypermap([layer]))
    field = Field.of(scan, 0.05, margin)
    assert field.at(scan.occupied_xy)[0] == pytest.approx(0, abs=1e-6)
    assert field.near(scan.occupied_xy + np.array([0.05, 0]))[0] == pytest.approx(0.05, abs=1e-6)


def test_a_part_is_found_in_the_whole_and_the_whole_around_the_part() -> None:
    pose = Pose2D(3.0, -8.0, 2.0)
    whole, part = drawn(Pose2D()), drawn(pose, seen=shapely.box(-1, -1, 5, 8))
    assert_is(align(whole, part).a_T_b, pose)
    assert_is(align(part, whole).a_T_b, pose.inverse(), center=pose.inverse().apply([4, 3])[0])


def test_moved_furniture_does_not_matter() -> None:
    boxes = [shapely.box(x, y, x + 0.6, y + 0.6).exterior for x, y in [(1, 1), (6, 1), (1, 5)]]
    others = [shapely.box(x, y, x + 0.6, y + 0.6).exterior for x, y in [(2, 1), (7, 2), (4, 5)]]
    pose = Pose2D(-4.0, 2.5, -0.7)
    before = drawn(Pose2D(), walls=shapely.union_all([WALLS, *boxes]))
    after = drawn(pose, walls=shapely.union_all([WALLS, *others]))
    assert_is(align(before, after).a_T_b, pose)


def test_where_two_places_fit_neither_is_chosen() -> None:
    walls, pose = HALL.exterior, Pose2D(1.0, 1.0, 0.4)
    plain = drawn(Pose2D(), HALL, walls)
    turned = drawn(pose, HALL, walls)
    with pytest.raises(NotAligned, match=r"several poses match.*give `hypermap align` --initial"):
        align(plain, turned)
    about = Pose2D(1.3, 0.8, 0.5)
    assert_is(align(plain, turned, initial=about).a_T_b, pose, center=(3, 2))
    # The same hall from its other end.
    there = Pose2D(5.0, 3.0, 0.4 - math.pi)
    found = align(plain, turned, initial=Pose2D(4.7, 3.2, 0.3 - math.pi))
    assert_is(found.a_T_b, there, center=(3, 2))


def test_objects_tell_one_end_of_a_hall_from_the_other() -> None:
    walls, pose = HALL.exterior, Pose2D(1.0, 1.0, 0.4)
    plain = drawn(Pose2D(), HALL, walls, HALL_THINGS)
    found = align(plain, drawn(pose, HALL, walls, HALL_THINGS))
    assert_is(found.a_T_b, pose, center=(3, 2))
    assert found.objects == 5


def test_another_place_is_refused() -> None:
    round_room = shapely.Point(0, 0).buffer(3)
    other = drawn(Pose2D(), round_room, round_room.exterior)
    with pytest.raises(NotAligned, match="the maps do not match"):
        align(drawn(Pose2D()), other)


def test_where_walls_fit_and_no_object_does_it_is_another_place() -> None:
    grid = [(x, y) for x in (0.7, 2.2, 4.0, 5.0) for y in (0.6, 1.6, 3.2)]
    here = [("chair" if i % 2 else "cup", x, y) for i, (x, y) in enumerate(grid)]
    there = [("cup" if i % 2 else "chair", x, y) for i, (x, y) in enumerate(grid)]
    with pytest.raises(NotAligned, match=r"only 0 of .* objects"):
        align(drawn(Pose2D(), things=here), drawn(Pose2D(), things=there))


def test_maps_without_walls_are_refused() -> None:
    empty = Hypermap([OccupancyLayer("occupancy", "map")])
    with pytest.raises(HypermapError, match="'occupancy' is empty"):
        align(empty, empty)
    unknown = OccupancyLayer("occupancy", "map", GridGeometry(1, 1, 0.05), np.array([[-1]]))
    with pytest.raises(HypermapError, match=r"the first map: .* no occupied cells"):
        align(Hypermap([unknown]), Hypermap([unknown]))
    with pytest.raises(HypermapError, match=r"the second map: .* no occupied cells"):
        align(drawn(Pose2D()), Hypermap([unknown]))
    with pytest.raises(HypermapError):
        align(Hypermap(), Hypermap())
    with pytest.raises(LayerNotFound, match="the second map: there is no layer 'walls'"):
        align(drawn(Pose2D()), drawn(Pose2D()), layers=(None, "walls"))


@pytest.mark.parametrize("name", ["lab", "office"])
def test_real_maps_are_distinguished(name: str, shared_data: Path) -> None:
    maps = {one: open_map(shared_data / f"maps/{one}.hmap") for one in ("lab", "office")}
    other = next(one for one in maps if one != name)
    with pytest.raises(NotAligned):
        align(maps[name], maps[other])


# Frames


def test_corners_of_two_buildings_that_are_alike_do_not_make_them_one() -> None:
    lab, corridor = (ground_truth(varied(built_in_world(name), 3)) for name in ("lab", "corridor"))
    with pytest.raises(NotAligned, match="15% of the smaller map overlaps, and 78% of the walls"):
        align(lab, corridor)


def test_the_second_map_can_be_asked_in_the_frame_of_the_first() -> None:
    pose = Pose2D(2.0, 1.0, math.pi / 2)
    first, second = drawn(Pose2D(), things=THINGS), drawn(pose, things=THINGS)
    moved = in_frame_of(first, second, pose)
    assert (moved.base_frame, first.base_frame) == ("map_2", "map")
    (cup,) = moved.objects("cup")
    assert moved.frames.lookup("map", "map_2").apply(cup.point_xy)[0] == pytest.approx([4.2, 2.0])
    (near,) = moved.objects("cup", near=[4.2, 2.0], within=0.1, frame_id="map")
    assert near.object.id == cup.object.id
    assert second.base_frame == "map"  # stays as it was
    assert in_frame_of(first, second, pose, "robot_2").base_frame == "robot_2"


def test_a_name_that_is_in_use_is_refused() -> None:
    hypermap = drawn(Pose2D())
    with pytest.raises(HypermapError, match="there is a frame 'map' already"):
        in_frame_of(hypermap, hypermap, Pose2D(), "map")
    aligned = in_frame_of(hypermap, hypermap, Pose2D())
    with pytest.raises(HypermapError, match="already has the parent"):
        in_frame_of(drawn(Pose2D()), aligned, Pose2D())
