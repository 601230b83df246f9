"""`hypermap map`: make a map from a recording."""

from __future__ import annotations

import signal
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from hypermap.cli.corrected_poses import (
    CorrectPoses,
    PoseCorrection,
    SavePoses,
    known_map,
)
from hypermap.cli.correcting import corrected
from hypermap.cli.finding_options import (
    Config,
    Detections,
    Detector,
    Labels,
    Objects,
    Onto,
    Profile,
    Score,
)
from hypermap.cli.logs import Log, logging_to
from hypermap.cli.map_job import Job, Made, make_map
from hypermap.cli.map_result import note_unseen, save_result, summarize
from hypermap.cli.map_values import Values, read_values, with_values
from hypermap.cli.onto import SamePlace, is_same_file, map_to_go_on_with, settings_of
from hypermap.cli.options import ForceMap, check_map_output
from hypermap.cli.preflight_notes import PreflightNotes
from hypermap.cli.recording_options import RecordingRequest, takes_recording_options
from hypermap.cli.signals import Stop, stop_on_signal
from hypermap.cli.terminal import note
from hypermap.cli.watching import Browser, Port, View, watching
from hypermap.cli.worker_options import MOST_WORKERS, Address
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.cli.watching import Watched
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.perception.detectors.origin import DetectionOrigin
    from hypermap.perception.embedders.embedder import Embedder
    from hypermap.perception.recording import Recording
    from hypermap.recordings import RecordingOptions
    from hypermap.recordings.samples import Measured


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
            help="A folder of images (TUM RGB-D, 7-Scenes, ScanNet, Replica) or a ROS bag.",
        ),
    ] = None,
    detector: Detector = None,
    labels: Labels = None,
    score: Score = None,
    detections: Detections = None,
    objects: Objects = True,
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
    same_place: SamePlace = False,
    poses: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            readable=False,
            help="Corrected poses: those of the camera in the map of --onto, as after a loop "
            "closure. A trajectory in TUM format. The map is rebuilt from them, without the "
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
            help="Encoders of images and texts: find objects by their appearance; "
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
            help="Number of processes: they do perception; the map is the same.",
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
    A recording that does not show the place of that map, or whose poses are in another frame, is
    refused: --same-place maps it anyway. --poses first corrects the poses of the frames in the map;
    then RECORDING may be left out.

    Poses are corrected by the occupancy map if it is known. --correct-poses graph corrects poses
    that drift, such as those of odometry, without a map; it reads the recording twice. Poses that
    already fit stay as they are.

    The map keeps up to three pictures of each object, which `query --pictures` saves. --value adds
    layers of measured values from other sensors, as `hypermap values` does.

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
    check_map_output(output, force or is_same_file(output, onto))
    if path is None:
        _check_needs_no_recording(value, correct_poses, save_poses)
    if same_place and onto is None:
        raise HypermapError("--same-place: only with --onto")
    base = map_to_go_on_with(onto, map_file)
    if poses is not None:
        base = corrected(base, onto, poses, request.options)
    if path is None:
        if poses is None or base is None:
            raise HypermapError("give a RECORDING, or --onto MAP with --poses FILE")
        save_result(base, output, evidence, onto)
        summarize(base, output, onto)
        return
    recording, options = request.open(path)
    values = read_values(value or [], recording, options, base)
    settings = settings_of(base, onto, profile, config, score, has_network=detector is not None)
    if no_pictures or people:
        pictures = replace(settings.pictures, enabled=not no_pictures, people=people)
        settings = replace(settings, pictures=pictures)
    occupancy = _occupancy(map_file, recording)
    if base is None:
        has_map = (occupancy or recording.occupancy()) is not None
    else:
        has_map = correct_poses is not None and known_map(base, settings)
    correction = PoseCorrection(correct_poses, save_poses, has_map)
    settings = correction.settings(settings)
    min_score = settings.perception.min_score
    origin = _origin(recording, detector, labels, min_score, detections, objects)
    correction.check_file(output, [path, onto, map_file, config, detections, labels], force)
    fixed = correction.corrected(recording)
    job = Job(
        origin=origin,
        source=None if origin is None else origin.open(),
        settings=settings,
        occupancy=occupancy,
        base=base,
        onto=onto,
        output=output,
        is_same_place=same_place,
        max_bad=0.0 if strict else max_bad,
        embedder=_embedder(embedder),
        workers=workers,
        address=address,
        corrected=fixed,
    )
    frames = len(recording)  # which reads a bag through once
    with watching(view, recording.path.name, output, frames, port, browser) as watched:
        exit_code = _run(job, frames, values, options, evidence, log, watched)
    if exit_code:
        raise typer.Exit(exit_code)


