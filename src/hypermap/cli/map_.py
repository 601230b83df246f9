"""`hypermap map`: make a map from a recording."""

from __future__ import annotations

import math
import shlex
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from hypermap.cli.corrected_poses import (
    CorrectPoses,
    PoseCorrection,
    SavePoses,
    described,
    known_map,
)
from hypermap.cli.correcting import corrected
from hypermap.cli.finding_options import (
    Config,
    Detections,
    Detector,
    Labels,
    Onto,
    Profile,
    Score,
)
from hypermap.cli.logs import Log, logging_to
from hypermap.cli.map_values import Values, read_values, with_values
from hypermap.cli.onto import is_same_file, map_to_go_on_with, named, settings_of
from hypermap.cli.options import ForceMap, check_map_output
from hypermap.cli.preflight_notes import PreflightNotes
from hypermap.cli.recording_options import RecordingRequest, takes_recording_options
from hypermap.cli.signals import Stop, stop_on_signal
from hypermap.cli.terminal import note
from hypermap.cli.watching import Browser, Port, View, watching
from hypermap.cli.worker_options import MOST_WORKERS, Address, opened_workers
from hypermap.core.errors import HypermapError
from hypermap.text import counted, printable

if TYPE_CHECKING:
    from hypermap.cli.watching import Watched
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.fleet.ahead import LookedAtAhead
    from hypermap.mapping.config import MappingConfig
    from hypermap.mapping.counts import Counts
    from hypermap.mapping.mapper import MappedFrame, Mapper
    from hypermap.mapping.pose_graph import CorrectedPoses
    from hypermap.mapping.preflight import Preflight
    from hypermap.mapping.recording_to_map import Progress
    from hypermap.perception.detectors.origin import DetectionOrigin
    from hypermap.perception.embedders.embedder import Embedder
    from hypermap.perception.frame import DetectionSource
    from hypermap.perception.recording import PendingRecording, Recording


