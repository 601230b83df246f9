"""What broken sensors, localization and detectors leave in a recording, and what must come of it.

Each fault spoils a small, good recording in the layout of the TUM RGB-D benchmark. What may come
of it: a map, which says how many frames were left out and why, or what looks odd; or one
error that says what is wrong.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.mapping.config import profile
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detectors.sources import detections_from_file
from hypermap.recordings import RecordingOptions, open_recording
from hypermap.simulation import SimulatedRecording, write_tum
from hypermap.simulation.render import DEFAULT_CAMERA
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, Wall, World, WorldObject

FRAMES = 12
_WORLD = World(
    "bad sensors",
    FloorPlan((0, 0, 6, 4)),
    objects=(
        WorldObject("table", (3, 2)),
        WorldObject("chair", (4.2, 2.7)),
        WorldObject("plant", (2.6, 3.3)),
    ),
    walls=(Wall(rectangle=(0, 0, 6, 4)),),
    drive=DrivePlan(((0.5, 2), (1.6, 2)), speed=0.2),
)


def write_good_recording(folder: Path) -> None:
    """Write the recording that each fault spoils: a new folder of `FRAMES` frames."""
    write_tum(SimulatedRecording(_WORLD, camera=DEFAULT_CAMERA.every(4), rate=2, seed=1), folder)


@dataclass(frozen=True)
class Outcome:
    """What came of a recording.

    Attributes:
        map: the map; None if there was an error.
        unusable: how many frames were left out.
        reported: the error, or what was logged as a warning, in lines.
    """

    map: Hypermap | None
    unusable: int
    reported: str


@dataclass(frozen=True)
class BadSensor:
    """A fault, and what must come of it.

    Attributes:
        name: of the fault.
        spoil: changes the good recording in the given folder.
        reported: words that the error or the warnings must hold; empty if nothing can be, as the
            frames look like good ones.
        unusable: frames that must be left out; None for an error in place of a map.
        options: with which the recording is read.
    """

    name: str
    spoil: Callable[[Path], None]
    reported: str = ""
    unusable: int | None = 0
    options: dict[str, Any] = field(default_factory=dict)


def map_of(folder: Path, **options: Any) -> Outcome:
    """Map a recording as `hypermap map` does; anything but a HypermapError is let through."""
    lines = _Lines()
    logging.getLogger("hypermap").addHandler(lines)
    try:
        recording = open_recording(folder, _options(options))
        source = detections_from_file(folder / "detections.json")
        result = map_recording(recording, source, profile("default"))
    except HypermapError as error:
        return Outcome(None, 0, str(error))
    finally:
        logging.getLogger("hypermap").removeHandler(lines)
    return Outcome(result, result.metadata["frames"]["unusable"], "\n".join(lines.said))


def _options(options: dict[str, Any]) -> RecordingOptions:
    try:
        return RecordingOptions(**options)
    except ValueError as error:  # which the command line says as it is
        raise HypermapError(str(error)) from None


class _Lines(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(record.getMessage())


def fault_of(sensor: BadSensor, outcome: Outcome) -> str | None:
    """Return in words how an outcome differs from what must come of a fault; else None."""
    if sensor.unusable is None:
        if outcome.map is not None:
            return f"a map where an error was due; reported: {outcome.reported or 'nothing'}"
    elif outcome.map is None:
        return f"an error in place of a map: {outcome.reported}"
    elif outcome.unusable != sensor.unusable:
        return (
            f"{outcome.unusable} frames left out in place of {sensor.unusable}: {outcome.reported}"
        )
    if sensor.reported not in outcome.reported:
        return f"{sensor.reported!r} was not reported, but: {outcome.reported or 'nothing'}"
    if not sensor.reported and outcome.reported:
        return f"reported without a reason: {outcome.reported}"
    return endless_objects(outcome)


def endless_objects(outcome: Outcome) -> str | None:
    """Return in words which objects reach to infinity; None if none do."""
    objects = [] if outcome.map is None else outcome.map.objects()
    odd = [found.object.name for found in objects if not _is_finite(found.object.footprint)]
    return f"objects that reach to infinity: {odd}" if odd else None


def _is_finite(footprint: BaseGeometry) -> bool:
    return bool(np.isfinite(footprint.bounds).all())


Pixels = NDArray[Any]


def _depth(change: Callable[[Pixels], Pixels], numbers: Any = (5,)) -> Callable[[Path], None]:
    return _images("depth", change, numbers)


def _images(
    kind: str, change: Callable[[Pixels], Pixels], numbers: Any = (5,)
) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        files = sorted((folder / kind).iterdir())
        for i in numbers:
            with Image.open(files[i]) as image:
                pixels = np.array(image)
            Image.fromarray(np.ascontiguousarray(change(pixels))).save(files[i])

    return spoil


def _file(kind: str, change: Callable[[bytes], bytes | None], i: int = 5) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        path = sorted((folder / kind).iterdir())[i]
        content = change(path.read_bytes())
        path.unlink()
        if content is not None:
            path.write_bytes(content)

    return spoil


def _lines(
    name: str, change: Callable[[list[list[str]]], list[list[str]]]
) -> Callable[[Path], None]:
    """Change the words of a list's lines; the comments stay."""

    def spoil(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        comments = [line for line in lines if line.startswith("#")]
        words = change([line.split() for line in lines if not line.startswith("#")])
        (folder / name).write_text("\n".join([*comments, *map(" ".join, words)]) + "\n")

    return spoil


def _word(name: str, row: int, column: int, word: str) -> Callable[[Path], None]:
    def change(rows: list[list[str]]) -> list[list[str]]:
        rows[row][column] = word
        return rows

    return _lines(name, change)


def _found(change: Callable[[list[dict[str, Any]]], Any], i: int = 5) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        path = folder / "detections.json"
        content = json.loads(path.read_text())
        key = sorted(content["frames"], key=float)[i]
        content["frames"][key] = change(content["frames"][key])
        path.write_text(json.dumps(content))

    return spoil


def _swap(folder: Path) -> None:
    """Swap the lists of depth and color images."""
    depth, color = (folder / "depth.txt").read_text(), (folder / "rgb.txt").read_text()
    (folder / "depth.txt").write_text(color)
    (folder / "rgb.txt").write_text(depth)


def _frozen(folder: Path) -> None:
    for kind in ("depth", "rgb"):
        files = sorted((folder / kind).iterdir())
        for file in files[4:8]:
            file.write_bytes(files[3].read_bytes())


def _shifted(seconds: float, rows_from: int = 0) -> Callable[[list[list[str]]], list[list[str]]]:
    """Return what adds to the stamps of a list from a row on."""

    def change(rows: list[list[str]]) -> list[list[str]]:
        late = [[f"{float(stamp) + seconds:.6f}", *rest] for stamp, *rest in rows[rows_from:]]
        return rows[:rows_from] + late

    return change


def _box(name: str = "table", score: float = 0.9, box: Any = (10, 10, 40, 40)) -> dict[str, Any]:
    return {"box": list(box), "name": name, "score": score}


def _text(name: str, change: Callable[[str], str]) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        (folder / name).write_text(change((folder / name).read_text()))

    return spoil


def _remove_depth(folder: Path) -> None:
    for path in (folder / "depth").iterdir():
        path.unlink()


def _some(share: float) -> Callable[[Pixels], Pixels]:
    """Return what leaves a share of the pixels, and no depth elsewhere."""
    return lambda d: np.where(np.random.default_rng(1).random(d.shape) < share, d, 0).astype(
        d.dtype
    )


def _constant(below: int) -> Callable[[Pixels], Pixels]:
    """Return what makes all pixels so much less than the most that they can be."""
    return lambda d: np.full_like(d, np.iinfo(d.dtype).max - below)


def _noise(depth: Pixels) -> Pixels:
    return np.random.default_rng(1).integers(2000, 40_000, depth.shape).astype(depth.dtype)


def _same(change: Callable[[list[str]], list[str]], row: int | None = None) -> Any:
    """Return what changes the words of one line, or of all."""
    return lambda rows: [change(r) if row in (None, i) else r for i, r in enumerate(rows)]


def _nothing(_folder: Path) -> None:
    """The fault lies in the options alone."""


ALL = range(FRAMES)
FIFTH = "frame 2.500000 left out: "
SENSORS = (
    # Depth.
    BadSensor("units 5000 times too large", _nothing, "--depth-scale", None, {"depth_scale": 1.0}),
    BadSensor("units 10 times too large", _nothing, "--depth-scale", 0, {"depth_scale": 500.0}),
    BadSensor("units far too small", _nothing, "nearer than 0.1 m", 0, {"depth_scale": 1e6}),
    BadSensor("a frame of zeros", _depth(np.zeros_like), FIFTH + "its depth image is empty", 1),
    BadSensor("a frame of 65535", _depth(_constant(0)), "its depth image is empty", 1),
    BadSensor("a frame of 65534", _depth(_constant(1)), "its depth is saturated", 1),
    BadSensor("all frames of zeros", _depth(np.zeros_like, ALL), "depth image is empty", None),
    BadSensor("hardly any depth", _depth(_some(0.02), ALL), "was the camera covered"),
    BadSensor("hardly any depth once", _depth(_some(0.02))),
    BadSensor("a frame of noise", _depth(_noise)),
    BadSensor("depth of 8 bits", _depth(lambda d: (d >> 8).astype(np.uint8)), "16 bits", 1),
    BadSensor(
        "colors for depth", _depth(lambda d: np.stack([d] * 3, 2).astype(np.uint8)), "RGB", 1
    ),
    BadSensor("a depth image cut off", _file("depth", lambda b: b[: len(b) // 2]), "truncated", 1),
    BadSensor("an empty file", _file("depth", lambda _: b""), "not a picture", 1),
    BadSensor("a page in place of an image", _file("depth", lambda _: b"<html>404"), "picture", 1),
    BadSensor("a depth image missing", _file("depth", lambda _: None), "there is no such file", 1),
    BadSensor("all depth images missing", _remove_depth, "12 of 12 depth images are missing", None),
    BadSensor("upside down", _depth(lambda d: d[::-1, ::-1], ALL), "mounted upside down"),
    BadSensor("frozen images", _frozen),
    BadSensor("a smaller image", _depth(lambda d: d[::2, ::2]), "40 x 30 pixels, but", 1),
    BadSensor("another size midway", _depth(lambda d: d[::2, ::2], range(8, 12)), "40 x 30", 4),
    BadSensor("another size early", _depth(lambda d: d[::2, ::2], range(4, 12)), "too many", None),
    # Color, which mapping does not need where detections are recorded.
    BadSensor("color of another size", _images("rgb", lambda c: c[::2, ::2], ALL), "40 x 30", None),
    BadSensor("a color image cut off", _file("rgb", lambda b: b[: len(b) // 2])),
    BadSensor("a color image missing", _file("rgb", lambda _: None)),
    BadSensor("color and depth swapped", _swap, "expected a depth image of 16 bits", None),
    # Stamps.
    BadSensor("a stamp NaN", _word("depth.txt", 5, 0, "nan"), "not finite", None),
    BadSensor("another clock", _lines("groundtruth.txt", _shifted(1.7e9)), "has a pose", None),
    BadSensor("the future, midway", _lines("depth.txt", _shifted(1e10, 6)), "6 of 12 depth images"),
    BadSensor("backward", _lines("depth.txt", lambda rows: rows[::-1])),
    BadSensor(
        "a jump back",
        _lines("depth.txt", _shifted(-3.0, 8)),
        "left out 4 of 12 depth images, without",
    ),
    BadSensor("all stamps equal", _lines("depth.txt", _same(lambda r: ["1.0", r[1]])), "11 of 12"),
    BadSensor(
        "two stamps equal",
        _lines("depth.txt", lambda rows: [*rows, [rows[5][0], rows[6][1]]]),
        "left out 1 of 13 depth images, without",
    ),
    # Poses.
    BadSensor("late", _lines("groundtruth.txt", _shifted(0.4)), "left out 1 of 12 frames, outside"),
    BadSensor(
        "ending early",
        _lines("groundtruth.txt", lambda r: r[:6]),
        "left out 6 of 12 frames, outside",
    ),
    BadSensor("with a gap", _lines("groundtruth.txt", lambda r: r[:3] + r[8:]), "5 of 12 frames"),
    BadSensor("none", _text("groundtruth.txt", lambda _: "# none\n"), "there are no poses", None),
    BadSensor("NaN", _word("groundtruth.txt", 5, 1, "nan"), "1 pose of groundtruth.txt left out"),
    BadSensor("infinite", _word("groundtruth.txt", 5, 1, "inf"), "line 8: there is a num", None),
    BadSensor("1e12 m away", _word("groundtruth.txt", 5, 1, "1e12"), FIFTH + "its pose is", 1),
    BadSensor("100 km away", _word("groundtruth.txt", 5, 1, "1e5"), "is a pose far off", 1),
    BadSensor("2 m away", _word("groundtruth.txt", 5, 1, "3.0")),
    BadSensor(
        "quaternion of zeros",
        _lines("groundtruth.txt", _same(lambda r: [*r[:4], *"0000"], 5)),
        "line 8: the quaternion is zero",
        None,
    ),
    BadSensor(
        "quaternions of length 10",
        _lines("groundtruth.txt", _same(lambda r: [*r[:4], *(str(10 * float(q)) for q in r[4:])])),
    ),
    BadSensor("quaternion NaN", _word("groundtruth.txt", 5, 7, "nan"), "1 pose of groundtruth"),
    BadSensor(
        "too few words",
        _lines("groundtruth.txt", _same(lambda r: r[:6], 5)),
        "line 8: expected 8 numbers",
        None,
    ),
    # Intrinsics.
    BadSensor("focal length 0", _nothing, "positive", None, {"intrinsics": (0, 60, 40, 30)}),
    BadSensor("focal length < 0", _nothing, "positive", None, {"intrinsics": (-60, 60, 40, 30)}),
    BadSensor("NaN", _nothing, "finite", None, {"intrinsics": (60, 60, float("nan"), 30)}),
    BadSensor(
        "of images of 640 x 480",
        _nothing,
        "for another image size",
        None,
        {"intrinsics": (525.0, 525.0, 319.5, 239.5)},
    ),
    # Detections.
    BadSensor("none in a frame", _found(lambda _: [])),
    BadSensor("outside the image", _found(lambda _: [_box(box=(-90, -90, -10, -10))])),
    BadSensor("without area", _found(lambda _: [_box(box=(10, 10, 10, 10))])),
    BadSensor("inside out", _found(lambda _: [_box(box=(40, 40, 10, 10))]), "xmax", None),
    BadSensor("box NaN", _found(lambda _: [_box(box=(np.nan, 1, 2, 2))]), "finite", None),
    BadSensor("box of 1e30", _found(lambda _: [_box(box=(0, 0, 1e30, 2))]), "32768", None),
    BadSensor("score NaN", _found(lambda _: [_box(score=np.nan)]), "finite", None),
    BadSensor("score in percent", _found(lambda _: [_box(score=95)]), "equal to 1", None),
    BadSensor("names of odd letters", _found(lambda f: [*f, _box("\x1b[31m\0<b>\u202e")])),
    BadSensor("names of 5,000 letters", _found(lambda found: [*found, _box("x" * 5000)])),
    BadSensor("half a letter", _found(lambda _: [_box("\ud800")]), "Invalid JSON", None),
    BadSensor("name empty", _found(lambda _: [_box("")]), "at least 1 character", None),
    BadSensor(
        "10,000 at once",
        _found(lambda _: [_box(score=0.5 + i / 3e4) for i in range(10_000)]),
        "dropped 9800 detections",
    ),
    BadSensor(
        "of another image",
        _text("detections.json", lambda text: text.replace('"0.0"', '"0.3"')),
        "no entry for the image at 0.000000",
    ),
    BadSensor("cut off", _text("detections.json", lambda t: t[:700]), "Invalid JSON: EOF", None),
)
