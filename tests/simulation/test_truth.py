"""The map that perfect mapping would make."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hypermap.simulation.truth import ground_truth, true_occupancy
from hypermap.simulation.world import Doorway, FloorPlan, Wall, World, WorldObject, demo_world

WORLD = World(
    "test",
    FloorPlan((0, 0, 4, 3)),
    objects=(
        WorldObject("table", (2, 1.5), size={"length": 0.8, "width": 1.2}),
        WorldObject("cup", (2, 1.5), z=0.74, name="mug"),
        WorldObject(
            "lamp", (3.5, 2.5), z=2.0, size={"height": 0.4}
        ),  # hangs above everybody's head
    ),
    walls=(Wall(rectangle=(-0.05, -0.05, 4.05, 3.05), doors=(Doorway((-0.05, 1), 1.0),)),),
)


def test_the_true_objects_have_exact_footprints_heights_and_their_places_as_ids() -> None:
    objects = ground_truth(WORLD)["semantic"].objects()
    assert [(thing.id, thing.name) for thing in objects] == [(0, "table"), (1, "mug"), (2, "lamp")]
    assert objects[0].footprint.equals(shapely.box(1.6, 0.9, 2.4, 2.1))
    heights = [objects[1].attributes[key] for key in ("z_min", "z_max")]
    assert heights == pytest.approx([0.74, 0.85])


def test_the_true_map_can_be_asked() -> None:
    truth = ground_truth(demo_world())
    assert truth.base_frame == "map"
    assert truth.label_at("semantic", [[6.7, 4.0]]).tolist() == ["sink"]
    assert truth.label_at("occupancy", [[6.7, 4.0], [1.0, 1.0]]).tolist() == ["Occupied", "Free"]


@pytest.mark.parametrize(
    ("point", "value"),
    [
        ((1.0, 2.5), 0),  # floor
        ((2.0, 1.5), 100),  # the table's top
        ((1.58, 1.5), 0),  # just next to it
        ((1.62, 1.5), 100),
        ((4.02, 1.5), 100),  # wall
        ((-0.05, 1.3), -1),  # the door: no wall, and no floor
        ((-0.05, 1.7), 100),
        ((3.5, 2.5), 0),  # under the lamp
        ((4.3, 1.5), -1),  # outside
        ((50, 50), -1),
    ],
)
def test_the_true_occupancy(point: tuple[float, float], value: int) -> None:
    assert true_occupancy(WORLD).value_at([point]).tolist() == [value]


def test_every_cell_that_an_obstacle_shares_area_with_is_occupied_and_no_other() -> None:
    slanted = World("w", FloorPlan((0, 0, 2, 2)), (WorldObject("sofa", (1, 1), yaw_deg=30),))
    layer = true_occupancy(slanted, resolution=0.1)
    (sofa,) = ground_truth(slanted)["semantic"].objects()
    rows, cols = np.indices(layer.grid.shape).reshape(2, -1)
    centers = layer.grid.centers(rows, cols)
    squares = shapely.box(*(centers - 0.05).T, *(centers + 0.05).T)
    shared = shapely.area(shapely.intersection(squares, sofa.footprint))
    occupied = layer.cells[rows, cols] == 100
    assert occupied[shared > 1e-4].all()
    assert not occupied[shared == 0].any()
