"""Files of maps: archives, folders, pictures, objects and their evidence."""

from __future__ import annotations

import contextlib
import gzip
import io
import random
import shutil
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from campaign.full_map import full_map
from campaign.fuzz_targets.target import (
    Target,
    a_map,
    a_small_map,
    draw_of,
    of_tests,
    target_of_files,
)
from campaign.mutation import (
    Mutator,
    mutate_archive,
    mutate_bytes,
    mutate_json,
    mutate_parquet,
    mutate_png,
    mutate_text,
)
from campaign.questions import ask_everything
from hypermap import (
    HypermapError,
    OccupancyLayer,
    SemanticLayer,
    SemanticObject,
    open_map,
    save_map,
    to_geojson,
)
from hypermap.console.places import parse_area, parse_point
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.samples import Samples
from hypermap.core.value_layer import ValueLayer
from hypermap.formats.any_file import open_any
from hypermap.formats.columns.footprints import footprint_from_wkt
from hypermap.formats.config import CONFIG_NAME
from hypermap.formats.grid.pgm import dump_trinary
from hypermap.formats.hmap import _write_map  # the files of an archive, without the archive
from hypermap.formats.semantic.evidence_file import dump_evidence, parse_evidence
from hypermap.formats.semantic.parquet_files import dump_parquet
from hypermap.formats.semantic.yaml_files import SemanticForm, dump_objects
from hypermap.testing import square

_MANY = 30_000_000  # cells, of which one answer takes long enough


