"""Grids as GeoTIFF, for programs of geographic information systems.

The coordinates are meters in the layer's frame: an engineering system, which lies nowhere on the
globe and has the frame's name, as in our other files for such programs.

Sources: TIFF 6.0; OGC 19-008r4 (GeoTIFF 1.1); GDAL's GTiff driver for the tags of "no data" and of
units.
"""

from __future__ import annotations

import io
from typing import Any, Protocol, runtime_checkable
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray
from PIL import Image, TiffTags
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from hypermap.core.errors import HypermapError
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import UNKNOWN
from hypermap.core.value_layer import ValueLayer

# Tags
_PIXEL_SCALE, _TIE_POINT, _TRANSFORMATION = 33550, 33922, 34264
_KEYS, _TEXTS = 34735, 34737
_METADATA, _NO_DATA = 42112, 42113
# Keys, and what they are here
_MODEL_TYPE, _USER_DEFINED = 1024, 32767
_RASTER_TYPE, _PIXEL_IS_AREA = 1025, 1
_CITATION = 1026
_LINEAR_UNITS, _METRE = 3076, 9001


@runtime_checkable
class GridLayer(Protocol):
    """A layer of numbers on a grid, ours or a plug-in's.

    Attributes:
        grid: geometry of the cells; None while the layer is empty.
        cells: shape (height, width), row 0 the lowest; where nothing is known, whole numbers are
            -1 and others NaN. None while the layer is empty.
    """

    name: str
    frame_id: str
    grid: GridGeometry | None
    cells: NDArray[Any] | None


def to_geotiff(layer: GridLayer) -> bytes:
    """Return a grid as the content of a GeoTIFF file of one band, with its frame.

    Whole numbers are kept as int32, where -1 stands for "no data"; others as float32, where NaN
    does.

    Raises:
        HypermapError: If the layer is empty.
    """
    grid, cells = layer.grid, layer.cells
    if grid is None or cells is None:
        raise HypermapError(f"layer {layer.name!r} is empty: there is no grid to save")
    is_whole = np.asarray(cells).dtype.kind in "iub"
    picture = Image.fromarray(
        np.ascontiguousarray(cells[::-1], np.int32 if is_whole else np.float32)
    )
    tags = ImageFileDirectory_v2()
    _place(tags, grid)
    _name_frame(tags, layer.frame_id)
    _set(tags, _NO_DATA, TiffTags.ASCII, str(UNKNOWN) if is_whole else "nan")
    if isinstance(layer, ValueLayer):
        _set(tags, _METADATA, TiffTags.ASCII, _described(layer))
    file = io.BytesIO()
    picture.save(file, "TIFF", tiffinfo=tags, compression="tiff_adobe_deflate")
    return file.getvalue()


def _place(tags: ImageFileDirectory_v2, grid: GridGeometry) -> None:
    """Write the transform from pixels to the frame."""
    side = grid.resolution
    ((x, y),) = grid.origin.apply([[0.0, grid.height * side]])
    if grid.origin.yaw == 0:
        _set(tags, _PIXEL_SCALE, TiffTags.DOUBLE, (side, side, 0.0))
        _set(tags, _TIE_POINT, TiffTags.DOUBLE, (0.0, 0.0, 0.0, x, y, 0.0))
        return
    cos, sin = side * np.cos(grid.origin.yaw), side * np.sin(grid.origin.yaw)
    # From (column, row); row 0 is at the top.
    matrix = [[cos, sin, 0, x], [sin, -cos, 0, y], [0, 0, 0, 0], [0, 0, 0, 1]]
    _set(tags, _TRANSFORMATION, TiffTags.DOUBLE, tuple(np.ravel(matrix).tolist()))


def _name_frame(tags: ImageFileDirectory_v2, frame_id: str) -> None:
    text = frame_id.encode("ascii", "replace").decode().replace("|", "?") + "|"
    keys = [
        (_MODEL_TYPE, 0, 1, _USER_DEFINED),
        (_RASTER_TYPE, 0, 1, _PIXEL_IS_AREA),
        (_CITATION, _TEXTS, len(text), 0),
        (_LINEAR_UNITS, 0, 1, _METRE),
    ]
    directory = [1, 1, 0, len(keys), *(number for key in keys for number in key)]
    _set(tags, _KEYS, TiffTags.SHORT, tuple(directory))
    _set(tags, _TEXTS, TiffTags.ASCII, text)


def _described(layer: ValueLayer) -> str:
    """Return the GDAL metadata: unit and description of the band."""
    items = "".join(
        f'<Item name="{name}" sample="0" role="{role}">{escape(text)}</Item>'
        for name, role, text in (
            ("UNITTYPE", "unittype", layer.unit),
            ("DESCRIPTION", "description", layer.quantity),
        )
        if text
    )
    return f"<GDALMetadata>{items}</GDALMetadata>".encode("ascii", "xmlcharrefreplace").decode()


def _set(tags: ImageFileDirectory_v2, number: int, kind: int, value: Any) -> None:
    tags.tagtype[number] = kind
    tags[number] = value
