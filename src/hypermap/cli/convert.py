"""`hypermap convert`: convert a map, or one of its layers, to another format."""

from __future__ import annotations

import contextlib
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from hypermap.cli.mask_options import Keepout, MaskResolution, Speed, save_mask
from hypermap.cli.options import Force, OnlyLayers, check_output, title_of
from hypermap.cli.robot_options import InflationRadius, RobotRadius
from hypermap.cli.route_options import AsRouteGraph, save_route_graph
from hypermap.cli.saving import save_from
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.layer import Layer
    from hypermap.core.semantic import SemanticLayer
    from hypermap.formats.semantic.yaml_files import SemanticForm

    L = TypeVar("L", bound=Layer)

_YAML = {".yaml"}
_PARQUET = {".parquet"}
_OBJECTS = {".geojson", ".json", *_PARQUET, ".csv", ".gpkg"}
_GEOTIFF = {".tif", ".tiff"}
_LOGS = {".rrd", ".mcap"}


class Form(str, Enum):
    """How semantic layers are kept, as `save_map` knows it."""

    AUTO = "auto"
    YAML = "yaml"
    PARQUET = "parquet"


def command(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="IN",
            readable=False,
            show_default=False,
            help="An .hmap archive, a configuration or its folder, a map_server YAML, a GeoJSON "
            "or GeoParquet file, or a YAML list of objects.",
        ),
    ],
    target: Annotated[
        Path,
        typer.Argument(metavar="OUT", show_default=False, help="The new file or folder."),
    ],
    layers: OnlyLayers = None,
    frame_id: Annotated[
        str | None,
        typer.Option(
            "--frame",
            metavar="FRAME",
            help="Frame of the coordinates: if IN does not name it.",
        ),
    ] = None,
    semantic: Annotated[
        Form,
        typer.Option(
            "--semantic",
            help="Format of the objects in a whole map: yaml (readable by all "
            "programs), parquet (faster), or auto (parquet from 100,000 objects "
            "on).",
        ),
    ] = Form.AUTO,
    keepout: Keepout = None,
    speed: Speed = None,
    mask_resolution: MaskResolution = None,
    route_graph: AsRouteGraph = False,
    robot_radius: RobotRadius = None,
    inflation_radius: InflationRadius = None,
    force: Force = False,
) -> None:
    """Convert a map, or one of its layers, to another format, chosen by the extension of OUT.

    .hmap and a folder (a name without an extension) store whole maps. .geojson, .parquet, .gpkg and
    .csv store the objects of one layer, in meters; .csv also stores measured values, with --layer.
    .yaml stores one layer: a map_server map with its picture, or a list of objects. .pgm stores a
    grid like map_saver, for old programs: free, occupied or unknown, with a YAML file; .tif stores
    it as GeoTIFF. .rrd is a log for Rerun, .mcap for Foxglove and Lichtblick. The command lists on
    standard error what OUT cannot store.

    Examples:
        hypermap convert lab.hmap lab
        hypermap convert lab edited.hmap
        hypermap convert lab.hmap objects.geojson
        hypermap convert lab.hmap map.yaml --layer occupancy
        hypermap convert lab.hmap map.pgm
        hypermap convert lab.hmap objects.csv
        hypermap convert lab.hmap warmth.csv --layer temperature
        hypermap convert lab.hmap keepout.yaml --keepout "table 0.3" --keepout "chair 0.2"
        hypermap convert rooms.hmap routes.geojson --route-graph --robot-radius 0.3
        hypermap convert lab.hmap faster.hmap --semantic parquet
        hypermap convert objects.geojson objects.hmap --frame map
        hypermap convert lab.hmap lab.rrd
    """
    from hypermap.formats.any_file import open_any

    hypermap = _chosen(open_any(source, frame_id), layers)
    if route_graph or robot_radius is not None or inflation_radius is not None:
        if not route_graph or speed or mask_resolution is not None:
            raise HypermapError(
                "--robot-radius and --inflation-radius are for --route-graph, and --speed and "
                "--mask-resolution for a mask; one file cannot be both"
            )
        save_route_graph(hypermap, target, robot_radius, inflation_radius, keepout or [], force)
    elif keepout or speed or mask_resolution is not None:
        save_mask(hypermap, target, keepout or [], speed or [], mask_resolution, force)
    elif target.suffix.lower() == ".hmap":
        check_output(target, force)
        save_from(hypermap, source, target, semantic.value)
    elif target.suffix.lower() == ".csv" and _has_values_alone(hypermap):
        _save_values(hypermap, target, force)
    elif target.suffix.lower() in _OBJECTS:
        _save_objects(hypermap, target, force)
    elif target.suffix.lower() == ".pgm":
        _save_pgm(hypermap, target, force)
    elif target.suffix.lower() in _GEOTIFF:
        _save_geotiff(hypermap, target, force)
    elif target.suffix.lower() in _YAML:
        _save_yaml(hypermap, target, force)
    elif target.suffix.lower() in _LOGS:
        _save_log(hypermap, source, target, force)
    elif target.suffix == "" or target.is_dir():
        _save_folder(hypermap, source, target, semantic.value, force)
    else:
        raise HypermapError(
            f"{target}: unknown file extension {target.suffix!r}; known: .hmap, .geojson, "
            ".parquet, .gpkg, .csv, .yaml, .pgm, .tif, .rrd, .mcap, or none for a folder"
        )
    note(f"saved {target}")


