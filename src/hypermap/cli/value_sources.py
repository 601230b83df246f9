"""The samples of `hypermap values`: from a bag, a table, or a layer that keeps them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from hypermap.cli.options import name_of
from hypermap.cli.progress import counting
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.moving_frames import Motion
    from hypermap.core.samples import Samples
    from hypermap.core.value_layer import ValueLayer
    from hypermap.recordings.samples import Measured

_BAGS = (".bag", ".active", ".db3", ".mcap")
_TRAJECTORIES = (".txt", ".tum")
_POSES = (*_BAGS, *_TRAJECTORIES)
_SOURCES = (
    "a table of samples (.csv), a bag (.bag, .mcap, .db3 or a folder) or a map (.hmap)",
    "a bag (.bag, .mcap, .db3 or a folder) or a trajectory (.txt) with the poses",
)


def check_sources(
    source: Path | None, table: Path | None, topic: str | None, is_again: bool
) -> None:
    """Raise a HypermapError unless the options say where the samples are."""
    if source is None and table is None:
        raise HypermapError("no samples: give a table (.csv), or a bag and --topic")
    if topic is not None and table is not None:
        raise HypermapError("give either --topic or --samples, not both")
    if topic is not None and (source is None or is_again):
        raise HypermapError("--topic needs a bag as SOURCE")
    if source is not None and not is_again:
        endings = _POSES if table is not None else _BAGS
        if source.is_file() and source.suffix.lower() not in endings:
            raise HypermapError(f"{source}: expected {_SOURCES[table is not None]}")
    if topic is None and table is None and not is_again:
        raise HypermapError(f"{source}: give --topic TOPIC or --samples FILE, too")


def read(
    source: Path | None,
    table: Path | None,
    topic: str | None,
    field: str | None,
    frame: str,
    sensor_frame: str | None,
    censored_below: float | None,
) -> Measured:
    """Return the samples of a table or a bag, in a given frame."""
    from hypermap.recordings.samples import message_count, read_bag, read_table

    if table is not None:
        motion = None if source is None else _motion(source, frame, sensor_frame)
        measured = read_table(table, field, motion, censored_below=censored_below)
        return replace(measured, quantity=field or table.stem)
    assert source is not None
    assert topic is not None
    with counting("reading", message_count(source, topic), "message") as report:
        measured = read_bag(
            source,
            topic,
            field,
            map_frame=frame,
            sensor_frame=sensor_frame,
            censored_below=censored_below,
            on_message=report,
        )
    return replace(measured, quantity=measured.quantity or topic.strip("/").replace("/", "_"))


def _motion(source: Path, frame: str, sensor_frame: str | None) -> Motion:
    """Return the motion of the sensor, from a trajectory or a bag."""
    from hypermap.recordings.samples import motion_in_bag
    from hypermap.recordings.samples.bag import MAX_GAP
    from hypermap.recordings.tum import read_trajectory

    if source.suffix.lower() in _TRAJECTORIES:
        trajectory, notes = read_trajectory(source, MAX_GAP)
        for text in notes:
            note(text)
        return trajectory
    return motion_in_bag(source, frame, sensor_frame)


def read_layer(
    file: Path,
    quantity: str | None,
    frame: str,
    censored_below: float | None,
    sample_unit: str | None,
    unit: str | None,
    poses: Path | None,
) -> Measured:
    """Return the samples that a value layer of a map file keeps, in a given frame.

    Those at whose time `poses`, a trajectory of the sensor, has a pose are where it says.

    Raises:
        HypermapError: If the map has no such layer, or several and no quantity was given.
    """
    from hypermap.formats import open_map
    from hypermap.values import value_layer_called

    hypermap = open_map(file)
    try:
        layer = value_layer_called(hypermap, quantity)
    except HypermapError as error:
        raise HypermapError(f"{name_of(file)}: {error}") from None
    measured = _kept(hypermap, layer, frame, censored_below)
    if poses is not None:
        measured = replace(measured, samples=_along(measured.samples, poses, frame))
    return measured.in_unit(unit or layer.unit, sample_unit)


def _along(samples: Samples, poses: Path, frame: str) -> Samples:
    """Return samples at the places where a trajectory says that they were taken."""
    import numpy as np

    motion = _motion(poses, frame, None)
    known = np.isfinite(samples.stamps)
    known[known] = motion.covers(samples.stamps[known])
    if not known.any():
        raise HypermapError(f"--poses: {poses} has no pose at the time of any sample")
    if not known.all():
        count = counted(int((~known).sum()), "sample")
        note(f"{count} without a pose in {poses} at their time: these stay where they were")
    points = samples.points_xy.copy()
    points[known] = motion.at(samples.stamps[known])[:, :2, 3]
    return replace(samples, points_xy=points)


def joined(
    hypermap: Hypermap,
    name: str,
    add: bool,
    frame: str,
    measured: Measured,
    sample_unit: str | None,
    unit: str | None,
) -> Measured:
    """Return new samples in the unit of the layer, after those that the layer keeps if `add`.

    Raises:
        HypermapError: If `add` is set and there is no such layer, or the other way round.
    """
    from hypermap.values import value_layer_called
    from hypermap.values.on_map import unlike

    if name not in hypermap and not add:
        return measured.in_unit(unit, sample_unit)
    if name not in hypermap:
        raise HypermapError(f"--add: the map has no layer {name!r} yet")
    if not add:
        raise HypermapError(
            f"the map already has a layer {name!r}; give --add to add the samples to it, or "
            "another name with --quantity"
        )
    layer = value_layer_called(hypermap, name)
    measured = measured.in_unit(unit or layer.unit, sample_unit)
    kept = _kept(hypermap, layer, frame).in_unit(measured.unit).samples
    new = unlike(measured.samples, kept)
    if len(new) < len(measured.samples):
        note(f"{name}: {counted(len(measured.samples) - len(new), 'sample')} already in the map")
    return replace(measured, samples=kept.joined(new))


def _kept(
    hypermap: Hypermap, layer: ValueLayer, frame: str, censored_below: float | None = None
) -> Measured:
    """Return the samples that a layer of a map keeps, in a frame of that map."""
    from hypermap.recordings.samples import Measured
    from hypermap.values.on_map import samples_of

    samples = samples_of(hypermap, layer, frame)
    if censored_below is not None:
        samples = samples.censored(censored_below)
    return Measured(samples, layer.unit, layer.name)
