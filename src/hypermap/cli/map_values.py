"""`--value` of `hypermap map`: what other sensors of the recording have measured."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.progress import counting
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError
from hypermap.text import counted, printable

if TYPE_CHECKING:
    from hypermap.cli.map_job import Made
    from hypermap.core.hypermap import Hypermap
    from hypermap.perception.recording import Recording
    from hypermap.recordings import RecordingOptions
    from hypermap.recordings.samples import Measured, ValueSource

_OWN_LAYERS = ("occupancy", "semantic")

Values = Annotated[
    list[str] | None,
    typer.Option(
        "--value",
        metavar="TOPIC[:FIELD][,KEY=TEXT]...",
        show_default=False,
        help="Make a layer of measured values from this topic: a number in its messages, as "
        "`hypermap values` does. KEY is quantity, unit, sample-unit, censored-below or "
        "sensor-frame. May be repeated.",
    ),
]


def read_values(
    texts: list[str], recording: Recording, options: RecordingOptions, base: Hypermap | None
) -> dict[str, Measured]:
    """Return the samples of topics of a recording, by the names of their layers.

    This comes before mapping, so that nobody waits for an hour to hear that a name is wrong.

    Args:
        texts: of `--value`.
        recording: a bag.
        options: how it is read.
        base: the map of `--onto`.

    Raises:
        HypermapError: If a text is not of the form, or names no samples of use.
    """
    if not texts:
        return {}
    from hypermap.recordings.bag.recording import BagRecording
    from hypermap.recordings.samples import ValueSource
    from hypermap.values.on_map import known_layer

    found: dict[str, Measured] = {}
    sources = [ValueSource.parse(text) for text in texts]
    if not isinstance(recording, BagRecording):
        raise HypermapError(
            f"--value: {recording.path} is not a bag, so it has no topics; give samples to "
            "`hypermap values POSES.txt --samples FILE.csv --onto MAP`"
        )
    for source in sources:
        measured = _read(source, recording, options)
        name = measured.quantity
        if name in found or name in _OWN_LAYERS:
            raise HypermapError(
                f"--value {source.topic}: there is a layer {name!r} already; add ,quantity=NAME"
            )
        known = None if base is None else known_layer(base, name)
        kept_unit = None if known is None else known.unit or None
        measured = measured.in_unit(source.unit or kept_unit, source.sample_unit)
        found[name] = measured.in_unit(kept_unit)
    return found


def _read(source: ValueSource, recording: Recording, options: RecordingOptions) -> Measured:
    """Return the samples of a topic, with the name of their layer as the quantity."""
    from hypermap.recordings.samples import message_count, read_bag, reasons

    count = message_count(recording.path, source.topic)
    with counting(f"reading {source.topic}", count, "message") as report:
        measured = read_bag(
            recording.path,
            source.topic,
            source.field,
            map_frame=recording.frame_id,
            sensor_frame=source.sensor_frame,
            censored_below=source.censored_below,
            map_T_world=options.world_pose(),
            max_gap=options.max_pose_gap,
            on_message=report,
        )
    if not len(measured.samples):
        why = reasons(measured.left_out)
        raise HypermapError(f"--value {source.topic}: no usable sample: {why}")
    if measured.left_out:
        note(f"{source.topic}: left out: {reasons(measured.left_out)}")
    return replace(measured, quantity=source.name(measured.quantity))


def with_values(made: Made, values: dict[str, Measured]) -> Hypermap:
    """Return a map with the layers of samples, which join those of layers of the same names.

    Samples move with the frames of their time, whose poses were corrected.

    Args:
        made: the map, in whose base frame the samples are.
        values: of `read_values`.
    """
    hypermap = made.hypermap
    if not values:
        return hypermap
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.values.on_map import known_layer, made_of, new_among, samples_of, with_value_layer

    frame = hypermap.base_frame
    walls = next((layer for layer in hypermap if isinstance(layer, OccupancyLayer)), None)
    for name, measured in values.items():
        known = known_layer(hypermap, name)
        samples = measured.samples.chosen(measured.samples.stamps <= made.until)
        for changes in made.moves:
            samples = changes.moved(samples)
        if known is not None and known.samples is not None:
            kept = samples_of(hypermap, known, frame)
            new = new_among(samples, kept)
            if len(new) < len(samples):
                note(f"{name}: {counted(len(samples) - len(new), 'sample')} already in the map")
            samples = kept.joined(new)
        if not len(samples):
            note(f"{name}: no sample so far, so there is no layer of it")
            continue
        note(f"{printable(name)}: {counted(len(samples), 'sample')} ...")
        layer = made_of(name, samples, measured.unit, walls, frame, known)
        note(printable(layer.summary(), 200))
        hypermap = with_value_layer(hypermap, layer)
    return hypermap
