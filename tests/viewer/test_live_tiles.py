from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import HypermapError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import RasterPicture
from hypermap.core.occupancy import COLORS, OccupancyLayer, cell_colors
from hypermap.viewer.live.cache import ByteCache
from hypermap.viewer.live.pyramid import Pyramid
from hypermap.viewer.live.tiles import SIDE, Tile, draw_tile

from .live_tools import a_map, pixels_of, saved, serving

DARK = (*COLORS["Occupied"], 255)

poses = st.builds(
    Pose2D,
    st.floats(-20, 20),
    st.floats(-20, 20),
    st.one_of(st.just(0.0), st.floats(-math.pi, math.pi)),
)


@st.composite
def layers(draw: st.DrawFn, values: st.SearchStrategy[int] | None = None) -> OccupancyLayer:
    width, height = draw(st.integers(1, 40)), draw(st.integers(1, 40))
    seed = draw(st.integers(0, 2**32 - 1))
    highest = draw(st.sampled_from([100, 255]))
    cells = np.random.default_rng(seed).integers(-1, highest + 1, (height, width))
    grid = GridGeometry(width, height, draw(st.sampled_from([0.05, 0.1, 0.37, 1.0])), draw(poses))
    return OccupancyLayer("occupancy", "map", grid, cells)


def color_of(value: int, is_on_grid: bool) -> tuple[int, ...]:
    if not is_on_grid:
        return (0, 0, 0, 0)
    return (*cell_colors()[value][:3].tolist(), 255)


@given(layers(), poses, st.integers(-2, 3), st.tuples(st.floats(0, 1), st.floats(0, 1)))
def test_a_magnified_pixel_shows_the_cell_at_its_centre(layer, pose, zoom, place):
    grid = layer.grid
    pixel = math.ldexp(0.01, zoom)
    if 1.5 * pixel > grid.resolution:
        return
    inside = np.array(place) * [grid.width, grid.height] * grid.resolution
    middle = pose.apply(grid.origin.apply(inside))[0]
    column, row = np.floor(middle / (pixel * SIDE)).astype(int).tolist()
    tile = Tile(zoom, column, row)
    drawn = pixels_of(draw_tile(Pyramid.of(layer), tile, pose))
    xs, ys = tile.centers()
    for i, j in np.random.default_rng(0).integers(0, SIDE, (200, 2)):
        point = pose.inverse().apply([xs[j], ys[SIDE - 1 - i]])
        cell = grid.cells_at(point)
        expected = color_of(int(layer.value_at(point)[0]), bool(grid.contains(*cell.T)[0]))
        assert tuple(drawn[i, j].tolist()) == expected


@given(layer=layers(), pose=poses, ratio=st.floats(1.0, 60.0), shift=st.floats(0, 1))
def test_no_occupied_cell_disappears_when_reduced(layer, pose, ratio, shift):
    grid, pixel = layer.grid, layer.grid.resolution * ratio
    corners = pose.apply(grid.corners())
    low, high = corners.min(axis=0), corners.max(axis=0)
    xs = np.arange(low[0] - (1 + shift) * pixel, high[0] + 2 * pixel, pixel)
    ys = np.arange(low[1] - (1 + shift) * pixel, high[1] + 2 * pixel, pixel)
    pixels = Pyramid.of(layer).draw(xs, ys, pixel, pose)
    rows, cols = np.nonzero(np.asarray(layer.cells) >= 100)
    drawn = np.argwhere(pixels == 100)
    centers = np.column_stack([xs[drawn[:, 1]], ys[drawn[:, 0]]])
    for place in pose.apply(grid.centers(rows, cols)) if len(rows) else []:
        off = np.abs(centers - place).max(axis=1)
        # A pixel reaches half its side; a merged cell may be as large as that again.
        assert off.min() <= pixel * 1.5 + grid.resolution


