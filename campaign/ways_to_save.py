"""All ways in which the program saves something that was there before, and how it is read again."""

from __future__ import annotations

import hashlib
import importlib
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from campaign.in_process_port import InProcessPort
from campaign.way import Way
from campaign.ways_of_full_maps import ways_of_full_maps
from hypermap import HypermapError, OccupancyLayer, Pose2D, SemanticLayer, open_map, save_map
from hypermap.core.evidence import EvidenceTable
from hypermap.core.grid import GridGeometry
from hypermap.core.history import MAP_VERSION
from hypermap.core.hypermap import Hypermap
from hypermap.formats.any_file import open_any
from hypermap.formats.store import read_file
from hypermap.perception.detections import Detections
from hypermap.perception.detectors.recorded import RecordedDetections
from hypermap.ros.mapper.saved_files import SavedFiles
from hypermap.testing import square

_SIDE = 24  # cells


def hypermap_of(version: int) -> Hypermap:
    """Return the first or the second version of a map; all its parts differ, also in size."""
    draw = np.random.default_rng(version)
    side = _SIDE + 8 * version
    cells = draw.choice(np.array([-1, 0, 100], np.int8), (side, side))
    grid = OccupancyLayer("occupancy", "map", GridGeometry(side, side, 0.1, Pose2D(x=-1.0)), cells)
    things = [square(f"{version}-{number}", number, version) for number in range(3 + version)]
    layer = SemanticLayer("semantic", "map", things)
    seen: EvidenceTable = importlib.import_module("tests.viewer.seen_map").evidence()
    evidence = replace(
        seen, object_ids=np.minimum(seen.object_ids, 2), stamps=seen.stamps + version
    )
    layer = SemanticLayer("semantic", "map", things, evidence=evidence)
    return Hypermap([grid, layer], metadata={"version": version})


def described(hypermap: Hypermap) -> str:
    """Return all that a map holds, as a short text; but for how often it was saved."""
    metadata = {key: value for key, value in hypermap.metadata.items() if key != MAP_VERSION}
    parts: list[Any] = [sorted(map(str, metadata.items()))]
    for layer in hypermap:
        if isinstance(layer, OccupancyLayer):
            parts += [layer.grid, None if layer.cells is None else layer.cells.tobytes()]
        elif isinstance(layer, SemanticLayer):
            parts += [(item.name, item.id, item.footprint.wkt) for item in layer]
            evidence = layer.evidence()
            parts.append(None if evidence is None else evidence.stamps.tobytes())
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def _bytes(name: str) -> Callable[[Path], str]:
    return lambda folder: hashlib.sha256(read_file(folder / name)).hexdigest()[:16]


def _opened(name: str) -> Callable[[Path], str]:
    return lambda folder: described(open_any(folder / name))


def _converted(name: str, *options: str) -> Callable[[Path, int], object]:
    """Return what `hypermap convert` does, of a map that lies in a folder beside."""

    def save(folder: Path, version: int) -> None:
        from hypermap.cli.main import main

        source = folder.parent / "sources" / f"{version}.hmap"
        try:
            main(["convert", str(source), str(folder / name), "--force", *options])
        except SystemExit as ended:
            if ended.code:
                raise HypermapError("the command said what was wrong") from None

    return save


def write_sources(folder: Path) -> None:
    """Write what `hypermap convert` takes its versions from."""
    folder.mkdir(parents=True, exist_ok=True)
    for version in (0, 1):
        save_map(hypermap_of(version), folder / f"{version}.hmap")


def _save_archive(form: Any, name: str = "map.hmap") -> Callable[[Path, int], object]:
    return lambda folder, version: save_map(hypermap_of(version), folder / name, form)


def _save_on_page(folder: Path, version: int) -> None:
    """Save as the page does: open, change, save; the first version is there without a page."""
    from hypermap.viewer.live.changes import Draft
    from hypermap.viewer.live.document import MapDocument
    from hypermap.viewer.live.editing import apply_operation

    path = folder / "map.hmap"
    if version == 0 or not path.exists():
        save_map(hypermap_of(0), path)
    if version == 0:
        return
    document = MapDocument(path)
    ids = document.current.hypermap.semantic("semantic").ids
    change = {"op": "update", "layer": "semantic", "id": int(ids[0]), "name": "changed"}

    def rename(draft: Draft) -> None:
        apply_operation(draft, change)

    document.edit(document.current.version, rename)
    document.save(overwrite=True)