@takes_recording_options
def command(
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="OUT", show_default=False, help="Save here: a map, .hmap."
        ),
    ],
    request: RecordingRequest,
    path: Annotated[
        Path | None,
        typer.Argument(
            metavar="RECORDING",
            show_default=False,
            readable=False,
            help="A folder of images (TUM RGB-D, 7-Scenes) or a ROS bag.",
        ),
    ] = None,
    detector: Detector = None,
    labels: Labels = None,
    score: Score = None,
    detections: Detections = None,
    objects: Annotated[
        bool,
        typer.Option("--objects/--no-objects", help="Map objects, or only the occupancy layer."),
    ] = True,
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map",
            metavar="MAP.YAML",
            readable=False,
            help="Occupancy map (map_server YAML), instead of one made from depth.",
        ),
    ] = None,
    onto: Onto = None,
    poses: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            readable=False,
            help="Corrected poses: those of the camera in the map of --onto, as after a loop "
            "closure. A trajectory in TUM format. The map is made again with them, without the "
            "images.",
        ),
    ] = None,
    correct_poses: CorrectPoses = None,
    save_poses: SavePoses = None,
    profile: Profile = None,
    config: Config = None,
    evidence: Annotated[
        bool,
        typer.Option(
            "--keep-evidence/--drop-evidence",
            help="Save the evidence for each object, which `view` can show.",
        ),
    ] = True,
    no_pictures: Annotated[
        bool, typer.Option("--no-pictures", help="Keep no pictures of the objects in the map.")
    ] = False,
    people: Annotated[
        bool,
        typer.Option(
            "--pictures-of-people", help="Keep pictures of people, too; by default none are kept."
        ),
    ] = False,
    value: Values = None,
    embedder: Annotated[
        str | None,
        typer.Option(
            "--embedder",
            metavar="FOLDER",
            show_default=False,
            help="Encoders of images and texts: then the map can be asked what looks like a text; "
            "see docs/embeddings.md.",
        ),
    ] = None,
    max_bad: Annotated[
        float,
        typer.Option(
            "--max-bad",
            metavar="SHARE",
            min=0,
            max=1,
            help="Stop if a larger share of the frames fails; failed frames are "
            "skipped with a warning.",
        ),
    ] = 0.5,
    strict: Annotated[
        bool, typer.Option("--strict", help="Stop at the first frame that fails.")
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            metavar="N",
            min=1,
            max=MOST_WORKERS,
            show_default="1; with --address one per core there",
            help="Number of processes: they look at frames ahead; the map is the same.",
        ),
    ] = None,
    address: Address = None,
    force: ForceMap = False,
    log: Log = None,
    view: View = False,
    port: Port = None,
    browser: Browser = True,
) -> None:
    """Make a map from a recording: an occupancy layer and a semantic layer of objects.

    Objects come from a neural network (--detector), from a file (--detections), or, by default,
    from the detections in the recording or in its detections.json. `hypermap info RECORDING` shows
    what a recording contains and what is missing. `hypermap detectors` lists networks to download.
    --no-objects makes a map without objects.

    A check of the first frames, and of some later ones, finds common problems: a floor that is not
    level at z = 0, a wrong depth unit, depth that is not registered to color, different clocks for
    poses and images, and images that are not upright. Each warning names the option that fixes it.

    --onto continues a map of earlier drives, with its settings, as if mapping had never stopped.
    Other layers stay as they are. Frames that the map already contains do not count twice.
    --poses first corrects the poses of the frames in it; then RECORDING may be left out.

    Poses are corrected by the occupancy map where that is known. --correct-poses graph corrects
    those that drift, as of odometry, without a map: the recording is then read twice. Poses that
    fit as they are stay.

    The map keeps up to three pictures of each object, which `query --pictures` saves. --value adds
    layers of what other sensors have measured, as `hypermap values` does.

    Ctrl-C, SIGTERM or closing the terminal (SIGHUP) stops early and saves the map so far, with exit
    code 130, 143 or 129. With --view, the page then stays open until Ctrl-C.

    Examples:
        hypermap map desk --detector yolox-nano -o desk.hmap
        hypermap map drive.bag --map map.yaml -o office.hmap --view
        hypermap map tuesday.bag --onto office.hmap -o office.hmap
        hypermap map --onto office.hmap --poses corrected.txt -o office.hmap
        hypermap map drive.bag --map-frame odom --correct-poses graph -o office.hmap
        hypermap map desk --log desk.rrd -o desk.hmap
        hypermap map heads --level auto -o heads.hmap
        hypermap map drive.bag --detector yolox-nano --workers 8 -o office.hmap
        hypermap map drive.bag --detector yolox-nano --address 10.0.0.1:6379 -o office.hmap
        hypermap map drive.bag --value /temperature --value /wifi:rssi,unit=dBm -o office.hmap
    """
    from hypermap.mapping.preflight import Preflight
    from hypermap.perception.detectors.origin import detection_origin

    check_map_output(output, force or is_same_file(output, onto))
    if value and path is None:
        raise HypermapError("--value: give the RECORDING that has the topic")
    base = map_to_go_on_with(onto, map_file)
    if poses is not None:
        base = corrected(base, onto, poses, request.options)
    if path is None:
        if poses is None or base is None:
            raise HypermapError("give a RECORDING, or --onto MAP with --poses FILE")
        _save(base, output, evidence, onto)
        _summarize(base, output)
        return
    recording, options = request.open(path)
    values = read_values(value or [], recording, options, base)
    settings = settings_of(base, onto, profile, config, score, has_network=detector is not None)
    if no_pictures or people:
        pictures = replace(settings.pictures, enabled=not no_pictures, people=people)
        settings = replace(settings, pictures=pictures)
    occupancy = _occupancy(map_file, recording)
    correction = PoseCorrection(
        correct_poses,
        save_poses,
        known_map(base) if base is not None else (occupancy or recording.occupancy()) is not None,
    )
    settings = correction.settings(settings)
    origin = detection_origin(
        recording, detector, labels, settings.perception.min_score, detections, objects
    )
    _note_origin(origin)
    source = None if origin is None else origin.open()
    recording, corrected_poses = correction.corrected(recording, force)
    job = _Job(
        recording=recording,
        origin=origin,
        source=source,
        settings=settings,
        occupancy=occupancy,
        base=base,
        onto=onto,
        max_bad=0.0 if strict else max_bad,
        embedder=_embedder(embedder),
        workers=workers,
        address=address,
        corrected_poses=corrected_poses,
    )
    frames = len(recording)  # which reads a bag through once
    name, notes = recording.path.name, PreflightNotes()
    preflight = Preflight(notes.add, settings.perception.max_depth, options.world_pose())
    with watching(view, name, output, frames, port, browser) as watched:
        with stop_on_signal() as stop, logging_to(log, name, recording.frame_id) as logged:
            watchers = [watch for watch in (watched.frame, logged) if watch is not None]
            made = _make_map(job, frames, stop, watched, watchers, preflight)
            if made.counts.used == 0 and not values and is_same_file(output, onto):
                _end_unchanged(output, name, stop, made)
            hypermap = with_values(made.hypermap, values, made.until)
            _save(hypermap, output, evidence, onto)
        _summarize(hypermap, output)
        _note_unseen(made.hypermap, settings)
        notes.remind()
        _finish(watched, output, stop, made)
    if not made.is_whole:
        raise typer.Exit(stop.exit_code)


