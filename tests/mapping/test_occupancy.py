"""The occupancy layer from depth or laser with known poses."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.mapping.occupancy import OccupancyMapper
from hypermap.mapping.stages import OccupancyConfig
from hypermap.perception.frame import Camera, RgbdFrame

CONFIG = OccupancyConfig()
CAMERA = Camera.from_intrinsics(fx=120, fy=120, cx=79.5, cy=59.5, width=160, height=120)
# x forward, y left, z up, from the optical frame's x right, y down, z forward.
LEVEL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
LASER = np.eye(4)
FREE, OCCUPIED, UNKNOWN = 0, 100, -1


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.5) -> NDArray[np.float64]:
    """A camera at (x, y, z) that looks along the map's x axis."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = LEVEL, (x, y, z)
    return matrix


def corridor(wall: float, map_T_camera: NDArray[np.float64], wall_from: float = 0.0) -> RgbdFrame:
    """A floor at z = 0, and a wall across at x = `wall` that begins at a height above it."""
    v, u = np.mgrid[0:120, 0:160]
    right, down = (u - CAMERA.K[0, 2]) / 120, (v - CAMERA.K[1, 2]) / 120
    height, distance = map_T_camera[2, 3], wall - map_T_camera[0, 3]
    floor = np.where(down > 0, height / np.maximum(down, 1e-9), np.inf)
    on_wall = height - distance * down
    depth = np.where((distance < floor) & (on_wall >= wall_from), distance, floor)
    depth[~np.isfinite(depth)] = np.nan
    assert right.shape == depth.shape
    return RgbdFrame(0.0, depth.astype(np.float32), CAMERA, map_T_camera)


def mapped(*frames: RgbdFrame, times: int = 4, config: OccupancyConfig = CONFIG) -> OccupancyLayer:
    mapper = OccupancyMapper(config)
    for frame in frames * times:
        mapper.add_depth(frame)
    return mapper.layer()


@pytest.mark.parametrize("fill", [0.0, -1.0, np.inf, -np.inf])
def test_what_is_no_depth_is_not_mapped(fill: float) -> None:
    frame = corridor(3.02, pose())
    frame.depth[:, ::2] = np.nan
    expected = mapped(frame)
    frame.depth[:, ::2] = fill
    found = mapped(dataclasses.replace(frame))
    assert found.grid == expected.grid
    np.testing.assert_array_equal(found.cells, expected.cells)


def test_a_wall_is_occupied_free_before_it_and_unknown_behind() -> None:
    layer = mapped(corridor(3.02, pose()))
    # The camera, 0.5 m high, sees the floor from 1.0 m on (its lowest ray falls by 1 in 2).
    along = layer.value_at([[x, 0.0] for x in (1.1, 1.5, 2.0, 2.5, 2.9, 3.02, 3.1, 4.0)])
    assert along.tolist() == [FREE] * 5 + [OCCUPIED, UNKNOWN, UNKNOWN]
    wall = layer.value_at([[3.02, y] for y in (-1.5, -1, 0.5, 1, 1.5)])
    assert wall.tolist() == [OCCUPIED] * 5


def test_nothing_is_said_of_the_floor_that_only_high_rays_pass() -> None:
    # The lowest ray reaches the height of 0.3 m at 0.4 m and the floor at 1.0 m.
    layer = mapped(corridor(3.02, pose()))
    assert layer.value_at([[0.3, 0], [0.5, 0]]).tolist() == [UNKNOWN, FREE]


def test_the_floor_under_something_overhead_stays_free() -> None:
    config = dataclasses.replace(CONFIG, max_height=0.8)
    layer = mapped(corridor(2.02, pose(), wall_from=0.9), config=config)
    assert layer.value_at([[1.5, 0], [2.02, 0], [2.5, 0]]).tolist() == [FREE] * 3


def test_hits_beyond_the_range_are_not_used() -> None:
    config = dataclasses.replace(CONFIG, max_range=2.0)
    layer = mapped(corridor(3.02, pose()), config=config)
    assert layer.value_at([[1.5, 0], [1.9, 0], [2.3, 0], [3.02, 0]]).tolist() == [
        FREE,
        FREE,
        UNKNOWN,
        UNKNOWN,
    ]


def test_a_single_flying_point_is_no_hit() -> None:
    frame = corridor(3.02, pose())
    depth = frame.depth.copy()
    depth[40, 80] = 1.5
    layer = mapped(dataclasses.replace(frame, depth=depth))
    assert (layer.value_at([[1.5, y] for y in (-0.1, -0.05, 0, 0.05)]) != OCCUPIED).all()


def test_what_has_moved_away_becomes_free() -> None:
    near, far = corridor(2.02, pose()), corridor(3.02, pose())
    mapper = OccupancyMapper(CONFIG)
    for _ in range(10):
        mapper.add_depth(near)
    assert mapper.layer().value_at([[2.02, 0]]).tolist() == [OCCUPIED]
    # From the clamp 3.5 in steps of 0.4: below log(0.35/0.65) = -0.62 after eleven.
    for _ in range(11):
        mapper.add_depth(far)
    assert mapper.layer().value_at([[2.02, 0]]).tolist() == [FREE]


def test_log_odds_are_octomaps() -> None:
    mapper = OccupancyMapper(dataclasses.replace(CONFIG, free_thresh=0.0, occupied_thresh=1.0))
    mapper.add_scan([1.02], 0.0, 0.1, LASER)
    values = [mapper.layer().value_at([[1.02, 0], [0.5, 0]]).tolist()]
    for _ in range(9):
        mapper.add_scan([1.02], 0.0, 0.1, LASER)
    values.append(mapper.layer().value_at([[1.02, 0], [0.5, 0]]).tolist())
    # 1 / (1 + exp(-0.85)) = 0.70, 1 / (1 + exp(0.4)) = 0.40; clamped 3.5 -> 0.97, -2 -> 0.12.
    assert values == [[70, 40], [97, 12]]