def _check_needs_no_recording(
    values: list[str] | None, correct_poses: str | None, save_poses: Path | None
) -> None:
    """Raise a HypermapError if there is an option that needs a recording."""
    if values:
        raise HypermapError("--value: give the RECORDING that has the topic")
    if correct_poses is not None or save_poses is not None:
        option = "--save-poses" if correct_poses is None else "--correct-poses"
        raise HypermapError(f"{option}: give the RECORDING whose poses are to be corrected")


def _run(
    job: Job,
    frames: int,
    values: dict[str, Measured],
    options: RecordingOptions,
    evidence: bool,
    log: str | None,
    watched: Watched,
) -> int:
    """Map the recording, save and summarize the map; return the exit code."""
    from hypermap.mapping.preflight import Preflight

    output, name, notes = job.output, job.corrected.recording.path.name, PreflightNotes()
    preflight = Preflight(
        notes.add,
        job.settings.perception.max_depth,
        options.world_pose(),
        options.pose_convention,
    )
    with (
        stop_on_signal() as stop,
        logging_to(log, name, job.corrected.recording.frame_id) as logged,
    ):
        watchers = [watch for watch in (watched.frame, logged) if watch is not None]
        made = make_map(job, frames, stop, watched, watchers, preflight)
        ended = stop if stop.is_wanted else job.corrected.stop
        if made.counts.used == 0 and not values and is_same_file(output, job.onto):
            _end_unchanged(output, name, ended, made)
        hypermap = with_values(made, values)
        save_result(hypermap, output, evidence, job.onto)
    summarize(hypermap, output, job.onto)
    note_unseen(made.hypermap, job.settings)
    notes.remind()
    _finish(watched, output, ended, made)
    return ended.exit_code if job.corrected.stop.is_wanted or not made.is_whole else 0


def _embedder(path: str | None) -> Embedder | None:
    from hypermap.perception.embedders.load import load_embedder

    return None if path is None else load_embedder(path)


def _origin(
    recording: Recording,
    detector: str | None,
    labels: Path | None,
    min_score: float,
    detections: Path | None,
    objects: bool,
) -> DetectionOrigin | None:
    """Return where detections come from; say so if the user did not."""
    from hypermap.perception.detectors.origin import detection_origin

    origin = detection_origin(recording, detector, labels, min_score, detections, objects)
    if origin is None or origin.detector is not None:
        return origin
    if origin.file is None:
        note("taking the detections recorded in the bag")
    elif origin.is_found:
        note(f"taking detections from {origin.file}")
    return origin


def _occupancy(map_file: Path | None, recording: Recording) -> OccupancyLayer | None:
    from hypermap.formats.grid.map_server import load_occupancy

    return None if map_file is None else load_occupancy(map_file, frame_id=recording.frame_id)


def _end_unchanged(output: Path, name: str, stop: Stop, made: Made) -> NoReturn:
    """End without saving: no new frame was used."""
    known = f"{output} already contains {name}" if made.is_whole else f"stopped by {stop.name}"
    note(f"{known}: nothing new, the map is unchanged")
    raise typer.Exit(0 if made.is_whole else stop.exit_code)


def _finish(watched: Watched, output: Path, stop: Stop, made: Made) -> None:
    """Say whether the map is whole, here and on the page, which stays open."""
    part = ""
    if not made.is_whole:
        part = f"the map of a part of the recording: stopped early by {stop.name}"
        note(f"This is {part}.")
    if stop.number in (None, signal.SIGINT):  # other signals are to end the page, too
        watched.finish(f"saved {output.name}" + (f", {part}" if part else ""))
