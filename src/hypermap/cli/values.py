"""`hypermap values`: make a map layer from samples of a quantity."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.options import AsJson, Force, OptionalMapOutput, check_new_map, name_of
from hypermap.cli.saving import save_from
from hypermap.cli.terminal import note, say, say_json
from hypermap.cli.value_sources import check_sources, joined, read, read_layer
from hypermap.core.errors import FileMissing, HypermapError
from hypermap.text import counted, is_address, printable

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.core.value_layer import ValueLayer
    from hypermap.recordings.samples.measured import Measured
    from hypermap.values import FieldSettings

_SAMPLES, _PLACE, _METHOD = "Samples", "Where they were taken", "How values are computed"


def command(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="SOURCE",
            readable=False,
            show_default=False,
            help="A table of samples (.csv), or a ROS bag with --topic. With --samples: a bag or a "
            "trajectory (.txt, TUM format) that has the poses. Or a map (.hmap) whose samples are "
            "used again.",
        ),
    ] = None,
    output: OptionalMapOutput = None,
    onto: Annotated[
        Path | None,
        typer.Option(
            "--onto",
            metavar="MAP",
            readable=False,
            show_default=False,
            help="Add to this map: its occupancy layer provides the walls. Otherwise, the result "
            "is a new map without walls.",
        ),
    ] = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            "--quantity",
            metavar="NAME",
            show_default="taken from the samples",
            help="What was measured, such as temperature. It becomes the name of the layer.",
        ),
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(
            "--unit",
            metavar="UNIT",
            show_default="unit of the samples",
            help="Unit of the layer, such as degC, dBm or ppm.",
        ),
    ] = None,
    topic: Annotated[
        str | None,
        typer.Option("--topic", metavar="TOPIC", help="Topic of a bag.", rich_help_panel=_SAMPLES),
    ] = None,
    table: Annotated[
        Path | None,
        typer.Option(
            "--samples",
            metavar="FILE",
            help="A table of samples without poses, which SOURCE has: CSV with the columns stamp "
            "and value.",
            rich_help_panel=_SAMPLES,
        ),
    ] = None,
    field: Annotated[
        str | None,
        typer.Option(
            "--field",
            metavar="PATH",
            help="Where the value is: a field of the message, such as rssi, signal.level or "
            "values[0]; a key of diagnostics; a column of a table.",
            rich_help_panel=_SAMPLES,
        ),
    ] = None,
    sample_unit: Annotated[
        str | None,
        typer.Option(
            "--sample-unit",
            metavar="UNIT",
            help="Unit of the samples, if it differs from --unit and the message does not give it.",
            rich_help_panel=_SAMPLES,
        ),
    ] = None,
    censored_below: Annotated[
        float | None,
        typer.Option(
            "--censored-below",
            metavar="N",
            help="Detection limit of the sensor, in the samples' unit: NaN, an empty cell and "
            'smaller values all mean "below this".',
            rich_help_panel=_SAMPLES,
        ),
    ] = None,
    add: Annotated[
        bool,
        typer.Option(
            "--add",
            help="Combine the samples with those already in the layer.",
            rich_help_panel=_SAMPLES,
        ),
    ] = False,
    sensor_frame: Annotated[
        str | None,
        typer.Option(
            "--sensor-frame",
            metavar="FRAME",
            show_default="frame_id of the messages, or base_link",
            help="Frame of the sensor in tf.",
            rich_help_panel=_PLACE,
        ),
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Option(
            "--poses",
            metavar="FILE",
            readable=False,
            help="Corrected poses: those of the sensor, for the samples of a map as SOURCE. A "
            "trajectory in TUM format. Samples without a pose at their time stay.",
            rich_help_panel=_PLACE,
        ),
    ] = None,
    map_frame: Annotated[
        str | None,
        typer.Option(
            "--map-frame",
            metavar="FRAME",
            show_default=False,
            help="Fixed frame of the map, z up: by default that of the occupancy layer.",
            rich_help_panel=_PLACE,
        ),
    ] = None,
    occupancy: Annotated[
        str | None,
        typer.Option(
            "--occupancy",
            metavar="NAME",
            show_default="the only one",
            help="Name of the occupancy layer.",
            rich_help_panel=_PLACE,
        ),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            metavar="gmrf|kernel|nearest",
            help="gmrf: respects walls, with well-calibrated deviations. kernel: faster. nearest: "
            "the nearest sample.",
            rich_help_panel=_METHOD,
        ),
    ] = "gmrf",
    resolution: Annotated[
        float | None,
        typer.Option(
            "--resolution",
            metavar="METERS",
            min=0,
            show_default="0.25, or coarser on a large floor",
            help="Cell size.",
            rich_help_panel=_METHOD,
        ),
    ] = None,
    length: Annotated[
        float | None,
        typer.Option(
            "--length-scale",
            metavar="METERS",
            show_default="found from the samples",
            help="Distance over which values are correlated; for the method kernel, the width of "
            "the kernel.",
            rich_help_panel=_METHOD,
        ),
    ] = None,
    deviation: Annotated[
        float | None,
        typer.Option(
            "--deviation",
            metavar="N",
            show_default="found from the samples",
            help="Standard deviation of the quantity over the floor.",
            rich_help_panel=_METHOD,
        ),
    ] = None,
    sensor_noise: Annotated[
        float | None,
        typer.Option(
            "--sensor-noise",
            metavar="N",
            show_default="found from the samples",
            help="Standard deviation of repeated samples at one place.",
            rich_help_panel=_METHOD,
        ),
    ] = None,
    half_life: Annotated[
        float | None,
        typer.Option(
            "--half-life",
            metavar="SECONDS",
            show_default="old samples count as much as new ones",
            help="A sample loses half its weight in this time before the newest sample: for "
            "quantities that change, such as temperature or gas.",
            rich_help_panel=_METHOD,
        ),
    ] = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Make a map layer of a measured quantity, such as temperature, WiFi, gas or light.

    The layer contains the most probable value of each cell, with its standard deviation. Cells too
    far from any sample have no value. The layer also keeps the samples, so you can compute it again
    with other settings. A table needs a header line with the columns x, y and value; stamp is
    optional.

    Examples:
        hypermap values samples.csv --onto office.hmap -o warm.hmap --unit degC
        hypermap values drive.bag --topic /temperature --onto office.hmap -o warm.hmap
        hypermap values drive.bag --topic /wifi --field rssi --onto office.hmap -o wifi.hmap
        hypermap values wifi.csv --censored-below -95 --unit dBm --onto office.hmap -o wifi.hmap
        hypermap values drive.bag --samples log.csv --field co2 --onto office.hmap -o co2.hmap
        hypermap values warm.hmap --method kernel -o other.hmap
        hypermap values warm.hmap --poses corrected.txt -o moved.hmap
    """
    from hypermap.core.hypermap import Hypermap
    from hypermap.formats import open_map
    from hypermap.values.on_map import with_value_layer

    if source is not None and table is None and source.suffix.lower() == ".csv":
        source, table = None, source
    is_site = source is not None and is_address(source)
    is_file = source is not None and source.suffix.lower() == ".hmap"
    is_again = table is None and (is_site or is_file)
    check_sources(source, table, topic, is_again)
    if poses is not None and not is_again:
        raise HypermapError("--poses corrects the samples of a map: give one (.hmap) as SOURCE")
    if add and is_again and source is not None:
        raise HypermapError(f"--add: {name_of(source)} has no new samples; give a table or a bag")
    output = _checked(method, output, force)
    if source is not None and not is_site and not source.exists():
        raise FileMissing(f"{source}: there is no such file or folder")
    settings = _settings(method, length, deviation, sensor_noise)
    onto = source if onto is None and is_again else onto
    hypermap = Hypermap() if onto is None else open_map(onto)
    walls = _walls(hypermap, occupancy)
    frame = _frame(hypermap, walls, map_frame)
    if is_again:
        assert source is not None
        measured = read_layer(source, quantity, frame, censored_below, sample_unit, unit, poses)
        name = quantity or measured.quantity
    else:
        tf_frame = map_frame or frame
        measured = read(source, table, topic, field, tf_frame, sensor_frame, censored_below)
        name = quantity or measured.quantity or "value"
        measured = joined(hypermap, name, add, frame, measured, sample_unit, unit)
    layer = _layer(name, measured, walls, frame, method, settings, resolution, half_life)
    left_out = _left_out(measured, layer)
    save_from(with_value_layer(hypermap, layer), onto, output)
    if as_json:
        say_json(_describe(layer, left_out))
    else:
        _show(layer, left_out)
    note(f"saved {output}")


