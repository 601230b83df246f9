"""Options for data that a recording does not contain.

Their defaults and checks are those of `RecordingOptions`; here is only how they are spelled.
"""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from hypermap.cli.added_options import with_options
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.perception.recording import PendingRecording
    from hypermap.recordings import RecordingOptions

PANEL = "What the recording does not contain"


class _Option(NamedTuple):
    kind: type
    metavar: str
    help: str
    flag: str = ""


# One per field of RecordingOptions; "numbers" are parsed here.
OPTIONS = {
    "every": _Option(int, "N", "Use every N-th frame."),
    "intrinsics": _Option(str, "FX,FY,CX,CY", "Intrinsics of the depth images in pixels."),
    "map_T_world": _Option(
        str,
        "X,Y,Z,ROLL,PITCH,YAW",
        "Pose of the recording's world in the map (meters, radians), or a 3 x 4 or 4 x 4 "
        "matrix in row-major order. Needed if its z axis does not point up.",
        "--world-transform",
    ),
    "depth_scale": _Option(float, "UNITS", "Units of the depth images per meter."),
    "register": _Option(
        bool,
        "",
        "Register depth to color: move it into the color camera, known from a bag's camera info "
        "and tf, or from the two options below.",
    ),
    "color_intrinsics": _Option(
        str, "FX,FY,CX,CY", "Intrinsics of the color images in pixels, for --register."
    ),
    "color_T_depth": _Option(
        str,
        "X,Y,Z,ROLL,PITCH,YAW",
        "Pose of the depth camera in the color camera (meters, radians), or a 3 x 4 or 4 x 4 "
        "matrix in row-major order, for --register.",
        "--depth-transform",
    ),
    "map_frame": _Option(
        str,
        "FRAME",
        "Fixed frame of the map, z up: by default `map`, or the root of the tf tree of a bag.",
    ),
    "camera_frame": _Option(str, "FRAME", "Optical frame of the camera in a bag."),
    "depth_topic": _Option(str, "TOPIC", "Topic of the depth images."),
    "cloud_topic": _Option(str, "TOPIC", "Topic of organized point clouds, instead of depth."),
    "color_topic": _Option(str, "TOPIC", "Topic of the color images."),
    "camera_info_topic": _Option(str, "TOPIC", "Topic of the camera info."),
    "detections_topic": _Option(str, "TOPIC", "Topic of detections."),
    "map_topic": _Option(str, "TOPIC", "Topic of an occupancy map."),
    "rotate": _Option(
        int,
        "DEGREES",
        "Turn images clockwise: 90, 180 or 270. For a camera mounted upside down or on its side.",
    ),
    "pose_convention": _Option(
        str,
        "CONVENTION",
        "What the recorded poses are: `optical` (default: x right, y down, z forward), `body` (x "
        "forward, z up), `frd` (x forward, z down), `opengl` (y up, z backward), `world-to-camera` "
        "(the inverse), `w-first` (quaternions), `mirrored` (as of ICL-NUIM).",
    ),
    "time_offset": _Option(
        str,
        "auto|SECONDS",
        "Delay from an image's stamp to the stamp of its pose; `auto` measures it.",
    ),
    "level": _Option(
        str,
        "auto",
        "Level the world by the visible floor, and move the floor to z = 0.",
    ),
    "max_time_difference": _Option(
        float, "SECONDS", "Largest time difference between matching images."
    ),
    "max_pose_gap": _Option(
        float, "SECONDS", "Longest gap between two poses that is interpolated."
    ),
}
_MEASURED = ("level", "time_offset")  # which `auto` leaves to the frames
_LISTS = {"intrinsics", "map_T_world", "color_intrinsics", "color_T_depth"}


@dataclass(frozen=True)
class RecordingRequest:
    """How to read a recording, as the user said it.

    Attributes:
        options: what was given.
        measured: "level" and "time_offset", if they are to be measured from the frames.
    """

    options: RecordingOptions
    measured: frozenset[str] = frozenset()

    def open(self, path: Path) -> tuple[PendingRecording, RecordingOptions]:
        """Return the recording, and the options with what was measured.

        Raises:
            HypermapError: If there is none, or it cannot be read.
        """
        from hypermap.cli.measured_options import measured_options
        from hypermap.recordings import open_recording

        options = self.options
        if self.measured:
            options = measured_options(path, options, self.measured)
        return open_recording(path, options), options


def takes_recording_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options above to a command, which gets them as the argument `request`."""

    @functools.wraps(command)
    def wrapper(**arguments: Any) -> None:
        given = {name: arguments.pop(name) for name in OPTIONS}
        command(request=_request(given), **arguments)

    signature = inspect.signature(command, eval_str=True)
    own = [p for p in signature.parameters.values() if p.name != "request"]
    added = [_parameter(name, option) for name, option in OPTIONS.items()]
    return with_options(wrapper, own + added)


def _parameter(name: str, option: _Option) -> inspect.Parameter:
    flag = option.flag or f"--{name.replace('_', '-')}"
    declared = typer.Option(
        flag,
        metavar=option.metavar or None,
        help=option.help,
        rich_help_panel=PANEL,
        show_default=False,
    )
    return inspect.Parameter(
        name,
        inspect.Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[option.kind | None, declared],
    )


def _request(given: dict[str, Any]) -> RecordingRequest:
    from hypermap.recordings import RecordingOptions

    values = {name: value for name, value in given.items() if value is not None}
    measured = frozenset(name for name in _MEASURED if values.get(name) == "auto")
    for name in measured:
        del values[name]
    if "level" in values:
        raise HypermapError(f"--level {values['level']}: the only choice is auto")
    if "time_offset" in values:
        (values["time_offset"], *more) = _numbers(values["time_offset"], "time_offset")
        if more:
            raise HypermapError("--time-offset: expected one number of seconds, or auto")
    for name in _LISTS & values.keys():
        values[name] = _numbers(values[name], name)
    try:
        return RecordingRequest(RecordingOptions(**values), measured)
    except ValueError as error:
        raise HypermapError(_with_flags(str(error))) from None


def _numbers(text: str, name: str) -> Sequence[float]:
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        numbers = [math.nan]
    if not all(map(math.isfinite, numbers)):
        metavar = OPTIONS[name].metavar
        raise HypermapError(_with_flags(f"{name} {text!r}: expected numbers {metavar}"))
    return tuple(numbers)


def _with_flags(message: str) -> str:
    """Return a message in which a field is called as the option is spelled."""
    for name, option in OPTIONS.items():
        if message.startswith(name):
            return (option.flag or f"--{name.replace('_', '-')}") + message[len(name) :]
    return message