def _chosen(hypermap: Hypermap, names: list[str] | None) -> Hypermap:
    """Return the map with only the layers of these names; None for all."""
    if not names:
        return hypermap
    layers = [hypermap[name] for name in dict.fromkeys(names)]
    return hypermap.with_layers(layers)


def _save_folder(
    hypermap: Hypermap, source: Path, target: Path, semantic: SemanticForm, force: bool
) -> None:
    if str(target) == "-":
        raise HypermapError("maps are not written to standard output; name a file or a folder")
    if target.exists() and not target.is_dir():
        raise HypermapError(f"{target}: this is a file; a name without an ending means a folder")
    if target.is_dir() and any(target.iterdir()) and not force:
        raise HypermapError(f"{target}: the folder is not empty; give --force to write into it")
    target.mkdir(parents=True, exist_ok=True)
    try:
        save_from(hypermap, source, target / "hmap_config.yaml", semantic)
    except HypermapError:
        with contextlib.suppress(OSError):  # it was there before, and holds something
            target.rmdir()
        raise


def _has_values_alone(hypermap: Hypermap) -> bool:
    """Return whether a map has measured values and no objects."""
    from hypermap.core.semantic import SemanticLayer
    from hypermap.core.value_layer import ValueLayer

    kinds = [type(layer) for layer in hypermap]
    return ValueLayer in kinds and SemanticLayer not in kinds


def _save_values(hypermap: Hypermap, target: Path, force: bool) -> None:
    from hypermap.core.value_layer import ValueLayer
    from hypermap.formats.atomic import write_file
    from hypermap.formats.grid.value_table import to_csv

    check_output(target, force)
    layer = _only_one(hypermap, (ValueLayer,), f"{target} can hold the values of one layer")
    write_file(target, to_csv(layer).encode())
    _say_what_is_lost(hypermap, layer)


def _save_objects(hypermap: Hypermap, target: Path, force: bool) -> None:
    from hypermap.core.semantic import SemanticLayer
    from hypermap.formats.atomic import write_file

    check_output(target, force)
    layer = _only_one(hypermap, (SemanticLayer,), f"{target} can hold the objects of one layer")
    write_file(target, _dump_objects(layer, target.suffix.lower()))
    _say_what_is_lost(hypermap, layer)
    if layer.rejected and target.suffix.lower() not in _PARQUET:
        unread = counted(len(layer.rejected), "object")
        note(f"left out: {unread} that could not be read")


def _dump_objects(layer: SemanticLayer, ending: str) -> bytes:
    if ending in {".geojson", ".json"}:
        from hypermap.formats.semantic.geojson import to_geojson

        return to_geojson(layer).encode()
    if ending == ".csv":
        from hypermap.formats.semantic.csv_table import to_csv

        return to_csv(layer).encode()
    if ending == ".gpkg":
        from hypermap.formats.semantic.geopandas_bridge import to_geopackage

        return to_geopackage(layer)
    from hypermap.formats.semantic.parquet_files import dump_parquet

    return dump_parquet(layer.table, layer.frame_id, layer.rejected)