def _layer(
    name: str,
    measured: Measured,
    walls: OccupancyLayer | None,
    frame: str,
    method: str,
    settings: FieldSettings | None,
    resolution: float | None,
    half_life: float | None,
) -> ValueLayer:
    from hypermap.recordings.samples import reasons
    from hypermap.values import value_layer_of

    if not len(measured.samples):
        raise HypermapError(f"no usable sample: {reasons(measured.left_out)}")
    note(f"{method}: {counted(len(measured.samples), 'sample')} ...")
    return value_layer_of(
        name,
        measured.samples,
        walls,
        frame_id=frame,
        quantity=name,
        unit=measured.unit,
        method=method,  # type: ignore[arg-type]  # one of METHODS, as `_checked` has checked
        settings=settings,
        resolution=resolution,
        half_life=half_life,
    )


def _left_out(measured: Measured, layer: ValueLayer) -> dict[str, int]:
    """Return how many samples were left out, by the reason."""
    assert layer.samples is not None
    off = len(measured.samples) - len(layer.samples)
    return {**measured.left_out, **({"off the map": off} if off else {})}


def _checked(method: str, output: Path | None, force: bool) -> Path:
    """Return where to save; raises a HypermapError if it or the method is not possible."""
    from hypermap.values import METHODS

    if method not in METHODS:
        raise HypermapError(f"--method {method!r}: expected one of {', '.join(METHODS)}")
    if output is None:
        raise HypermapError("no output file: give -o OUT.hmap")
    check_new_map(output, force)
    return output


