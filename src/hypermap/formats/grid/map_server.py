"""The plug-in of occupancy layers: maps of ROS' map_server, a YAML file next to an image.

The specification is docs/formats/hmap.md. Only this module knows that row 0 of a picture is the
top of the map.
"""

from __future__ import annotations

import glob
import logging
import math
import os
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import RESOLUTIONS, GridGeometry
from hypermap.core.layer import Store
from hypermap.core.occupancy import UNKNOWN, OccupancyLayer
from hypermap.formats.checked import Checked, Finite, Pose, Text, check
from hypermap.formats.grid.budget import SETTING, check_cells, max_cells
from hypermap.formats.grid.png import (
    band_rows,
    decode_gray_alpha,
    encode_gray_alpha,
    gray_alpha_size,
)
from hypermap.formats.journal import read_as_saved
from hypermap.formats.store import read_file
from hypermap.formats.yaml_text import read_yaml, write_yaml

if TYPE_CHECKING:
    from hypermap.formats.grid.pictures import GrayBand

Cells = NDArray[np.int8] | NDArray[np.int16]
_Fraction = Annotated[float, Field(ge=0, le=1)]
_PICTURES = (".pgm", ".png", ".bmp")
_UNKNOWN_GRAY = 205  # what map_saver draws for unknown

logger = logging.getLogger(__name__)


class MapYaml(Checked):
    """The content of a map_server YAML file: how to read its image."""

    image: Text
    resolution: Annotated[Finite, Field(ge=RESOLUTIONS[0], le=RESOLUTIONS[1])]
    origin: Pose
    negate: bool = False
    occupied_thresh: _Fraction = 0.65
    free_thresh: _Fraction = 0.196
    mode: Literal["trinary", "scale", "raw"] = "trinary"

    @model_validator(mode="after")
    def _thresholds_are_in_order(self) -> MapYaml:
        if self.free_thresh > self.occupied_thresh or (
            self.mode == "scale" and self.free_thresh == self.occupied_thresh
        ):
            raise ValueError(
                f"free_thresh ({self.free_thresh}) must be below "
                f"occupied_thresh ({self.occupied_thresh})"
            )
        return self


class OccupancyFiles:
    """The files of occupancy layers: `file` NAME means NAME.yaml and the image it names."""

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
        cells = cells_from_file(store.read(image), store.path_of(image), described)
        return _layer(described, cells, name, frame_id, settings)

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
        mode = _mode(layer.cells, layer.name)
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
        height, width = layer.cells.shape
        store.write(f"{file}.png", encode_gray_alpha(width, height, _bands(layer.cells, mode)))


PLUGIN = OccupancyFiles()


def load_occupancy(
    path: str | Path, name: str = "occupancy", frame_id: str = "map"
) -> OccupancyLayer:
    """Return the map of a map_server YAML file on the disk.

    Like map_server, this accepts any image path: relative to the YAML file, or absolute. Where it
    leads nowhere, the picture of that name beside the YAML file is taken, with a warning.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it or its picture is wrong, or the picture is missing.
    """
    path = Path(path)
    return read_as_saved(path, lambda: _read_occupancy(path, name, frame_id))


def parse_map_yaml(content: bytes, path: str) -> MapYaml:
    """Return the content of a map_server YAML file.

    Raises:
        FormatError: Naming the key that is wrong or missing.
    """
    return check(MapYaml, read_yaml(content, path, {("image",), ("mode",)}), path)


def refuse_picture(path: Path) -> None:
    """Make sure that a file is not the picture of a map, by its name.

    Raises:
        FormatError: If it is.
    """
    if path.suffix.lower() in _PICTURES:
        raise FormatError("is a picture; give the map_server YAML file that names it", path=path)


def _read_occupancy(path: Path, name: str, frame_id: str) -> OccupancyLayer:
    content = read_file(path)
    refuse_picture(path)
    if content.startswith(b"PK"):
        raise FormatError(
            "is an archive, not a map_server YAML file; for a hypermap's occupancy layer as such a "
            "file: hypermap convert MAP.hmap map.yaml --layer occupancy",
            path=path,
        )
    described = parse_map_yaml(content, str(path))
    image = _picture_of(path, described.image)
    try:
        content = read_file(image)
    except FileMissing:
        hint = _pictures_beside(path)
        raise FormatError(f"there is no picture {image}{hint}", path=path, key="image") from None
    except FormatError as error:  # a folder, a device or too large
        raise FormatError(str(error), path=path, key="image") from None
    cells = cells_from_file(content, str(image), described)
    return _layer(described, cells, name, frame_id, {"file": path.stem})


def _picture_of(path: Path, image: str) -> Path:
    """Return the picture's path; that beside the YAML file where the path it names leads nowhere.

    map_saver writes the path that it was given: a folder of the robot, or one from where it ran.
    """
    named = path.parent / image
    beside = path.parent / Path(image).name
    if os.path.lexists(named) or not os.path.lexists(beside):
        return named
    logger.warning("%s: image: there is no %s; %s is taken, which lies here", path, image, beside)
    return beside


def _pictures_beside(path: Path) -> str:
    """Return a hint at pictures that are named like the YAML file."""
    named_alike = path.parent.glob(f"{glob.escape(path.stem)}.*")
    names = [each.name for each in named_alike if each.suffix in _PICTURES]
    return f"; there is {min(names)}" if names else ""


