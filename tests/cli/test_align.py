"""`hypermap align`: from two maps to a transform."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hypermap import GridGeometry, Hypermap, OccupancyLayer, Pose2D, open_map, save_map

from .conftest import Result, assert_one_error

Run = Callable[..., Result]

INITIAL = ("--initial", "2.2,0.8,80")  # without it, the search takes a second


@pytest.fixture
def days(tmp_path: Path) -> tuple[Path, Path]:
    """Return two maps of a room, of which the second begins at (2, 1) of the first, turned."""
    cells = np.full((80, 120), 0, dtype=np.int8)
    cells[[0, 1, -2, -1], :] = cells[:, [0, 1, -2, -1]] = 100
    cells[:30, 40:42] = cells[50:52, 70:] = 100
    files = tmp_path / "monday.hmap", tmp_path / "tuesday.hmap"
    for file, origin in zip(files, (Pose2D(), Pose2D(2.0, 1.0, np.pi / 2).inverse()), strict=True):
        grid = GridGeometry(120, 80, 0.05, origin)
        save_map(Hypermap([OccupancyLayer("occupancy", "map", grid, cells)]), file)
    return files


def test_it_prints_where_the_other_map_lies(hypermap: Run, days: tuple[Path, Path]) -> None:
    result = hypermap("align", *days)
    assert (result.code, result.err) == (0, "")
    where, how_sure = result.out.splitlines()
    found = re.fullmatch(r"x (\S+) m, y (\S+) m, yaw (\S+) degrees", where)
    assert found is not None
    assert [float(number) for number in found.groups()] == pytest.approx([2, 1, 90], abs=0.1)
    assert how_sure.startswith("100% of the walls agree, ")
    values = hypermap("align", *days, "--json", *INITIAL).json
    assert [values["x"], values["y"]] == pytest.approx([2.0, 1.0], abs=0.03)
    assert values["yaw"] == pytest.approx(np.pi / 2, abs=0.03)
    assert values["frame_id"] == "map"


def test_it_saves_the_other_map_with_the_transform(
    hypermap: Run, days: tuple[Path, Path], tmp_path: Path
) -> None:
    out = tmp_path / "aligned.hmap"
    result = hypermap("align", *days, *INITIAL, "-o", out, "--new-frame", "tuesday")
    assert (result.code, "'tuesday' lies in 'map'" in result.err) == (0, True)
    saved = open_map(out)
    assert saved.base_frame == "tuesday"
    assert saved.frames.lookup("map", "tuesday").yaw == pytest.approx(np.pi / 2, abs=0.03)
    assert_one_error(hypermap("align", *days, "-o", out), "exists already")
    before = out.read_bytes()
    assert "kept as" in hypermap("align", *days, *INITIAL, "-o", out, "--force").err
    assert out.with_name("aligned.hmap.bak").read_bytes() == before
    assert open_map(out).base_frame == "map_2"


def test_wrong_input_is_one_error_and_nothing_is_saved(
    hypermap: Run, days: tuple[Path, Path], tmp_path: Path
) -> None:
    out = tmp_path / "aligned.hmap"
    assert_one_error(hypermap("align", days[0], tmp_path / "none.hmap"), "none.hmap")
    assert_one_error(hypermap("align", *days, "-o", tmp_path / "out.png"), "saved as .hmap")
    assert_one_error(hypermap("align", *days, "--initial", "here"), "--initial 'here'")
    assert_one_error(hypermap("align", *days, "--new-frame", "b"), "need -o")
    same = hypermap("align", *days, *INITIAL, "-o", out, "--new-frame", "map")
    assert_one_error(same, "there is a frame 'map' already")
    assert not out.exists()


def test_another_place_is_refused(hypermap: Run, days: tuple[Path, Path], tmp_path: Path) -> None:
    cells = np.full((200, 200), 0, dtype=np.int8)
    rows, cols = np.indices(cells.shape)
    cells[np.abs(np.hypot(rows - 100, cols - 100) - 60) < 2] = 100
    file, out = tmp_path / "tower.hmap", tmp_path / "aligned.hmap"
    save_map(
        Hypermap([OccupancyLayer("occupancy", "map", GridGeometry(200, 200, 0.05), cells)]), file
    )
    assert_one_error(hypermap("align", days[0], file, "-o", out), "the maps do not match")
    assert not out.exists()


def test_a_map_that_is_not_bent_is_not_bent(hypermap: Run, days: tuple[Path, Path]) -> None:
    out = days[0].with_name("out.hmap")
    bent = hypermap("align", *days, *INITIAL, "--local", "-o", out)
    assert_one_error(bent, "bending does not help")
    assert_one_error(hypermap("align", *days, "--local"), "--local and --force need -o OUT")
    assert not out.exists()