@dataclass(frozen=True)
class _Job:
    """What is mapped, onto what, and how; `base` is the map of the file `onto`."""

    recording: PendingRecording
    origin: DetectionOrigin | None
    source: DetectionSource | None
    settings: MappingConfig
    occupancy: OccupancyLayer | None
    base: Hypermap | None
    onto: Path | None
    max_bad: float
    embedder: Embedder | None
    workers: int | None
    address: str | None
    corrected_poses: CorrectedPoses | None


@dataclass(frozen=True)
class _Made:
    """A map, what became of the frames, and until when they are those of the recording [s]."""

    hypermap: Hypermap
    counts: Counts
    until: float

    @property
    def is_whole(self) -> bool:
        """Whether they are all frames of the recording."""
        return math.isinf(self.until)


def _embedder(path: str | None) -> Embedder | None:
    from hypermap.perception.embedders.load import load_embedder

    return None if path is None else load_embedder(path)


def _note_origin(origin: DetectionOrigin | None) -> None:
    """Say where detections come from, if the user did not."""
    if origin is None or origin.detector is not None:
        return
    if origin.file is None:
        note("taking the detections recorded in the bag")
    elif origin.is_found:
        note(f"taking detections from {origin.file}")


def _occupancy(map_file: Path | None, recording: Recording) -> OccupancyLayer | None:
    from hypermap.formats.grid.map_server import load_occupancy

    return None if map_file is None else load_occupancy(map_file, frame_id=recording.frame_id)


def _make_map(
    job: _Job,
    frames: int,
    stop: Stop,
    watched: Watched,
    watchers: list[Callable[[MappedFrame, Mapper], None]],
    preflight: Preflight,
) -> _Made:
    """Map the recording until its end or `stop`."""
    from hypermap.cli.progress import Pace, mapping_progress
    from hypermap.cli.stopping import StoppableRecording
    from hypermap.mapping.counts import Counts
    from hypermap.mapping.recording_to_map import map_recording

    started, pace, rate = time.monotonic(), Pace(), 0.0
    counts = Counts()
    with mapping_progress(frames) as report, _looking_ahead(job) as ahead:
        stoppable = StoppableRecording(ahead or job.recording, stop)

        def watch(mapped: MappedFrame, mapper: Mapper) -> None:
            for watcher in watchers:
                watcher(mapped, mapper)

        def tell(progress: Progress) -> None:
            nonlocal rate, counts
            counts = progress.counts
            rate = pace.after(progress.done)
            report(progress)

        try:
            with named(job.onto):
                hypermap = map_recording(
                    stoppable,
                    job.source,
                    job.settings,
                    job.occupancy,
                    watched.with_progress(tell),
                    watch if watchers else None,
                    preflight,
                    job.max_bad,
                    job.base,
                    job.embedder,
                    ahead,
                )
        except HypermapError:
            if stoppable.ended_early:
                note("no frame was mapped so far, so nothing is saved")
                raise typer.Exit(stop.exit_code) from None
            raise
    hypermap.metadata = described(hypermap.metadata, job.corrected_poses)
    _note_frames(hypermap, counts, job.settings, time.monotonic() - started, rate)
    return _Made(hypermap, counts, stoppable.until)


@contextmanager
def _looking_ahead(job: _Job) -> Iterator[LookedAtAhead | None]:
    """Yield the recording as workers look at it, if there are to be any."""
    if job.workers in (None, 1) and job.address is None:
        yield None
        return
    from hypermap.fleet.ahead import LookedAtAhead

    with opened_workers(job.workers, job.address, MOST_WORKERS) as workers:
        yield LookedAtAhead(job.recording, workers, job.origin)


