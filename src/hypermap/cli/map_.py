"""`hypermap map`: make a map of a recording."""

from __future__ import annotations

import enum
import shlex
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.logs import Log, logging_to
from hypermap.cli.options import check_output
from hypermap.cli.recording_options import takes_recording_options
from hypermap.cli.terminal import INTERRUPTED, note
from hypermap.cli.watching import Browser, Port, View, watching
from hypermap.core.errors import HypermapError
from hypermap.viewer.text import counted, printable

if TYPE_CHECKING:
    from hypermap.cli.stopping import Stop
    from hypermap.cli.watching import Watched
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.mapping.config import MappingConfig
    from hypermap.mapping.mapper import MappedFrame, Mapper, Progress
    from hypermap.perception.detections import DetectionSource
    from hypermap.perception.recording import Recording
    from hypermap.recordings import RecordingOptions

_LEAST_SCORE = 0.3  # for a network, where the profile takes all that is recorded


class Profile(str, enum.Enum):
    """The named configurations."""

    default = "default"
    thesis = "thesis"


@takes_recording_options
def command(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="RECORDING",
            show_default=False,
            readable=False,
            help="A folder of images (TUM RGB-D, 7-Scenes) or a ROS bag.",
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="OUT", show_default=False, help="The map to make: .hmap."
        ),
    ],
    recording_options: RecordingOptions,
    detector: Annotated[
        str | None,
        typer.Option(metavar="MODEL", help="Find objects with this neural network (.onnx)."),
    ] = None,
    labels: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            readable=False,
            help="Names of the network's classes, where it has none.",
        ),
    ] = None,
    score: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=1,
            show_default="0.3",
            help="Leave out what the detector is less sure of.",
        ),
    ] = None,
    detections: Annotated[
        Path | None,
        typer.Option(metavar="FILE", readable=False, help="Take detections from this JSON file."),
    ] = None,
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map",
            metavar="MAP.YAML",
            readable=False,
            help="Occupancy map of map_server, in place of one made from depth.",
        ),
    ] = None,
    profile: Annotated[
        Profile, typer.Option(help="thesis: the method of 2019. default: the best that we know.")
    ] = Profile.default,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", readable=False, help="YAML with settings that differ."),
    ] = None,
    evidence: Annotated[
        bool,
        typer.Option(help="Keep what was seen of each object, to look behind it in `view`."),
    ] = True,
    log: Log = None,
    view: View = False,
    port: Port = None,
    browser: Browser = True,
) -> None:
    """Make a map of a recording: an occupancy layer, and the objects seen, with their shapes.

    Objects come from a neural network (--detector), from a file (--detections), or, when neither
    is given, from the detections in the recording itself or in its folder's detections.json.
    `hypermap info RECORDING` says what a recording holds and what it lacks.

    Ctrl-C stops early and saves what was seen so far; the exit code is 130 then. With --view the
    page of the run stays afterwards, until Ctrl-C.

    Examples:
        hypermap map desk --detector yolox_nano.onnx -o desk.hmap
        hypermap map drive.bag --map map.yaml -o office.hmap --view
        hypermap map desk --log desk.rrd -o desk.hmap
        hypermap map heads --world-transform 0,0,1.2,-1.9,0,0 -o heads.hmap
    """
    from hypermap.cli.stopping import stop_on_interrupt
    from hypermap.formats import save_map
    from hypermap.formats.map_server import load_occupancy
    from hypermap.recordings import open_recording

    if output.suffix.lower() != ".hmap":
        raise HypermapError(f"{output}: a map is saved as .hmap")
    check_output(output, replace=True)
    recording = open_recording(path, recording_options)
    settings = _settings(profile, config, score)
    occupancy = None
    if map_file is not None:
        occupancy = load_occupancy(map_file, frame_id=recording.frame_id)
    least = settings.perception.min_score or _LEAST_SCORE
    source = _detection_source(recording, detector, labels, least, detections)
    frames = len(recording)  # which reads a bag through once
    name = recording.path.name
    with watching(view, name, output, frames, port, browser) as watched:
        with stop_on_interrupt() as stop, logging_to(log, name, recording.frame_id) as logged:
            watchers = [watch for watch in (watched.frame, logged) if watch is not None]
            hypermap, is_whole = _make_map(
                recording, source, settings, occupancy, frames, stop, watched, watchers
            )
            if not evidence:
                _forget_evidence(hypermap)
            save_map(hypermap, output)
        _summarize(hypermap, output)
        part = "" if is_whole else "the map of a part of the recording: Ctrl-C ended it early"
        if part:
            note(f"This is {part}.")
        watched.finish(f"saved {output.name}" + (f", {part}" if part else ""))
    if not is_whole:
        raise typer.Exit(INTERRUPTED)