def _settings(
    method: str, length: float | None, deviation: float | None, noise: float | None
) -> FieldSettings | None:
    """Return the settings that the user has given; None for none."""
    from hypermap.values import FieldSettings

    given = {"--length-scale": length, "--deviation": deviation, "--sensor-noise": noise}
    said = [name for name, number in given.items() if number is not None]
    if not said:
        return None
    if method == "nearest":
        raise HypermapError(f"{said[0]} has no effect with the method nearest")
    needed = ["--length-scale"] if method == "kernel" else list(given)
    if said != needed:
        raise HypermapError(f"the method {method} needs all of {', '.join(needed)}, or none")
    try:
        return FieldSettings(length or 0.0, deviation or 1.0, noise or 1.0)
    except ValueError as error:
        raise HypermapError(f"--{error}") from None


def _walls(hypermap: Hypermap, name: str | None) -> OccupancyLayer | None:
    """Return the occupancy layer; None for a map that has none."""
    from hypermap.core.occupancy import OccupancyLayer

    if name is None and not any(isinstance(layer, OccupancyLayer) for layer in hypermap):
        note("the map has no occupancy layer, so there are no walls")
        return None
    return hypermap.occupancy(name)


def _frame(hypermap: Hypermap, walls: OccupancyLayer | None, named: str | None) -> str:
    """Return the frame of the new layer; `named` counts only for a map without layers."""
    if walls is not None:
        return walls.frame_id
    return hypermap.base_frame if len(hypermap.layers) else named or hypermap.base_frame


def _describe(layer: ValueLayer, left_out: dict[str, int]) -> dict[str, Any]:
    """Return what `--json` prints."""
    assert layer.samples is not None
    found = layer.summary_in(layer.extent())
    return {
        "layer": layer.name,
        "frame_id": layer.frame_id,
        "unit": layer.unit,
        "samples": len(layer.samples),
        "not_heard": int(layer.samples.is_below.sum()),
        "left_out": left_out,
        "cells": found.count,
        "mean": found.mean,
        "min": found.least,
        "max": found.most,
        "made_by": layer.made_by,
    }


def _show(layer: ValueLayer, left_out: dict[str, int]) -> None:
    from hypermap.recordings.samples import reasons

    assert layer.samples is not None
    say(printable(layer.summary(), 200))
    not_heard = int(layer.samples.is_below.sum())
    if not_heard:
        say(f"below the limit: {counted(not_heard, 'sample')}")
    made_by = [
        f"{name} {number:.3g}" if isinstance(number, float) else f"{name} {number}"
        for name, number in layer.made_by.items()
    ]
    say(printable(f"made by: {', '.join(made_by)}", 200))
    if left_out:
        note(f"left out: {reasons(left_out)}")
