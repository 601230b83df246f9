from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import FrameError, HypermapError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.masks import Zone, draw_mask
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.testing.builders import occupancy_from_text, square
from hypermap.testing.strategies import areas, grids, poses

SEMANTIC_T_MAP = Pose2D(1.0, -2.0, 0.4)


def all_centers(grid: GridGeometry) -> np.ndarray:
    rows, cols = np.indices(grid.shape).reshape(2, -1)
    return np.asarray(shapely.points(grid.centers(rows, cols)))


def floor(width: int = 8, height: int = 6, resolution: float = 0.5, **pose: float):
    grid = GridGeometry(width, height, resolution, Pose2D(**pose))
    return OccupancyLayer("occupancy", "map", grid, np.zeros(grid.shape, np.int8))


@given(
    st.lists(st.tuples(st.sampled_from(["desk", "cup"]), areas()), max_size=4),
    grids,
    poses,
    st.floats(0, 20),
)
def test_a_cell_is_marked_if_and_only_if_its_centre_lies_within_the_margin(
    shapes, grid, map_T_lab, margin
) -> None:
    objects = [SemanticObject(name, shape) for name, shape in shapes]
    occupancy = OccupancyLayer("occupancy", "map", grid, np.zeros(grid.shape, np.int8))
    frames = FrameTree([Transform("map", "lab", map_T_lab)])
    hypermap = Hypermap([occupancy, SemanticLayer("semantic", "lab", objects)], frames)

    mask = draw_mask(hypermap, [Zone("desk", margin)])

    desks = [map_T_lab.apply_geometry(shape) for name, shape in shapes if name == "desk"]
    assert mask.grid is not None
    assert mask.cells is not None
    distances = np.full(mask.grid.width * mask.grid.height, np.inf)
    for desk in desks:
        distances = np.minimum(distances, shapely.distance(all_centers(mask.grid), desk))
    # Nearer to the margin, rounding decides, and that circles are drawn as polygons.
    clear = np.abs(distances - margin) > 1e-5 + 1e-4 * margin
    expected = np.where(distances <= margin, 100, -1)
    np.testing.assert_array_equal(mask.cells.ravel()[clear], expected[clear])


def test_a_margin_of_next_to_nothing_fills_no_hole() -> None:
    ring = shapely.box(0, 0, 4, 3) - shapely.box(1, 1, 3, 2)
    desk = SemanticLayer("semantic", "map", [SemanticObject("desk", ring)])

    mask = draw_mask(Hypermap([floor(), desk]), [Zone("desk", margin=1e-20)])

    assert mask.value_at([[2.25, 1.25], [0.25, 0.25]]).tolist() == [-1, 100]


def test_a_mask_looks_as_it_was_drawn_by_hand() -> None:
    desk = SemanticObject("desk", shapely.box(2, 2, 4, 3))
    hypermap = Hypermap(
        [
            occupancy_from_text("\n".join(["." * 7] * 5)),
            SemanticLayer("semantic", "map", [desk, square("cup", 0.5, 0.5)]),
        ]
    )
    expected = occupancy_from_text(
        """
        ???????
        ??##???
        ?####??
        ??##???
        ???????
        """.replace(" ", "")
    )
    mask = draw_mask(hypermap, [Zone("desk", 0.5)])
    assert mask.grid == hypermap["occupancy"].grid
    np.testing.assert_array_equal(mask.cells, expected.cells)
    assert mask.frame_id == "map"


def test_centres_exactly_at_the_margin_are_within_it() -> None:
    # 0.1 + 0.2 is more than 0.3 in floating point.
    layer = SemanticLayer("semantic", "map", [SemanticObject("desk", shapely.box(0.4, 0, 0.9, 1))])
    occupancy = floor(10, 10, 0.1, x=-0.05, y=-0.05)
    mask = draw_mask(Hypermap([occupancy, layer]), [Zone("desk", 0.3)])
    np.testing.assert_array_equal(mask.cells[5] == 100, np.arange(10) >= 1)


def test_objects_of_all_semantic_layers_count() -> None:
    layers = [
        floor(),
        SemanticLayer("a", "map", [square("desk", 0.75, 0.75, 0.4)]),
        SemanticLayer("b", "map", [square("desk", 2.75, 1.75, 0.4)]),
    ]
    mask = draw_mask(Hypermap(layers), [Zone("desk")])
    assert set(zip(*map(list, np.nonzero(mask.cells == 100)), strict=True)) == {(1, 1), (3, 5)}


def test_the_last_zone_counts_where_zones_overlap() -> None:
    layer = SemanticLayer("semantic", "map", [square("desk", 2, 1), square("plant", 2.5, 1)])
    zones = [Zone("desk", 0.0, 80), Zone("plant", 0.0, 30)]
    at = [[1.75, 0.75], [2.25, 0.75], [2.75, 0.75]]
    mask = draw_mask(Hypermap([floor(), layer]), zones, outside=0)
    assert mask.value_at(at).tolist() == [80, 30, 30]
    mask = draw_mask(Hypermap([floor(), layer]), zones[::-1], outside=0)
    assert mask.value_at(at).tolist() == [80, 80, 30]
    zones = [Zone("desk"), Zone("plant", value=0)]  # free again
    mask = draw_mask(Hypermap([floor(), layer]), zones, outside=50)
    assert mask.value_at([*at, [0.25, 0.25]]).tolist() == [100, 0, 0, 50]