def _settings(profile: Profile, path: Path | None, score: float | None) -> MappingConfig:
    from hypermap.mapping import config

    settings = config.profile(profile.value)
    if path is not None:
        settings = config.load_config(path, settings)
    if score is not None:
        settings = replace(settings, perception=replace(settings.perception, min_score=score))
    return settings


def _detection_source(
    recording: Recording,
    detector: str | None,
    labels: Path | None,
    score: float,
    detections: Path | None,
) -> DetectionSource:
    """Return where the detections come from: as the user says, or else as the recording has them.

    Raises:
        HypermapError: If the user says two things, or there are none.
    """
    from hypermap.perception.detectors import load_detector, sources

    if detector is not None and detections is not None:
        raise HypermapError("give either --detector or --detections, not both")
    if labels is not None and detector is None:
        raise HypermapError("--labels belongs to a --detector, which is not given")
    if detector is not None:
        return sources.detections_from_detector(load_detector(detector, labels, score))
    if detections is not None:
        return sources.detections_from_file(detections)
    beside = recording.path / "detections.json"
    if beside.is_file():
        note(f"taking detections from {beside}")
        return sources.detections_from_file(beside)
    if any(stream.use == "recorded detections" for stream in recording.info().streams):
        note("taking the detections recorded in the bag")
        return sources.detections_from_recording()
    raise HypermapError(
        f"{recording.path}: nothing says what is on the images; give --detector MODEL.onnx or "
        "--detections FILE, or a recording that has detections (in a bag, or as detections.json "
        "in its folder)"
    )


def _make_map(
    recording: Recording,
    source: DetectionSource,
    settings: MappingConfig,
    occupancy: OccupancyLayer | None,
    frames: int,
    stop: Stop,
    watched: Watched,
    watchers: list[Callable[[MappedFrame, Mapper], None]],
) -> tuple[Hypermap, bool]:
    """Return the map, and whether it is that of the whole recording."""
    from hypermap.cli.progress import Pace, mapping_progress
    from hypermap.cli.stopping import StoppableRecording
    from hypermap.mapping.mapper import map_recording

    started, pace, rate = time.monotonic(), Pace(), 0.0
    with mapping_progress(frames) as report:
        stoppable = StoppableRecording(recording, stop)

        def watch(mapped: MappedFrame, mapper: Mapper) -> None:
            for watcher in watchers:
                watcher(mapped, mapper)

        def tell(progress: Progress) -> None:
            nonlocal rate
            rate = pace.after(progress.done)
            report(progress)

        try:
            hypermap = map_recording(
                stoppable,
                source,
                settings,
                occupancy,
                watched.beside(tell),
                watch if watchers else None,
            )
        except HypermapError:
            if stoppable.ended_early:  # before anything was seen, and so there is nothing to save
                raise KeyboardInterrupt from None
            raise
    seconds = time.monotonic() - started
    counts = hypermap.metadata["frames"]
    total = sum(counts.values())
    pace_told = f" ({rate:.1f}/s after the first, which loads compiled code)" if rate else ""
    note(
        f"{total} frames in {seconds:.1f} s{pace_told}: {counts['used']} used, "
        f"{counts['skipped']} skipped because the camera had hardly moved, "
        f"{counts['unusable']} unusable"
    )
    return hypermap, not stoppable.ended_early


def _forget_evidence(hypermap: Hypermap) -> None:
    from hypermap.core.semantic import SemanticLayer

    for layer in hypermap:
        if isinstance(layer, SemanticLayer):
            layer.kept_evidence = None


def _summarize(hypermap: Hypermap, output: Path) -> None:
    from hypermap.core.semantic import SemanticLayer

    names = Counter(
        name
        for layer in hypermap.layers
        if isinstance(layer, SemanticLayer)
        for name in layer.names
    )
    listed = ", ".join(f"{count} {printable(name)}" for name, count in names.most_common())
    note(counted(names.total(), "object") + (f": {listed}" if listed else ""))
    note(f"saved {output}")
    name = next(iter(names), "chair")
    made, picture = str(output), str(output.with_suffix(".png"))
    note("\nnow try:  " + shlex.join(["hypermap", "view", made]))
    note("          " + shlex.join(["hypermap", "render", made, "-o", picture]))
    asked = ["hypermap", "query", made, "--name", printable(name), "--nearest"]
    note("          " + shlex.join(asked))
