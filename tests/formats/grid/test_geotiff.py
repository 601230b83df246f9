from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.formats.grid.geotiff import GridLayer, to_geotiff

CELLS = np.array([[0, 100, -1], [5, 255, 7]])
ORIGINS = [Pose2D(), Pose2D(-1.5, 2.25), Pose2D(-1.5, 2.25, 0.5), Pose2D(3, -4, math.pi)]


def layer(origin: Pose2D = ORIGINS[1], frame_id: str = "map") -> OccupancyLayer:
    return OccupancyLayer("occupancy", frame_id, GridGeometry(3, 2, 0.05, origin), CELLS)


def corner_of(tags: Any, col: float, row: float) -> list[float]:
    """Return where a corner of a cell lies, as GeoTIFF 1.1 says, section 7.3.2 and annex B.6."""
    if 34264 in tags:
        matrix = np.reshape(tags[34264], (4, 4))
        return list((matrix @ [col, row, 0, 1])[:2])
    (scale_x, scale_y, _), (i, j, _, x, y, _) = tags[33550], tags[33922]
    return [x + (col - i) * scale_x, y - (row - j) * scale_y]


@pytest.mark.parametrize("origin", ORIGINS)
def test_a_geotiff_has_the_cells_and_says_where_they_lie(origin: Pose2D) -> None:
    grid = layer(origin).grid
    assert grid is not None
    with Image.open(io.BytesIO(to_geotiff(layer(origin)))) as picture:
        assert np.array_equal(np.asarray(picture), CELLS[::-1])
        tags = picture.tag_v2  # type: ignore[attr-defined]
        corners = [corner_of(tags, *at) for at in ((0, 2), (3, 2), (3, 0), (0, 0))]
        assert np.allclose(corners, grid.corners())
        assert tags[42113].rstrip("\0") == "-1"


@pytest.mark.parametrize("origin", ORIGINS)
@pytest.mark.parametrize("frame_id", ["map", "floor 2"])
def test_gdal_reads_the_cells_the_corners_and_the_frame(
    tmp_path: Path, origin: Pose2D, frame_id: str
) -> None:
    rasterio = pytest.importorskip("rasterio", reason="GDAL's reader: pip install rasterio")
    written = layer(origin, frame_id)
    (tmp_path / "map.tif").write_bytes(to_geotiff(written))
    with rasterio.open(tmp_path / "map.tif") as read:
        assert (read.count, read.nodata) == (1, -1)
        assert np.array_equal(read.read(1), CELLS[::-1])
        assert read.crs.to_wkt().startswith(f'LOCAL_CS["{frame_id}",UNIT["metre",1')
        matrix = np.reshape(read.transform, (3, 3))
        corners = [(matrix @ [*at, 1])[:2] for at in ((0, 2), (3, 2), (3, 0), (0, 0))]
        assert written.grid is not None
        assert np.allclose(corners, written.grid.corners())


def test_a_plug_ins_grid_keeps_its_fractions_and_unknown_cells() -> None:
    class Warmth:
        name, frame_id, grid = "warmth", "map", GridGeometry(2, 1, 1.0)
        cells = np.array([[20.5, math.nan]], np.float32)

    warmth: Any = Warmth()
    assert isinstance(warmth, GridLayer)
    with Image.open(io.BytesIO(to_geotiff(warmth))) as picture:
        assert np.array_equal(np.asarray(picture), Warmth.cells, equal_nan=True)
        assert picture.tag_v2[42113].rstrip("\0") == "nan"  # type: ignore[attr-defined]


def test_a_frame_of_other_letters_does_not_damage_the_file() -> None:
    with Image.open(io.BytesIO(to_geotiff(layer(frame_id="stöck|werk")))) as picture:
        assert picture.tag_v2[34737].rstrip("\0") == "st?ck?werk|"  # type: ignore[attr-defined]


def test_an_empty_grid_is_said_so() -> None:
    with pytest.raises(HypermapError, match="layer 'floor' is empty: there is no grid to save"):
        to_geotiff(OccupancyLayer("floor", "map"))