def test_a_thin_wall_is_seen_at_every_zoom():
    cells = np.zeros((2000, 2000), dtype=np.int8)
    cells[777, :] = 100
    pyramid = Pyramid.of(OccupancyLayer("o", "map", GridGeometry(2000, 2000, 0.05), cells))
    for zoom in range(3, 9):
        drawn = pixels_of(draw_tile(pyramid, Tile(zoom, 0, 777 * 5 // (256 << zoom)), Pose2D()))
        row = SIDE - 1 - int(777.5 * 0.05 / math.ldexp(0.01, zoom)) % SIDE
        width = min(SIDE, int(100 / math.ldexp(0.01, zoom)))
        assert (drawn[row, :width] == DARK).all(), zoom
        lines = np.flatnonzero((drawn[:, 0] == DARK).all(axis=-1))
        assert len(lines) <= 2, "a wall of one cell became a broad one"


def test_a_level_holds_the_highest_of_its_cells():
    cells = np.random.default_rng(3).integers(-1, 101, (13, 22)).astype(np.int8)
    pyramid = Pyramid.of(OccupancyLayer("o", "map", GridGeometry(22, 13, 1.0), cells))
    for number in range(7):
        side = 2**number
        level = pyramid.level(number)
        assert level.shape == (max(1, -(-13 // side)), max(1, -(-22 // side)))
        for row, col in np.ndindex(level.shape):
            part = cells[row * side : (row + 1) * side, col * side : (col + 1) * side]
            assert level[row, col] == part.max()


def test_colors_of_other_layers_are_averaged_by_their_opacity():
    rgba = np.zeros((2, 2, 4), np.uint8)
    rgba[0, 0] = (200, 100, 0, 255)
    picture = RasterPicture(GridGeometry(2, 2, 1.0), rgba)
    level = Pyramid.of_picture(picture).level(1)
    assert level.shape == (1, 1, 4)
    assert level[0, 0].tolist() == [200, 100, 0, 64]


def test_a_tile_of_a_turned_layer_is_served_with_its_version(tmp_path):
    hypermap = a_map()
    grid = hypermap["occupancy"]
    turned = OccupancyLayer("turned", "lab", grid.grid, grid.cells)
    hypermap.add(turned)
    with serving(saved(tmp_path, hypermap)) as client:
        answer = client.get("/api/tiles/turned/4/0/0.png?v=1")
        assert answer.headers["content-type"] == "image/png"
        assert "immutable" in answer.headers["cache-control"]
        pixels = pixels_of(answer.content)
        assert pixels.shape == (SIDE, SIDE, 4)
        xs, ys = Tile(4, 0, 0).centers()
        # In "lab" (0..6 along its x), x of the base frame falls along y of the layer.
        for x, y in [(9.0, 1.0), (7.0, 1.0), (9.0, 5.0), (7.0, 5.0)]:
            j, i = np.abs(xs - x).argmin(), SIDE - 1 - np.abs(ys - y).argmin()
            value = hypermap.value_at("turned", [x, y])[0]
            assert pixels[i, j].tolist() == list(color_of(int(value), True))
        etag = answer.headers["etag"]
        again = client.get("/api/tiles/turned/4/0/0.png", headers={"If-None-Match": etag})
        assert (again.status_code, again.content) == (304, b"")


@pytest.mark.parametrize(
    ("path", "status", "reason"),
    [
        ("occupancy/99/0/0", 400, "there is no zoom 99, only -8 to 24"),
        ("occupancy/0/x/0", 400, "column: a whole number is expected, got 'x'"),
        (f"occupancy/0/{10**30}/0", 400, "too far away"),
        ("things/0/0/0", 404, "layer 'things' is no grid"),
        ("ocupancy/0/0/0", 404, "there is no layer 'ocupancy'; did you mean 'occupancy'?"),
    ],
)
def test_what_is_no_tile_is_said_so(tmp_path, path, status, reason):
    with serving(saved(tmp_path)) as client:
        answer = client.get(f"/api/tiles/{path}.png")
        assert answer.status_code == status
        assert reason in answer.json()["error"]


def test_a_layer_whose_frame_is_nowhere_has_a_problem_and_the_others_are_shown(tmp_path):
    hypermap = a_map()
    lost = OccupancyLayer("lost", "moon", hypermap["occupancy"].grid, hypermap["occupancy"].cells)
    try:
        path = saved(tmp_path, Hypermap([*hypermap, lost], hypermap.frames))
        with serving(path) as client:
            described = {layer["name"]: layer for layer in client.get("/api/map").json()["layers"]}
    except HypermapError:
        pytest.skip("such a map cannot be opened")
    assert described["lost"]["kind"] == "none"
    assert "'moon'" in described["lost"]["problem"]
    assert described["occupancy"]["kind"] == "raster"


def test_frames_are_reported_in_the_base_frame(tmp_path):
    frames = FrameTree([Transform("map", "lab", Pose2D(1.0, 2.0, 0.5))])
    hypermap = Hypermap([OccupancyLayer("o", "lab")], frames)
    with serving(saved(tmp_path, hypermap)) as client:
        info = client.get("/api/map").json()
    assert info["base_frame"] == "lab"
    assert [frame["frame_id"] for frame in info["frames"]] == ["lab", "map"]
    inverse = Pose2D(1.0, 2.0, 0.5).inverse()
    assert info["frames"][1]["x"] == pytest.approx(inverse.x)
    assert info["frames"][1]["yaw"] == pytest.approx(-0.5)
    assert info["extent"] is None


@pytest.mark.parametrize(
    ("name", "occupied"), [("lab", 954), ("floor", None), ("office", None), ("example", None)]
)
def test_the_tiles_of_real_maps_show_every_cell(shared_data, name, occupied):
    with serving(shared_data / "maps" / f"{name}.hmap") as client:
        info = client.get("/api/map").json()
        (grid,) = (layer for layer in info["layers"] if layer["kind"] == "raster")
        x0, y0, x1, y1 = grid["extent"]
        zoom = math.floor(math.log2(grid["resolution"] / 0.01))  # magnified a little
        pixel = math.ldexp(0.01, zoom)
        dark = 0
        for column in range(math.floor(x0 / pixel / SIDE), math.ceil(x1 / pixel / SIDE)):
            for row in range(math.floor(y0 / pixel / SIDE), math.ceil(y1 / pixel / SIDE)):
                answer = client.get(f"/api/tiles/{grid['name']}/{zoom}/{column}/{row}.png")
                dark += int((pixels_of(answer.content) == DARK).all(axis=-1).sum())
        cells = dark * (pixel / grid["resolution"]) ** 2
        counted = occupied
        if counted is None:
            area = f"{x0},{y0},{x1},{y0},{x1},{y1},{x0},{y1}".split(",")
            corners = [[float(x), float(y)] for x, y in zip(area[::2], area[1::2], strict=True)]
            headers = {"X-Hypermap-Token": info["token"]}
            reply = client.post("/api/area", json={"polygon": corners}, headers=headers).json()
            counted = {cell["label"]: cell["count"] for cell in reply["cells"]}.get("Occupied", 0)
        assert cells == pytest.approx(counted, rel=0.1)


def test_what_was_not_used_for_longest_is_made_again():
    cache, made = ByteCache(limit=10), []

    def make(key: str) -> bytes:
        return cache.get(key, lambda: made.append(key) or b"1234")

    for key in "abacab":
        make(key)
    assert made == ["a", "b", "c", "b"]