def _save_on_server(folder: Path, version: int) -> None:
    """Save as a client of the map server has it saved."""
    from hypermap.ros import typestore
    from hypermap.ros.server.map_server import MapServer

    port = InProcessPort(console=False, map_directory=str(folder))
    server = MapServer(port, folder.parent / "sources" / f"{version}.hmap")  # type: ignore[arg-type]
    server.configure()
    server.activate()
    request = typestore.request_class("hypermap_msgs/StoreMap")(filename="map.hmap")
    port.services["store_map"](typestore.encode(request))


def _save_server_at_end(folder: Path, version: int) -> None:
    """Save as the map server does when it ends."""
    from hypermap.ros.server.save_at_end import save_at_end

    path, port = folder / "map.hmap", InProcessPort()
    save_at_end(hypermap_of(version), path, [path], port)  # type: ignore[arg-type]
    if failed := [text for level, text in port.lines if level == "error"]:
        raise HypermapError(failed[0])


def _save_live(folder: Path, version: int) -> None:
    """Save as a live node does at its end."""
    from hypermap.ros.mapper.saving import Saving
    from hypermap.ros.mapper.settings import LiveSettings
    from hypermap.ros.throttle import Throttle

    path, port = folder / "map.hmap", InProcessPort()
    settings = LiveSettings(
        depth_topic="/depth", detections_topic="/boxes", save_to=str(path), save_every=0.0
    )
    log = Throttle(port.log)
    live = _LiveMap(hypermap_of(version))
    saving = Saving(port, settings, live, log)  # type: ignore[arg-type]
    live.state = (1,)
    before, tempfile.tempdir = tempfile.tempdir, str(folder / "none")  # nor elsewhere
    try:
        saving.close()
    finally:
        tempfile.tempdir = before


@dataclass
class _LiveMap:
    """What saving asks of a live map, without a camera; see `LiveMap`."""

    made: Hypermap
    state: tuple[int, ...] = (0,)
    is_new: bool = True
    saves: int = 0
    files: SavedFiles = field(default_factory=lambda: SavedFiles([]))

    def hypermap(self) -> Hypermap:
        return Hypermap([*self.made], metadata={**self.made.metadata, MAP_VERSION: 1})


def _save_detections(folder: Path, version: int) -> None:
    recorded = RecordedDetections((64, 48))
    for stamp in range(20 + version):
        recorded.add(stamp, Detections.of([[1, 2, 30 + version, 40]], [f"cup {version}"]))
    recorded.save(folder / "detections.json")


def _read_detections(folder: Path) -> str:
    recorded = RecordedDetections.load(folder / "detections.json")
    return f"{len(recorded)} of {recorded.at(0.0).names}"


def _save_picture(folder: Path, version: int) -> None:
    from hypermap import render

    render(hypermap_of(version), folder / "map.png")


def _read_folder(folder: Path) -> str:
    return described(open_map(folder / "hmap_config.yaml"))


def ways() -> list[Way]:
    """Return all ways to save; each saves in a folder of its own."""
    config = "hmap_config.yaml"
    return [
        Way("archive", _save_archive("auto"), _opened("map.hmap")),
        Way("archive with GeoParquet", _save_archive("parquet"), _opened("map.hmap")),
        Way("folder", _save_archive("auto", config), _read_folder),
        Way("folder with GeoParquet", _save_archive("parquet", config), _read_folder),
        Way(
            "convert to map_server",
            _converted("map.yaml", "--layer", "occupancy"),
            _opened("map.yaml"),
        ),
        Way("convert to PGM", _converted("map.pgm"), _opened("map.yaml")),
        Way("convert to GeoJSON", _converted("map.geojson"), _opened("map.geojson")),
        Way("convert to GeoParquet", _converted("map.parquet"), _opened("map.parquet")),
        Way("convert to CSV", _converted("map.csv"), _bytes("map.csv")),
        Way(
            "convert to YAML",
            _converted("map.yaml", "--layer", "semantic"),
            _opened("map.yaml"),
        ),
        Way("convert to GeoTIFF", _converted("map.tif"), _bytes("map.tif")),
        Way("convert to MCAP", _converted("map.mcap"), _read_mcap),
        Way("the page", _save_on_page, _opened("map.hmap")),
        Way("the map server's service", _save_on_server, _opened("map.hmap")),
        Way("the map server's end", _save_server_at_end, _opened("map.hmap")),
        Way("the live node's end", _save_live, _opened("map.hmap")),
        Way("detections", _save_detections, _read_detections),
        Way("picture", _save_picture, _bytes("map.png")),
        *ways_of_full_maps(),
    ]


def _read_mcap(folder: Path) -> str:
    """Return how large a log is, which has a beginning and an end; its stamps differ."""
    content = read_file(folder / "map.mcap")
    magic = b"\x89MCAP0\r\n"
    if not (content.startswith(magic) and content.endswith(magic)):
        raise HypermapError("the log is not whole")
    return f"{len(content) // 256}"