def _save_pgm(hypermap: Hypermap, target: Path, force: bool) -> None:
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.formats.atomic import write_files
    from hypermap.formats.grid.pgm import dump_trinary, rounded

    yaml_file = target.with_suffix(".yaml")
    if target.suffix != ".pgm":
        raise HypermapError(f"{target}: a grid is saved as {target.with_suffix('.pgm').name}")
    for file in (target, yaml_file):
        check_output(file, force)
    layer = _only_one(hypermap, (OccupancyLayer,), f"{target} can hold one grid")
    write_files(target.parent, dump_trinary(layer, target.stem))
    _say_what_is_lost(hypermap, layer)
    if lost := rounded(layer):
        note(f"rounded to free, occupied or unknown: {counted(lost, 'cell')}")
    note(
        f"{yaml_file.name} next to it says where the grid lies, but not that its frame is "
        f"{layer.frame_id!r}"
    )


def _save_geotiff(hypermap: Hypermap, target: Path, force: bool) -> None:
    from hypermap.formats.atomic import write_file
    from hypermap.formats.grid.geotiff import GridLayer, to_geotiff

    check_output(target, force)
    kinds = tuple({type(layer) for layer in hypermap if isinstance(layer, GridLayer)})
    layer = _only_one(hypermap, kinds, f"{target} can hold one grid")
    assert isinstance(layer, GridLayer)
    write_file(target, to_geotiff(layer))
    _say_what_is_lost(hypermap, layer)


def _save_yaml(hypermap: Hypermap, target: Path, force: bool) -> None:
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.core.semantic import SemanticLayer
    from hypermap.formats.atomic import write_file, write_files
    from hypermap.formats.grid.map_server import OccupancyFiles
    from hypermap.formats.semantic.yaml_writing import dump_table
    from hypermap.formats.store import MemoryStore

    check_output(target, force)
    kinds = (OccupancyLayer, SemanticLayer)
    layer = _only_one(hypermap, kinds, f"{target} can hold one layer, a grid or objects")
    if isinstance(layer, OccupancyLayer):
        if target.suffix != ".yaml":
            raise HypermapError(f"{target}: a grid is saved as {target.with_suffix('.yaml').name}")
        check_output(target.with_suffix(".png"), force)
        files = MemoryStore()
        OccupancyFiles().save(layer, files, target.stem)
        if not files.files:
            raise HypermapError(f"layer {layer.name!r} is empty: there is no grid to save")
        write_files(target.parent, files.files)
    elif isinstance(layer, SemanticLayer):
        write_file(target, dump_table(layer.table, layer.rejected))
    _say_what_is_lost(hypermap, layer)
    note(f"the file does not say that its frame is {layer.frame_id!r}")


def _save_log(hypermap: Hypermap, source: Path, target: Path, force: bool) -> None:
    from hypermap.viewer.logs.log import open_log

    check_output(target, force)
    with contextlib.closing(open_log(str(target), title_of(source))) as log:
        log.add_map(hypermap)


def _only_one(hypermap: Hypermap, kinds: tuple[type[L], ...], reason: str) -> L:
    """Return the one layer of a kind.

    Raises:
        HypermapError: If there is none or more than one.
    """
    fitting = [layer for layer in hypermap.layers if isinstance(layer, kinds)]
    if len(fitting) == 1:
        return fitting[0]
    if not fitting:
        names = ", ".join(f"{layer.name} ({layer.class_name})" for layer in hypermap.layers)
        raise HypermapError(f"{reason}, but there is none; the map has: {names or 'no layers'}")
    names = " or ".join(f"--layer {layer.name}" for layer in fitting)
    raise HypermapError(f"{reason}; choose with {names}")


def _say_what_is_lost(hypermap: Hypermap, kept: Layer) -> None:
    lost = [f"layer {layer.name}" for layer in hypermap.layers if layer is not kept]
    lost += [f"frame {transform.child}" for transform in hypermap.frames]
    if lost:
        note(f"left out: {', '.join(lost)}")