def test_a_rotated_grid_gives_an_upright_mask_around_it() -> None:
    occupancy = floor(8, 6, 0.5, x=1.0, y=2.0, yaw=math.pi / 6)
    layer = SemanticLayer("semantic", "map", [square("desk", 2, 4)])
    mask = draw_mask(Hypermap([occupancy, layer]), [Zone("desk", 0.2)])
    assert mask.grid.origin.yaw == 0
    assert mask.grid.resolution == 0.5
    assert mask.grid.outline().buffer(1e-6).covers(occupancy.grid.outline())
    assert mask.label_at([[2, 4], [1.1, 2.1]]).tolist() == ["Occupied", "Unknown"]


@pytest.mark.parametrize("given_resolution", [None, 0.1])
def test_a_grid_of_its_own_covers_all_zones(given_resolution) -> None:
    layer = SemanticLayer("semantic", "lab", [square("desk", 7.02, -3), square("plant", 9, 1)])
    zones = [Zone("desk", 0.5), Zone("plant", 0.25)]
    mask = draw_mask(Hypermap([layer]), zones, resolution=given_resolution)
    step = given_resolution or 0.05
    assert mask.grid.resolution == step
    assert mask.frame_id == "lab"
    x0, y0, x1, y1 = mask.extent().bounds
    np.testing.assert_allclose([x0, y0, x1, y1], [6.02, -4.0, 9.75, 1.75], atol=step)
    assert x0 <= 6.02
    assert x1 >= 9.75
    marked = np.count_nonzero(mask.cells == 100) * step**2
    area = shapely.box(6.52, -3.5, 7.52, -2.5).buffer(0.5).area
    area += shapely.box(8.5, 0.5, 9.5, 1.5).buffer(0.25).area
    assert marked == pytest.approx(area, rel=0.04)


def test_a_resolution_of_its_own_comes_before_the_occupancy_layers_grid() -> None:
    layer = SemanticLayer("semantic", "map", [square("desk", 2, 4)])
    mask = draw_mask(Hypermap([floor(), layer]), [Zone("desk")], resolution=0.25)
    assert mask.extent().bounds == (1.5, 3.5, 2.5, 4.5)


def test_a_map_without_such_objects_has_a_mask_without_marks() -> None:
    assert np.all(draw_mask(Hypermap([floor()]), [Zone("desk", 1)]).cells == -1)
    alone = draw_mask(Hypermap(), [Zone("desk", 1)], outside=0)
    assert alone.cells.tolist() == [[0]]


def test_an_empty_occupancy_layer_lends_its_grid_to_no_mask() -> None:
    layers = [
        OccupancyLayer("slam", "map"),
        SemanticLayer("semantic", "map", [square("desk", 2, 4)]),
    ]
    assert draw_mask(Hypermap(layers), [Zone("desk")]).extent().bounds == (1.5, 3.5, 2.5, 4.5)


def test_an_object_whose_outline_crosses_itself_is_marked() -> None:
    bow_tie = shapely.Polygon([(0, 0), (4, 3), (4, 0), (0, 3)])
    layer = SemanticLayer("semantic", "map", [SemanticObject("desk", bow_tie)])
    mask = draw_mask(Hypermap([floor(), layer]), [Zone("desk", 0.01)])
    assert mask.label_at([[0.3, 1.7], [3.7, 1.7], [2.2, 0.2]]).tolist() == [
        "Occupied",
        "Occupied",
        "Unknown",
    ]


def test_what_a_mask_cannot_be_is_refused() -> None:
    layer = SemanticLayer("semantic", "lab", [square("desk", 2, 4)])
    with pytest.raises(FrameError, match="'lab'"):
        draw_mask(Hypermap([floor(), layer]), [Zone("desk")])
    far = SemanticLayer("semantic", "map", [square("desk", 0, 0), square("desk", 1e6, 1e6)])
    with pytest.raises(HypermapError, match="too large"):
        draw_mask(Hypermap([far]), [Zone("desk")])
    with pytest.raises(ValueError, match="resolution"):
        draw_mask(Hypermap([layer]), [Zone("desk")], resolution=-1)
    with pytest.raises(ValueError, match="margin must be from 0 to 1e\\+09 m, got -1"):
        Zone("desk", -1)
    with pytest.raises(ValueError, match="margin"):
        Zone("desk", math.nan)
    with pytest.raises(ValueError, match="between 0 and 100, got 101"):
        Zone("desk", 1, 101)


@pytest.mark.parametrize("resolution", [0, 0.0, math.nan, math.inf, 1e-300])
def test_a_resolution_that_is_none_is_not_replaced_by_another(resolution) -> None:
    layer = SemanticLayer("semantic", "map", [square("desk", 2, 4)])
    for layers in ([layer], [floor(), layer], []):
        with pytest.raises(ValueError, match="resolution must be from 1e-06 to 1e\\+06 m, got"):
            draw_mask(Hypermap(layers), [Zone("desk")], resolution=resolution)


@pytest.mark.parametrize("outside", [-2, 101, 300])
def test_other_cells_hold_what_a_mask_can_hold(outside: int) -> None:
    with pytest.raises(ValueError, match=f"outside must be between -1 and 100, got {outside}"):
        draw_mask(Hypermap([floor()]), [], outside=outside)


def test_values_and_margins_are_not_rounded_or_without_end() -> None:
    with pytest.raises(TypeError, match="cannot be interpreted as an integer"):
        Zone("desk", 1, 50.5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="cannot be interpreted as an integer"):
        draw_mask(Hypermap([floor()]), [], outside=0.5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"margin must be from 0 to 1e\+09 m, got 1e\+300"):
        Zone("desk", 1e300)
    layer = SemanticLayer("semantic", "map", [square("desk", 1e6, 1e6)])
    assert np.all(draw_mask(Hypermap([floor(), layer]), [Zone("desk", 1e9)]).cells == 100)