def _folder_of_map(folder: Path) -> dict[str, bytes]:
    """Return the files of a map that lies in a folder."""
    folder.mkdir()
    save_map(a_map(), folder / "map.yaml")
    files = {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
    shutil.rmtree(folder)
    return files


def _open_and_ask(path: Path, data: bytes, *, saves: bool = False) -> None:
    hypermap = open_any(path)
    ask_everything(hypermap, draw_of(data))
    if saves and _cells(hypermap) < _MANY:  # what opened can be saved, and opened again
        again = path.with_name("again.hmap")
        save_map(hypermap, again)
        open_map(again)


def _cells(hypermap: Hypermap) -> int:
    grids = (layer.cells for layer in hypermap if isinstance(layer, OccupancyLayer))
    return sum(cells.size for cells in grids if cells is not None)


def _ask_of_folder(folder: Path, data: bytes) -> None:
    _open_and_ask(folder / "map.yaml", data)


def _file_target(name: str, corpus: Sequence[bytes], mutate: Mutator, folder: Path) -> Target:
    path = folder / name

    def ask(data: bytes) -> None:
        path.write_bytes(data)
        _open_and_ask(path, data, saves=True)

    return Target(ask, corpus, mutate)


def archive(folder: Path) -> Target:
    """A whole map in an archive, of which all questions are asked."""
    path, corpus = folder / "example.hmap", []
    forms: tuple[SemanticForm, ...] = ("auto", "parquet", "yaml")
    for made, form in zip((a_map(), full_map(), a_small_map()), forms, strict=True):
        save_map(made, path, form)
        corpus.append(path.read_bytes())
    return _file_target("map.hmap", corpus, mutate_archive, folder)


def config(folder: Path) -> Target:
    """A map in a folder: the configuration and all that it names."""
    return target_of_files(_folder_of_map(folder / "made"), _ask_of_folder, folder)


def map_server(folder: Path) -> Target:
    """A map of ROS: YAML and a PGM picture."""
    layer = a_small_map().occupancy()
    return target_of_files(dump_trinary(layer, "map"), _ask_of_folder, folder)


def png(folder: Path) -> Target:
    """The picture of an occupancy layer, in each of the kinds that are read."""
    parts = _folder_of_map(folder / "made")
    described = next(c for n, c in parts.items() if n.endswith(".yaml") and b"image:" in c)
    lines = [line for line in described.splitlines() if not line.startswith(b"image:")]
    path = folder / "map.yaml"
    path.write_bytes(b"\n".join([b"image: picture", *lines]))

    def ask(data: bytes) -> None:
        (folder / "picture").write_bytes(data)
        _open_and_ask(path, data)

    ours = next(content for name, content in parts.items() if name.endswith(".png"))
    return Target(ask, [ours, *_pictures()], mutate_png)


def _pictures() -> Iterator[bytes]:
    """Yield a small gray picture in many forms."""
    gray = Image.fromarray(np.arange(48, dtype=np.uint8).reshape(6, 8) * 5)
    forms = [(mode, "PNG") for mode in ("L", "LA", "P", "1", "RGBA")]
    forms += [("L", kind) for kind in ("PPM", "BMP", "GIF", "TGA", "TIFF", "JPEG")]
    for mode, kind in forms:
        written = io.BytesIO()
        gray.convert(mode).save(written, kind)
        yield written.getvalue()


def semantic_yaml(folder: Path) -> Target:
    """A list of objects in YAML."""
    layers = a_small_map().semantic("things"), a_map().semantic("semantic")
    corpus = [dump_objects(layer) for layer in layers]
    return _file_target("objects.yaml", corpus, mutate_text, folder)


def geojson(folder: Path) -> Target:
    """Objects in GeoJSON."""
    corpus = [to_geojson(a_small_map().semantic("things")).encode()]
    return _file_target("objects.geojson", corpus, mutate_json, folder)


def geoparquet(folder: Path) -> Target:
    """Objects in GeoParquet."""
    corpus = [dump_parquet(a_small_map().semantic("things").table, "map")]
    return _file_target("objects.parquet", corpus, mutate_parquet, folder)


def wkt(_: Path) -> Target:
    """A shape as text, in a file and at the console."""
    texts = [item.footprint.wkt for item in a_small_map().semantic("things")]
    texts += ["POLYGON((0 0, 1 0, 1 1))", "MULTIPOLYGON(((0 0,1 0,1 1,0 0)),((5 5,6 5,6 6,5 5)))"]
    texts += ["1,2,3,4", "0,0,1,0,1,1", "POLYGON Z((0 0 0,1 0 0,1 1 0,0 0 0))", "POINT(1 2)"]

    def ask(data: bytes) -> None:
        text = data.decode(errors="surrogateescape")
        hypermap = Hypermap([SemanticLayer("semantic", "map", [square("cup", 0, 0)])])
        if (thing := _thing_of(text)) is not None:
            hypermap.semantic("semantic").add(thing)
            ask_everything(hypermap, draw_of(data))
        with contextlib.suppress(HypermapError):
            parse_point(text, "--at")
        area = parse_area(text, "--in")
        hypermap.labels_in("semantic", area)
        hypermap.objects(inside=area, near=area)

    return Target(ask, [text.encode() for text in texts], mutate_text)


def _thing_of(text: str) -> SemanticObject | None:
    """Return an object of a shape that is given as text; None if it is none."""
    try:
        return SemanticObject("thing", footprint_from_wkt(text))
    except (ValueError, TypeError):  # as they say
        return None


def evidence(folder: Path) -> Target:
    """What objects were made of, alone and behind the objects of a map."""
    packed = dump_evidence(of_tests("viewer.seen_map").evidence())
    members = _write_map(a_map(), CONFIG_NAME, "auto").files
    name = next(name for name, content in members.items() if content == packed)
    path = folder / "map.hmap"

    def ask(data: bytes) -> None:
        with contextlib.suppress(HypermapError):
            parse_evidence(data, "evidence")
        with zipfile.ZipFile(path, "w") as archive:
            for member, content in {**members, name: data}.items():
                archive.writestr(member, content)
        _open_and_ask(path, data, saves=True)

    return Target(ask, [packed], _mutate_packed)


def values(folder: Path) -> Target:
    """A layer of measured values: its arrays, and what is said of them."""
    layer = ValueLayer(
        "warmth",
        "map",
        GridGeometry(3, 2, 0.5),
        [[19.5, 20, 21], [22, np.nan, 18]],
        "°C",
        deviations=np.ones((2, 3)),
        stamps=np.full((2, 3), 1e9),
        samples=Samples.of([[0.2, 0.3], [1, 0.5]], [19.6, 22], [False, True], [1e9, np.nan]),
        made_by={"method": "gmrf", "length": 2.5},
    )
    save_map(Hypermap([layer]), folder / "map.yaml")
    parts = {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
    return target_of_files(parts, _ask_of_folder, folder)


def _mutate_packed(data: bytes, draw: random.Random) -> bytes:
    """Spoil what is within gzip, or the gzip itself."""
    if data[:2] == b"\x1f\x8b" and draw.random() < 0.8:
        with contextlib.suppress(OSError, EOFError, ValueError):
            return gzip.compress(mutate_text(gzip.decompress(data), draw), mtime=0)
    return mutate_text(data, draw) if data[:1] == b"{" else mutate_bytes(data, draw)
