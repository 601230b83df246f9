"""`hypermap simulate`: record a drive through a simulated world, with its true map."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.progress import counting
from hypermap.cli.terminal import say
from hypermap.core.errors import FormatError, HypermapError
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.perception.frame import Camera
    from hypermap.simulation import World
    from hypermap.simulation.days import WorldChange
    from hypermap.simulation.levels import Errors
    from hypermap.simulation.world import WorldObject

ErrorLevel = Annotated[
    str,
    typer.Option(
        metavar="none|fair|robot|drift|rough|harsh|FILE",
        help="Errors of camera, localization, detector and map: none; fair: depth and detections "
        "as usual; robot: also poses that drift and jump, walls mistaken for objects; drift: the "
        "same with poses from odometry, off by 1 % of the way and 1 degree per 10 m; rough: robot "
        "and small lasting errors (clock, mounting, dark surfaces, false places, a map made by a "
        "laser); harsh: twice these; or a YAML file that changes single values of fair.",
    ),
]
SensorName = Annotated[
    str,
    typer.Option(
        metavar="kinect_v1|realsense_d435|tof",
        help="Depth camera: its noise, range, steps and flying pixels, as published.",
    ),
]
_SIZES = {"320x240": 1, "640x480": 2}
MOST_DAYS = 1000


def command(
    world: Annotated[
        str,
        typer.Argument(
            metavar="WORLD",
            show_default=False,
            help="demo, lab, floor, office, kitchen, warehouse, corridor, apartment, open_office, "
            "building, or a world file (YAML).",
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            show_default=False,
            help="Save here: a recording, in a new folder or a new file that ends in .bag.",
        ),
    ],
    errors: ErrorLevel = "robot",
    sensor: SensorName = "kinect_v1",
    seed: Annotated[
        int,
        typer.Option(
            min=0,
            help="Random seed for all errors, the placement of furniture, and what changes from "
            "day to day: give all days the same.",
        ),
    ] = 0,
    rate: Annotated[float, typer.Option(min=0.01, max=100, help="Frames per second.")] = 3.0,
    image_size: Annotated[
        str, typer.Option(metavar="|".join(_SIZES), help="Width and height in pixels.")
    ] = "320x240",
    start: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help="When the drive begins, such as 2026-11-23T08:00; otherwise its stamps begin "
            "at 0.",
        ),
    ] = None,
    day: Annotated[
        int,
        typer.Option(
            min=1,
            max=MOST_DAYS,
            help="The world on this day: from one day to the next, some things are moved, "
            "removed, added and swapped.",
        ),
    ] = 1,
    bad_frames: Annotated[
        float,
        typer.Option(
            metavar="SHARE",
            min=0,
            max=1,
            help="Share of bad frames, as from broken sensors: covered, torn, frozen, ...",
        ),
    ] = 0.0,
) -> None:
    """Record a simulated drive through a world.

    The recording is a folder in the layout of the TUM RGB-D benchmark with detections.json, or a
    ROS bag. `hypermap map` reads both. The ground truth map is saved, too.

    Examples:
        hypermap simulate lab -o lab
        hypermap map lab --detections lab/detections.json -o mine.hmap
        hypermap evaluate mine.hmap lab/truth.hmap
        hypermap simulate lab -o rough --errors rough --sensor tof
        hypermap simulate office.yaml -o office.bag --errors none --image-size 640x480
        hypermap simulate demo -o monday --start 2026-11-23T08:00
        hypermap simulate demo -o tuesday --start 2026-11-24T08:00 --day 2
    """
    from hypermap.formats import save_map
    from hypermap.simulation import SimulatedRecording, ground_truth, varied, write_bag, write_tum
    from hypermap.simulation.days import day_of, seed_of_day

    is_bag = output.suffix == ".bag"
    truth_file = output.with_suffix(".truth.hmap") if is_bag else output / "truth.hmap"
    if output.exists() or truth_file.exists():
        taken = output if output.exists() else truth_file
        raise HypermapError(f"{taken} exists already; name a new one")
    begin = 0.0 if start is None else _stamp(start)
    today = day_of(varied(world_of(world), seed), day, seed)
    described = today.world
    recording = SimulatedRecording.with_errors(
        described,
        errors_of(errors, sensor),
        camera=_camera(image_size),
        rate=rate,
        bad_frames=bad_frames,
        seed=seed if day == 1 else seed_of_day(seed, day),
        start=begin,
    )
    with counting("simulating", len(recording), "frame") as count:
        (write_bag if is_bag else write_tum)(recording, output, on_frame=count)
    truth = ground_truth(described)
    truth.metadata["world"] = described.name
    save_map(truth, truth_file)
    frames, seconds = counted(len(recording), "frame"), recording.info().duration
    say(f"recording  {output}: {frames} in {seconds:.0f} s")
    if recording.faults:
        kinds = Counter(recording.faults.values())
        listed = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
        say(f"bad frames {len(recording.faults)}: {listed}")
    say(f"true map   {truth_file}: {counted(len(described.objects), 'object')}")
    for change in today.changes:
        say(f"since day {day - 1}  {_told(change)}")


def _stamp(text: str) -> float:
    from hypermap.questions.times import parse_moment

    return parse_moment(text, "--start").timestamp()


def _told(change: WorldChange) -> str:
    """Return what happened to one thing, in words."""
    thing = change.after or change.before
    assert thing is not None
    if change.kind == "door":
        said = "a door opened" if change.after is None else "a door closed"
    else:
        said = f"{thing.label} {change.kind}"
    places = [f"{one.place[0]:.2f}, {one.place[1]:.2f}" for one in _ends(change)]
    return f"{said}: {' to '.join(places)}"


def _ends(change: WorldChange) -> list[WorldObject]:
    return [one for one in (change.before, change.after) if one is not None]


def world_of(name: str) -> World:
    """Return a world that comes with the package, or the one that a file describes.

    Raises:
        HypermapError: If there is none, its file is wrong, or nothing drives through it.
    """
    from hypermap.simulation.world import built_in_world, load_world

    is_file = Path(name).suffix in (".yaml", ".yml") or Path(name).is_file()
    if not is_file:
        return built_in_world(name)
    world = load_world(name)
    if world.drive is None:
        raise FormatError(
            "is missing, so there is nothing to record; give at least its waypoints",
            path=name,
            key="drive",
        )
    return world


def errors_of(name: str, sensor: str) -> Errors:
    """Return a level of errors with a depth camera, or what a file lays over "fair"."""
    from hypermap.mapping.overrides import override, read_overrides
    from hypermap.simulation.levels import errors_of_level

    path = Path(name)
    if path.suffix in (".yaml", ".yml") or path.is_file():
        return override(errors_of_level("fair", sensor), read_overrides(path), path=path)
    return errors_of_level(name, sensor)


def _camera(size: str) -> Camera:
    from hypermap.perception.frame import Camera
    from hypermap.simulation.render import DEFAULT_CAMERA as SMALL

    if size not in _SIZES:
        raise HypermapError(f"--image-size {size}: images are {' or '.join(_SIZES)}")
    k = _SIZES[size]
    K = SMALL.K.copy()
    K[:2, 2] += 0.5  # from the corner of the first pixel, not its center
    K[:2] *= k
    K[:2, 2] -= 0.5
    return Camera(K, k * SMALL.width, k * SMALL.height)