def _end_unchanged(output: Path, name: str, stop: Stop, made: _Made) -> NoReturn:
    """End without saving: no new frame was used."""
    known = f"{output} already contains {name}" if made.is_whole else f"stopped by {stop.name}"
    note(f"{known}: nothing new, the map is unchanged")
    raise typer.Exit(0 if made.is_whole else stop.exit_code)


def _finish(watched: Watched, output: Path, stop: Stop, made: _Made) -> None:
    """Say whether the map is whole, here and on the page, which stays open."""
    part = ""
    if not made.is_whole:
        part = f"the map of a part of the recording: stopped early by {stop.name}"
        note(f"This is {part}.")
    if stop.number in (None, signal.SIGINT):  # other signals are to end the page, too
        watched.finish(f"saved {output.name}" + (f", {part}" if part else ""))


def _save(hypermap: Hypermap, output: Path, evidence: bool, onto: Path | None) -> None:
    """Save the map, without its evidence if the user drops it, and keep what it replaces."""
    from hypermap.formats import save_map
    from hypermap.formats.backup import keep_backup

    if not evidence:
        _drop_evidence(hypermap)
    backup = keep_backup(output, spare_edited=True)
    save_map(hypermap, output)
    if backup is not None:
        note(f"the previous map is kept as {backup}" + _hint_onto(backup, output, onto))


def _hint_onto(backup: Path, output: Path, onto: Path | None) -> str:
    """Return a hint at --onto, if a map that could have been continued was replaced."""
    from hypermap.formats.backup import may_go_on

    if is_same_file(output, onto) or not may_go_on(backup):
        return ""
    return f"; the new map does not continue it (--onto {shlex.quote(str(output))} would)"


def _note_frames(
    hypermap: Hypermap, counts: Counts, settings: MappingConfig, seconds: float, rate: float | None
) -> None:
    """Say what became of the frames; `rate` is their number per second once code is loaded."""
    from hypermap.mapping.corrections import sentence

    pace = f" ({rate:.1f}/s after the first, which loads compiled code)" if rate else ""
    note(
        f"{counts.frames} frames in {seconds:.1f} s{pace}: {counts.used} used, "
        f"{counts.skipped} skipped because the camera had hardly moved, "
        f"{counts.unusable} unusable"
    )
    if counts.repeated:
        note(f"{counted(counts.repeated, 'frame')} already in the map, not counted again")
    if surplus := hypermap.metadata.get("surplus_detections"):
        note(
            f"{counted(surplus, 'detection')} left out: only the best "
            f"{settings.perception.max_detections} of a frame are used "
            "(perception: max_detections in --config)"
        )
    if corrections := hypermap.metadata.get("pose_corrections"):
        note(sentence(corrections))
    elif settings.alignment.enabled and hypermap.metadata["poses"] == "as recorded":
        note(
            "poses were used as recorded; if they drift, --correct-poses graph corrects them "
            "without an occupancy map"
        )


def _note_unseen(hypermap: Hypermap, settings: MappingConfig) -> None:
    """Name the objects that mapping would have removed if nobody had edited them by hand."""
    from hypermap.formats.backup import BY_HAND
    from hypermap.mapping.going_on import layer_of_objects

    for item in layer_of_objects(hypermap) or ():
        is_there = item.existence is None or item.existence > settings.evidence.publish_above
        if BY_HAND in item.attributes and not is_there:
            note(
                f"object {item.id} ({printable(item.name)}) was not found again, but stays because "
                "it was edited by hand"
            )


def _drop_evidence(hypermap: Hypermap) -> None:
    from hypermap.core.semantic import SemanticLayer

    hypermap.mapper_state = None
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
    has_objects = any(isinstance(layer, SemanticLayer) for layer in hypermap.layers)
    if has_objects:
        note(counted(names.total(), "object") + (f": {listed}" if listed else ""))
    note(f"saved {output}")
    made, picture = str(output), str(output.with_suffix(".png"))
    note("\nnow try:  " + shlex.join(["hypermap", "view", made]))
    note("          " + shlex.join(["hypermap", "render", made, "-o", picture]))
    if has_objects:
        name = printable(next(iter(names), "chair"))
        note("          " + shlex.join(["hypermap", "query", made, "--name", name, "--nearest"]))