def test_the_grid_is_aligned_to_its_resolution_and_grows_where_needed() -> None:
    mapper = OccupancyMapper(CONFIG)
    mapper.add_depth(corridor(3.02, pose()))
    before = mapper.layer()
    assert before.grid is not None
    mapper.add_depth(corridor(-37.0, pose(x=-40.0, y=-20.0)))
    after = mapper.layer()
    assert after.grid is not None
    for grid in (before.grid, after.grid):
        origin = np.array([grid.origin.x, grid.origin.y]) / 0.05
        assert origin == pytest.approx(np.round(origin))
    rows, cols = np.indices(before.grid.shape)
    points = before.grid.centers(rows.ravel(), cols.ravel())
    assert (after.value_at(points) == before.value_at(points)).all()
    assert after.value_at([[-36.99, -20.0]]).tolist() == [OCCUPIED]


def test_a_far_away_pose_is_an_error_and_leaves_the_map_as_it_was() -> None:
    mapper = OccupancyMapper(CONFIG)
    mapper.add_depth(corridor(3.02, pose()))
    before = mapper.layer()
    with pytest.raises(HypermapError) as error:
        mapper.add_depth(corridor(1e6 + 3, pose(x=1e6)))
    assert str(error.value) == (
        "the occupancy map would grow to 1000013 m x 26 m, more than its 50000000 cells of "
        "0.05 m allow; is a pose far off, or are the poses not in meters?"
    )
    assert mapper.layer().cells.tolist() == before.cells.tolist()


def test_a_map_far_from_its_origin_is_as_good_as_any() -> None:
    layer = mapped(corridor(500_003.02, pose(x=500_000.0, y=4_000_000.0)))
    assert layer.value_at([[500_003.02, 4e6], [500_002.0, 4e6]]).tolist() == [OCCUPIED, FREE]


def test_without_depth_the_layer_is_empty() -> None:
    empty = RgbdFrame(0.0, np.full((120, 160), np.nan, np.float32), CAMERA, pose())
    layer = mapped(empty)
    assert layer.grid is None
    assert layer.value_at([[0, 0]]).tolist() == [UNKNOWN]


def test_a_laser_scan_shows_walls_and_what_lies_before_them() -> None:
    mapper = OccupancyMapper(CONFIG)
    angles = np.linspace(-np.pi / 2, np.pi / 2, 361)
    ranges = 2.02 / np.maximum(np.cos(angles), 1e-3)  # a wall across, 2.02 m ahead
    map_T_laser = np.eye(4)
    map_T_laser[:3, 3] = 1, 1, 0.3
    for _ in range(3):
        mapper.add_scan(ranges, angles[0], angles[1] - angles[0], map_T_laser, range_max=4.0)
    along = mapper.layer().value_at([[1.02, 1], [2, 1], [2.9, 1], [3.02, 1], [3.1, 1]])
    assert along.tolist() == [FREE, FREE, FREE, OCCUPIED, UNKNOWN]
    assert mapper.layer().value_at([[3.02, 2], [1.02, 4.9]]).tolist() == [OCCUPIED, FREE]


@pytest.mark.parametrize(
    ("reading", "at_half", "at_end"),
    [
        (np.inf, FREE, FREE),  # met nothing
        (5.0, FREE, FREE),
        (np.nan, UNKNOWN, UNKNOWN),
        (0.0, UNKNOWN, UNKNOWN),
        (-1.0, UNKNOWN, UNKNOWN),
        (-np.inf, UNKNOWN, UNKNOWN),
    ],
)
def test_laser_readings_that_are_no_hits(reading: float, at_half: int, at_end: int) -> None:
    mapper = OccupancyMapper(CONFIG)
    for _ in range(2):
        mapper.add_scan([reading], 0.0, 0.1, LASER, range_max=4.0)
    assert mapper.layer().value_at([[2.02, 0], [3.98, 0]]).tolist() == [at_half, at_end]


def test_a_scan_needs_a_finite_reach() -> None:
    with pytest.raises(ValueError, match="range_max must be a positive number, got inf"):
        OccupancyMapper(CONFIG).add_scan([1.0], 0.0, 0.1, np.eye(4), range_max=np.inf)


@given(
    ranges=st.lists(st.integers(2, 120).map(lambda n: n / 20) | st.just(np.inf), max_size=20),
    yaw=st.integers(-30, 30).map(lambda n: n / 10),
)
def test_every_reading_within_reach_marks_its_cell_and_nothing_else_is_occupied(
    ranges: list[float], yaw: float
) -> None:
    mapper = OccupancyMapper(CONFIG)
    map_T_laser = np.eye(4)
    map_T_laser[:2, 3] = x, y = 0.0137, 0.0171  # off the borders of cells
    map_T_laser[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    mapper.add_scan(ranges, 0.0, 0.2, map_T_laser)
    r = np.array(ranges)
    angles = yaw + 0.2 * np.arange(len(r))
    hit = r < CONFIG.max_range
    ends = np.column_stack([x + r[hit] * np.cos(angles[hit]), y + r[hit] * np.sin(angles[hit])])
    layer = mapper.layer()
    assert (layer.value_at(ends) == OCCUPIED).all()
    cells = {(int(row), int(col)) for col, row in np.floor(ends / CONFIG.resolution)}
    assert len(layer.find("Occupied")) == len(cells)
