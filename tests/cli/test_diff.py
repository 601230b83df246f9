"""`hypermap diff`: what changed from one map to another."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely

from hypermap import (
    GridGeometry,
    Hypermap,
    OccupancyLayer,
    Pose2D,
    SemanticLayer,
    SemanticObject,
    save_map,
)

from .conftest import Result, assert_one_error

Run = Callable[..., Result]

TUESDAY = Pose2D(2.0, 1.0, np.pi / 2)
"""Where the second map begins on the first one."""


@pytest.fixture
def days(tmp_path: Path) -> tuple[Path, Path]:
    """Return two maps of a room in frames of their own; on the second day a chair has moved."""
    cells = np.full((40, 60), 0, dtype=np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    cells[:15, 20] = cells[25, 35:] = 100
    files = tmp_path / "monday.hmap", tmp_path / "tuesday.hmap"
    places = [(1.0, 3.0), (4.5, 1.0)]
    for file, origin, (x, y) in zip(files, (Pose2D(), TUESDAY.inverse()), places, strict=True):
        things = [
            ("chair", shapely.box(x, y, x + 0.5, y + 0.4)),
            ("sofa", shapely.box(3, 3, 5, 3.8)),
        ]
        objects = [SemanticObject(name, origin.apply_geometry(shape)) for name, shape in things]
        grid = GridGeometry(60, 40, 0.1, origin)
        layers = (
            OccupancyLayer("occupancy", "map", grid, cells),
            SemanticLayer("semantic", "map", objects),
        )
        save_map(Hypermap(layers), file)
    return files


def test_what_moved_is_shown_in_the_frame_of_the_first_map(
    hypermap: Run, days: tuple[Path, Path], tmp_path: Path
) -> None:
    picture = tmp_path / "changes.png"
    result = hypermap("diff", *days, "--picture", picture)
    assert result.code == 0
    assert result.err == f"saved {picture}\n"
    head, _, row, count = result.out.splitlines()
    assert head.split() == ["change", "object", "before", "now", "distance"]
    kind, name, x, y, to_x, to_y, distance, unit, how_sure = row.replace(",", "").split()
    assert (kind, name, unit, how_sure) == ("moved", "chair", "m", "(100%)")
    places = [float(number) for number in (x, y, to_x, to_y, distance)]
    assert places == pytest.approx([1.25, 3.2, 4.75, 1.2, np.hypot(3.5, 2.0)], abs=0.1)
    assert count == "1 moved, 1 object unchanged"
    assert picture.read_bytes().startswith(b"\x89PNG")

    document = hypermap("diff", *days, "--json").json
    (change,) = document["changes"]
    assert (document["frame_id"], document["unchanged"]) == ("map", 1)
    assert (change["change"], change["before"]["name"], change["layer"]) == (
        "moved",
        "chair",
        "semantic",
    )
    assert change["after"]["x"] == pytest.approx(4.75, abs=0.1)


def test_a_map_is_the_same_as_itself(hypermap: Run, days: tuple[Path, Path]) -> None:
    result = hypermap("diff", days[0], days[0], "--same-frame")
    assert (result.code, result.out) == (0, "2 objects unchanged\n")


def test_maps_are_not_aligned_if_they_are_in_one_frame(
    hypermap: Run, days: tuple[Path, Path]
) -> None:
    aligned = hypermap("diff", *days, "--name", "sofa")
    assert aligned.out == "1 object unchanged\n"
    as_they_are = hypermap("diff", *days, "--name", "sofa", "--same-frame", "--json").json
    assert [change["change"] for change in as_they_are["changes"]] == ["moved"]


def test_objects_are_not_paired_by_the_numbers_of_two_detectors(
    hypermap: Run, tmp_path: Path
) -> None:
    """Two maps of one recording have one id, but each numbers its objects as it finds them."""
    sofa = SemanticObject("sofa", shapely.box(3, 3, 5, 3.8), first_seen=2.0)
    lamp = SemanticObject("lamp", shapely.box(1, 1, 1.3, 1.3), first_seen=2.0)
    files = tmp_path / "one.hmap", tmp_path / "other.hmap"
    for file, things in zip(files, ([sofa, lamp], [lamp, sofa]), strict=True):
        layer = SemanticLayer("semantic", "map", things)
        save_map(Hypermap([layer], metadata={"map_id": "00ff", "map_version": 1}), file)
    result = hypermap("diff", *files)
    assert (result.code, result.out) == (0, "2 objects unchanged\n")


def test_how_far_is_moved_can_be_set(hypermap: Run, days: tuple[Path, Path]) -> None:
    assert hypermap("diff", *days, "--min-moved", "5").out == "2 objects unchanged\n"


def test_wrong_input_is_one_error(hypermap: Run, days: tuple[Path, Path], tmp_path: Path) -> None:
    picture = tmp_path / "changes.jpg"
    empty = tmp_path / "empty.hmap"
    save_map(Hypermap([SemanticLayer("semantic", "map", [])]), empty)
    grid = tmp_path / "grid.hmap"
    walls = OccupancyLayer("walls", "map", GridGeometry(9, 9, 1.0), np.zeros((9, 9), int))
    save_map(Hypermap([walls]), grid)
    for arguments, words in [
        ([*days, "--picture", picture], [".png or .svg"]),
        ([*days, "--name", "chiar"], ["'chiar'", "did you mean 'chair'"]),
        ([days[0], tmp_path / "none.hmap"], ["none.hmap: there is no such file"]),
        ([days[0], grid, "--same-frame"], [str(grid), "no layer of objects"]),
        ([days[0], empty], ["no occupancy layer", "--same-frame"]),
    ]:
        assert_one_error(hypermap("diff", *arguments), *words)
    assert not picture.exists()
