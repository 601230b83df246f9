"""Worlds as solid bodies."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hypermap.simulation.parts import box
from hypermap.simulation.scene import (
    BACKGROUND,
    Scene,
    footprint,
    placed,
    wall_parts,
)
from hypermap.simulation.standing import overlaps
from hypermap.simulation.world import Doorway, FloorPlan, Wall, World, WorldObject


def world(*objects: WorldObject, walls: tuple[Wall, ...] = ()) -> World:
    return World("test", FloorPlan((0, 0, 10, 10)), objects, walls)


def test_walls_around_a_rectangle_are_closed_at_the_corners_and_open_at_the_doors() -> None:
    wall = Wall(
        rectangle=(0, 0, 4, 3), thickness=0.2, doors=(Doorway((2, 0), 0.8), Doorway((4, 1), 1))
    )
    ring = shapely.LinearRing([(0, 0), (4, 0), (4, 3), (0, 3)]).buffer(0.1, join_style="mitre")
    doors = shapely.union(shapely.box(1.6, -1, 2.4, 1), shapely.box(3, 0.5, 5, 1.5))
    expected = ring.difference(doors)
    assert footprint(wall_parts(wall)).symmetric_difference(expected).area < 1e-9


def test_a_slanted_wall_has_its_thickness() -> None:
    wall = Wall(line=((0, 0), (3, 4)), thickness=0.1)
    expected = shapely.LineString([(0, 0), (3, 4)]).buffer(0.05, cap_style="square")
    assert footprint(wall_parts(wall)).symmetric_difference(expected).area < 1e-9


def test_a_door_wider_than_its_wall_leaves_no_wall() -> None:
    assert wall_parts(Wall(line=((0, 0), (1, 0)), doors=(Doorway((0.5, 0), 2),))) == ()


def test_a_thing_stands_where_its_pose_says() -> None:
    chair = footprint(
        placed(WorldObject("chair", (3, 4), yaw_deg=90, size={"length": 0.4, "width": 0.6}))
    )
    assert chair.bounds == pytest.approx((2.7, 3.8, 3.3, 4.2))
    heights = np.concatenate(
        [part.vertices[:, 2] for part in placed(WorldObject("cup", (0, 0), z=0.7))]
    )
    assert (heights.min(), heights.max()) == pytest.approx((0.7, 0.81))


def test_a_footprint_is_the_union_of_its_parts() -> None:
    parts = [box((1, 1, 1), (0, 0, 0), "red"), box((1, 1, 1), (0.5, 0, 3), "red")]
    assert footprint(parts).area == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("first", "second", "overlap"),
    [
        (WorldObject("table", (2, 2)), WorldObject("cup", (2, 2), z=0.74), False),  # on it
        (WorldObject("table", (2, 2)), WorldObject("cup", (2, 2), z=0.70), True),  # in its top
        (WorldObject("table", (2, 2)), WorldObject("cup", (2, 2)), False),  # under it
        (
            WorldObject("table", (2, 2)),
            WorldObject("chair", (2.45, 2), yaw_deg=180),
            False,
        ),  # pushed under
        (
            WorldObject("table", (2, 2)),
            WorldObject("chair", (2.15, 2), yaw_deg=180),
            True,
        ),  # back in the top
        (WorldObject("cupboard", (2, 2)), WorldObject("cupboard", (2, 3)), False),  # side by side
        (WorldObject("cupboard", (2, 2)), WorldObject("cupboard", (2, 2.99)), True),
    ],
)
def test_things_overlap_where_parts_share_space(
    first: WorldObject, second: WorldObject, overlap: bool
) -> None:
    assert overlaps(world(first, second)) == ([(0, 1)] if overlap else [])


def test_the_triangles_of_a_scene_know_what_they_belong_to() -> None:
    scene = Scene.of(world(WorldObject("cup", (5, 5)), walls=(Wall(line=((0, 0), (1, 0))),)))
    assert len(scene.triangles) == len(scene.colors) == len(scene.instances) == len(scene.is_floor)
    cup = scene.triangles[scene.instances == 0]
    assert cup[..., :2].mean(axis=(0, 1)) == pytest.approx([5, 5], abs=0.05)
    assert scene.triangles[scene.is_floor][..., 2].max() == 0
    assert (scene.instances == BACKGROUND).sum() == 2 * 12  # floor and wall, two boxes
