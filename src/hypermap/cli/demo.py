"""`hypermap demo`: map a simulated room."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.terminal import note, out, say, table
from hypermap.cli.watching import Browser, Port, View, watching
from hypermap.core.errors import HypermapError
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.cli.watching import Watched
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.semantic import SemanticObject
    from hypermap.evaluation.metrics import Score
    from hypermap.simulation import SimulatedRecording


def command(
    folder: Annotated[
        Path,
        typer.Option("--folder", metavar="FOLDER", help="Folder for the results."),
    ] = Path("hypermap-demo"),
    keep_recording: Annotated[
        bool,
        typer.Option("--keep-recording", help="Also save the recording, for `hypermap map`."),
    ] = False,
    noisy: Annotated[
        bool,
        typer.Option(
            "--noisy",
            help="Use a simulated detector with realistic errors instead of a small "
            "neural network.",
        ),
    ] = False,
    view: View = False,
    port: Port = None,
    browser: Browser = True,
) -> None:
    """Map a simulated room, and compare the map with the ground truth.

    A simulated camera with realistic errors drives through the room, and a small neural network
    detects objects. The map is saved, compared with the ground truth, and drawn.

    Examples:
        hypermap demo
        hypermap demo --view
        hypermap demo --folder demo --keep-recording
        hypermap demo --noisy
    """
    from hypermap.formats import save_map
    from hypermap.formats.backup import save_with_backup
    from hypermap.simulation import (
        SimulatedRecording,
        demo_world,
        ground_truth,
        network_detector,
        write_tum,
    )
    from hypermap.viewer.picture import render

    _make_folder(folder)
    world = demo_world()
    recording = SimulatedRecording(
        world,
        detector=None if noisy else network_detector(),
        has_occupancy=False,
        renders_once=keep_recording,
    )
    if keep_recording:
        note(f"saving {counted(len(recording), 'simulated frame')} ...")
        write_tum(recording, folder / "recording")
    map_file, truth_file, picture = (folder / n for n in ("room.hmap", "truth.hmap", "room.png"))
    with watching(view, "simulated room", map_file, len(recording), port, browser) as watched:
        note(f"driving through a simulated room with {counted(len(world.objects), 'object')} ...")
        hypermap, truth = _map(recording, watched), ground_truth(world)
        # Someone may have tried to edit the older one.
        save_with_backup(hypermap, map_file, spare_edited=True)
        save_map(truth, truth_file)
        render(hypermap, picture, title="A simulated room, mapped")
        _show_comparison(hypermap, truth)
        _say_what_next(map_file, truth_file, picture)
        if keep_recording:
            mine = str(folder / "mine.hmap")
            say("\nMap the recording yourself:")
            say("  " + shlex.join(["hypermap", "map", f"{folder / 'recording'}", "-o", mine]))
        watched.finish(f"saved {map_file.name}")


def _map(recording: SimulatedRecording, watched: Watched) -> Hypermap:
    from hypermap.cli.progress import mapping_progress
    from hypermap.mapping.config import profile
    from hypermap.mapping.recording_to_map import map_recording
    from hypermap.perception.detectors.sources import detections_from_recording

    with mapping_progress(len(recording)) as report:
        return map_recording(
            recording,
            detections_from_recording(),
            profile("default"),
            on_progress=watched.with_progress(report),
            watch=watched.frame,
        )


def _say_what_next(map_file: Path, truth_file: Path, picture: Path) -> None:
    quoted = shlex.quote(str(map_file))
    say(f"""
the map      {map_file}
the truth    {truth_file}
the picture  {picture}

View and edit it in the browser:
  hypermap view {quoted}

Query it:
  hypermap query {quoted} --name cup --nearest
  hypermap query {quoted} --at 2,1
  hypermap info {quoted}
  hypermap shell {quoted}""")


def _make_folder(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise HypermapError(f"{folder}: this is a file; name a folder to save in")
    folder.mkdir(parents=True, exist_ok=True)


def _objects(hypermap: Hypermap) -> list[SemanticObject]:
    from hypermap.core.semantic import SemanticLayer

    layers = [layer for layer in hypermap.layers if isinstance(layer, SemanticLayer)]
    return [thing for layer in layers for thing in layer.objects()]


def _show_comparison(hypermap: Hypermap, truth: Hypermap) -> None:
    from hypermap.evaluation import evaluate

    evaluation = evaluate(_objects(hypermap), _objects(truth))
    numbers = ("in the room", "in the map", "found", "overlap", "off by")
    rows = table("class", *numbers, right=numbers)
    for name, score in evaluation.classes.items():
        rows.add_row(name, *_numbers(score))
    rows.add_section()
    rows.add_row("all", *_numbers(evaluation.overall))
    say()
    out().print(rows)
    say("found: objects in the room with a Jaccard index of at least 0.25")


def _numbers(score: Score) -> list[str]:
    quarter = score.detection[0]
    return [
        str(score.true),
        str(score.estimated),
        str(quarter.found),
        "-" if score.iou is None else f"{100 * score.iou:.0f} %",
        "-" if score.centroid_distance is None else f"{100 * score.centroid_distance:.0f} cm",
    ]
