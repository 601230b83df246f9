"""Occupancy maps of ROS' map_server: a YAML file beside a picture.

The specification is docs/formats/hmap.md. Only this module knows that row 0 of a picture is the
top of the map.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import RESOLUTIONS, GridGeometry
from hypermap.core.layer import Store
from hypermap.core.occupancy import UNKNOWN, OccupancyLayer
from hypermap.formats import limits
from hypermap.formats.checked import Checked, Finite, Pose, Text, check
from hypermap.formats.pictures import GreyPicture, decode_grey, encode_png
from hypermap.formats.store import read_file
from hypermap.formats.yaml_text import read_yaml, write_yaml

Cells = NDArray[np.int8] | NDArray[np.int16]
_Fraction = Annotated[float, Field(ge=0, le=1)]


class MapYaml(Checked):
    """What a map_server YAML file says about its picture."""

    image: Text
    resolution: Annotated[Finite, Field(ge=RESOLUTIONS[0], le=RESOLUTIONS[1])]
    origin: Pose
    negate: bool = False
    occupied_thresh: _Fraction
    free_thresh: _Fraction
    mode: Literal["trinary", "scale", "raw"] = "trinary"

    @model_validator(mode="after")
    def _thresholds_are_in_order(self) -> MapYaml:
        if self.free_thresh > self.occupied_thresh or (
            self.mode == "scale" and self.free_thresh == self.occupied_thresh
        ):
            raise ValueError(
                f"free_thresh ({self.free_thresh}) must lie below "
                f"occupied_thresh ({self.occupied_thresh})"
            )
        return self


class OccupancyFiles:
    """How occupancy layers are kept: `file` NAME means NAME.yaml and the picture it names."""

    def empty(self, name: str, frame_id: str, settings: Mapping[str, Any]) -> OccupancyLayer:
        """Return a layer without cells."""
        return OccupancyLayer(name, frame_id, settings=settings)

    def load(
        self, store: Store, file: str, name: str, frame_id: str, settings: Mapping[str, Any]
    ) -> OccupancyLayer:
        """Return the layer.

        Raises:
            FormatError: If the YAML or its picture is missing or wrong.
        """
        yaml_name = f"{file}.yaml"
        described = parse_map_yaml(store.read(yaml_name), store.path_of(yaml_name))
        image = str(PurePosixPath(file).parent / described.image)
        picture = decode_grey(store.read(image), store.path_of(image))
        return _layer(described, picture, name, frame_id, settings)

    def save(self, layer: OccupancyLayer, store: Store, file: str) -> None:
        """Write the YAML and a PNG picture; a layer without cells needs none.

        Values from 0 to 100 are written in the mode `scale`. Where there are others, the mode is
        `raw`, and unknown cells are white beneath their transparency: old readers, which do not
        look at it in this mode, take a signed 255 for -1.

        Raises:
            HypermapError: If the grid has too many cells.
        """
        if layer.grid is None or layer.cells is None:
            return
        grey_alpha, mode = _grey_alpha(layer.cells, layer.name)
        origin = layer.grid.origin
        described = {
            "image": f"{PurePosixPath(file).name}.png",
            "resolution": layer.grid.resolution,
            "origin": [origin.x, origin.y, origin.yaw],
            "negate": 0,
            "occupied_thresh": 1,
            "free_thresh": 0,
            "mode": mode,
        }
        store.write(f"{file}.yaml", write_yaml(described))
        store.write(f"{file}.png", encode_png(grey_alpha))


PLUGIN = OccupancyFiles()


def load_occupancy(
    path: str | Path, name: str = "occupancy", frame_id: str = "map"
) -> OccupancyLayer:
    """Return the map of a map_server YAML file on the disk.

    Its picture may lie anywhere, as map_server allows: relative to the YAML file, or absolute.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it or its picture is wrong, or the picture is missing.
    """
    path = Path(path)
    described = parse_map_yaml(read_file(path), str(path))
    image = path.parent / described.image
    if not image.is_file():
        raise FormatError(f"there is no picture {image}", path=path, key="image")
    picture = decode_grey(read_file(image), str(image))
    return _layer(described, picture, name, frame_id, {"file": path.stem})


def parse_map_yaml(content: bytes, path: str) -> MapYaml:
    """Return what a map_server YAML file says.

    Raises:
        FormatError: Naming the key that is wrong or missing.
    """
    return check(MapYaml, read_yaml(content, path, {("image",), ("mode",)}), path)


def cells_from_picture(picture: GreyPicture, described: MapYaml) -> Cells:
    """Return the cells, row 0 at the bottom; int16 where a raw picture has values above 100.

    Source: ROS' map_server, image_loader.cpp, with a range of 100 where that has 99.
    """
    cells: Cells = _cell_of_value(picture.white, described)[picture.values[::-1]]
    if picture.opaque is not None:
        cells[~picture.opaque[::-1]] = UNKNOWN
    if cells.dtype == np.int16 and cells.max() <= 100:
        return cells.astype(np.int8)
    return cells


def _cell_of_value(white: int, described: MapYaml) -> Cells:
    """Return the cell for each grey value from 0 to `white`."""
    c = np.arange(white + 1) * 255 / white
    if described.negate:
        c = 255 - c
    if described.mode == "raw":
        return c.astype(np.int16)
    p = (255 - c) / 255
    free, occupied = described.free_thresh, described.occupied_thresh
    if described.mode == "scale":
        between = np.rint(100 * (p - free) / (occupied - free))
    else:
        between = np.full_like(p, UNKNOWN)
    return np.where(p > occupied, 100, np.where(p < free, 0, between)).astype(np.int8)


def _grey_alpha(cells: Cells, layer_name: str) -> tuple[NDArray[np.uint8], str]:
    """Return a picture of the cells, row 0 at the top, and the mode in which to read it."""
    if cells.size > limits.MAX_PIXELS:
        raise HypermapError(
            f"layer {layer_name!r} has {cells.size} cells, more than the {limits.MAX_PIXELS} "
            "that a file may hold"
        )
    values = np.arange(256)
    table = np.zeros((257, 2), np.uint8)  # row 0 is the unknown cell's
    if cells.max() > 100:
        mode = "raw"
        table[1:, 0] = values
        table[0, 0] = 255
    else:
        mode = "scale"
        table[1:102, 0] = 255 - np.rint(values[:101] * 2.55)
        table[0, 0] = 205  # what map_server draws for unknown
    table[1:, 1] = 255
    return table[cells[::-1].astype(np.int16) + 1], mode


def _layer(
    described: MapYaml, picture: GreyPicture, name: str, frame_id: str, settings: Mapping[str, Any]
) -> OccupancyLayer:
    height, width = picture.values.shape
    grid = GridGeometry(width, height, described.resolution, Pose2D(*described.origin))
    return OccupancyLayer(name, frame_id, grid, cells_from_picture(picture, described), settings)
