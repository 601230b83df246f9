"""Maps and single layers from files of every supported kind."""

from __future__ import annotations

from pathlib import Path

from hypermap.core.errors import NOT_UTF8, FormatError, HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.layer_stack import DEFAULT_FRAME
from hypermap.core.semantic import SemanticLayer
from hypermap.formats.atomic import is_folder
from hypermap.formats.columns.geoparquet import MAGIC
from hypermap.formats.grid.map_server import load_occupancy, refuse_picture
from hypermap.formats.hmap import open_map
from hypermap.formats.semantic.geojson import from_geojson
from hypermap.formats.semantic.parquet_files import layer_of_parquet
from hypermap.formats.semantic.yaml_files import parse_content
from hypermap.formats.store import read_file
from hypermap.formats.yaml_text import read_yaml
from hypermap.text import is_address

JSON_ENDINGS = {".geojson", ".json"}
_ONLY_WRITTEN = {".csv", ".gpkg", ".tif", ".tiff", ".rrd", ".mcap"}
_ZIP = b"PK"


def open_any(path: Path, frame_id: str | None = None) -> Hypermap:
    """Return the map in a file of any kind; a file of one layer becomes a map of one layer.

    Args:
        path: a file or an address for `open_map`, a YAML list of objects, GeoJSON or GeoParquet.
        frame_id: the frame of a file of one layer; None takes that in the file, or `map` for YAML.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it is damaged, of a kind that cannot be read, or does not say its frame.
        MissingExtra: If it is GeoParquet, and pyarrow is not installed.
        HypermapError: If a frame is given for a whole map, which has its own.
    """
    layer = None if is_address(path) else _only_layer(path, frame_id)
    if layer is not None:
        return Hypermap([layer])
    if frame_id is not None:
        raise HypermapError(f"{path}: a whole map names its own frames; leave out --frame")
    return open_map(path)


def _only_layer(path: Path, frame_id: str | None) -> Layer | None:
    """Return the layer in a file of one layer; None if it may be a whole map."""
    content = _ZIP if is_folder(path) else read_file(path)
    refuse_picture(path)
    if path.suffix.lower() in _ONLY_WRITTEN:
        raise FormatError(
            f"{path.suffix} files can be written, but not read as maps; make objects of them in "
            "Python, or GeoJSON of polygons",
            path=path,
        )
    if content.startswith(MAGIC):
        return layer_of_parquet(content, str(path), frame_id)
    if path.suffix.lower() in JSON_ENDINGS:
        try:
            text = content.decode()
        except UnicodeDecodeError:
            raise FormatError(NOT_UTF8, path=path) from None
        return from_geojson(text, frame_id=frame_id, path=str(path))
    if path.suffix.lower() != ".hmap" and not content.startswith(_ZIP):
        document, frame = read_yaml(content, str(path)), frame_id or DEFAULT_FRAME
        if isinstance(document, list):
            table, rejected = parse_content(content, str(path))
            return SemanticLayer.of_table("semantic", frame, table, rejected=rejected)
        if isinstance(document, dict) and "image" in document:
            return load_occupancy(path, frame_id=frame)
    return None