def cells_from_file(content: bytes, path: str, described: MapYaml) -> Cells:
    """Return the cells of a picture file, row 0 at the bottom.

    Args:
        content: the file; of one that `save` has written, only a few rows are unpacked at a time.
        path: how messages name it.
        described: how to read it.

    Raises:
        FormatError: If it is not a picture, is damaged, or has more pixels than are allowed.
    """
    _warn_of_degrees(described.origin[2], path)
    _warn_of_missing_thresholds(described, path)
    size = gray_alpha_size(content)
    if size is not None:
        check_cells(size[0] * size[1], f"{size[0]} x {size[1]} cells", path)
        try:
            return _cells_from_bands(*size, decode_gray_alpha(content, *size), described)
        except (ValueError, zlib.error):  # Pillow reads more, and says what is wrong
            pass
    from hypermap.formats.grid.pictures import decode_gray  # with Pillow, which few maps need

    cells, unknown = _cells_from_picture(decode_gray(content, path), described)
    _warn_of_unknown_as_free(unknown, described, path)
    return cells


def _warn_of_missing_thresholds(described: MapYaml, path: str) -> None:
    for key in ("occupied_thresh", "free_thresh"):
        if key not in described.model_fields_set:
            value = getattr(described, key)
            logger.warning(
                "%s: its YAML file has no %s; taken as %g, as in maps of map_saver",
                path,
                key,
                value,
            )


def _warn_of_degrees(yaw: float, path: str) -> None:
    """Warn of a yaw that is more than a whole turn in radians."""
    if abs(yaw) > 2 * math.pi:
        logger.warning(
            "%s: the map is turned by %g radians, the yaw of its origin; if these are degrees, "
            "set it to %.4f",
            path,
            yaw,
            math.radians(yaw),
        )


def _warn_of_unknown_as_free(count: int, described: MapYaml, path: str) -> None:
    """Warn if the cells that map_saver draws as unknown are free, as in map_server itself.

    Nav2's map_saver writes them with a gray of 205 and, by default, a free_thresh of 0.25.
    """
    if described.mode != "trinary" or described.negate:
        return
    if count and described.free_thresh > (255 - _UNKNOWN_GRAY) / 255:
        logger.warning(
            "%s: %d cells with the gray %d are free, because free_thresh is %g; map_saver writes "
            "unknown cells with this gray; if they are unknown, set free_thresh to 0.196",
            path,
            count,
            _UNKNOWN_GRAY,
            described.free_thresh,
        )


def _cells_from_picture(bands: Iterable[GrayBand], described: MapYaml) -> tuple[Cells, int]:
    """Return the cells, row 0 at the bottom; int16 where a raw picture has values above 100.

    Also return how many pixels have the gray of map_saver's unknown cells.

    Source: ROS' map_server, image_loader.cpp, with a range of 100 where that has 99.
    """
    unknown = 0
    for band in bands:
        if band.top == 0:
            of_value = _cell_of_value(band.white, described)
            cells: Cells = np.empty((band.height, band.values.shape[1]), of_value.dtype)
        rows = cells[::-1][band.top : band.top + len(band.values)]
        rows[:] = of_value[band.values]
        if band.opaque is not None:
            rows[~band.opaque] = UNKNOWN
        unknown += int(np.count_nonzero(band.values == _UNKNOWN_GRAY * band.white // 255))
    return _narrowed(cells), unknown


def _cells_from_bands(
    width: int, height: int, bands: Iterable[NDArray[np.uint8]], described: MapYaml
) -> Cells:
    of_gray = _cell_of_value(255, described)
    of_pair = np.full(1 << 16, UNKNOWN, of_gray.dtype)  # gray and above it alpha
    of_pair[0xFF00:] = of_gray
    cells: Cells = np.empty((height, width), of_gray.dtype)
    top = height
    for band in bands:
        cells[top - len(band) : top] = of_pair[band.view("<u2")[::-1, :, 0]]
        top -= len(band)
    return _narrowed(cells)


def _narrowed(cells: Cells) -> Cells:
    if cells.dtype == np.int16 and cells.max() <= 100:
        return cells.astype(np.int8)
    return cells


def _cell_of_value(white: int, described: MapYaml) -> Cells:
    """Return the cell for each gray value from 0 to `white`."""
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


def _mode(cells: Cells, layer_name: str) -> str:
    """Return the mode in which to read a picture of the cells."""
    if cells.size > max_cells():
        raise HypermapError(
            f"layer {layer_name!r} has {cells.size} cells, more than the {max_cells()} that can be "
            f"opened again; to save and to open it, set {SETTING}={cells.size} in the environment"
        )
    return "raw" if cells.max() > 100 else "scale"


def _bands(cells: Cells, mode: str) -> Iterator[NDArray[np.uint8]]:
    """Yield a picture's rows from the top: gray and alpha of the cells, whose row 0 is below."""
    table = np.zeros((257, 2), np.uint8)  # the last row is the unknown cell's, at index -1
    table[:256, 1] = 255
    if mode == "raw":
        table[:256, 0] = np.arange(256)
        table[-1, 0] = 255
    else:
        table[:101, 0] = 255 - np.rint(np.arange(101) * 2.55)
        table[-1, 0] = _UNKNOWN_GRAY
    of_cell = table.view(np.uint16)[:, 0]
    height, width = cells.shape
    rows = band_rows(width)
    for top in range(height, 0, -rows):
        band = of_cell[cells[max(top - rows, 0) : top][::-1]]
        yield band.view(np.uint8).reshape(len(band), width, 2)


def _layer(
    described: MapYaml, cells: Cells, name: str, frame_id: str, settings: Mapping[str, Any]
) -> OccupancyLayer:
    height, width = cells.shape
    grid = GridGeometry(width, height, described.resolution, Pose2D(*described.origin))
    return OccupancyLayer(name, frame_id, grid, cells, settings)
