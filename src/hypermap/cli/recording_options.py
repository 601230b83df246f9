"""Options for what a recording does not say itself.

Their defaults and checks are those of `RecordingOptions`; here is only how they are spelled.
"""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.recordings import RecordingOptions

PANEL = "What the recording does not say itself"


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
        "Pose of the recording's world in the map (meters, radians), or a 4 x 4 "
        "matrix in row-major order. Needed if its z axis does not point up.",
        "--world-transform",
    ),
    "depth_scale": _Option(float, "UNITS", "Units of the depth images per meter."),
    "map_frame": _Option(
        str,
        "FRAME",
        "Fixed frame of the map, z up: by default `map`, or the root of the tf tree of a bag.",
    ),
    "camera_frame": _Option(str, "FRAME", "Optical frame of the camera in a bag."),
    "depth_topic": _Option(str, "TOPIC", "Topic of the depth images."),
    "cloud_topic": _Option(str, "TOPIC", "Topic of organized point clouds: instead of depth."),
    "color_topic": _Option(str, "TOPIC", "Topic of the color images."),
    "camera_info_topic": _Option(str, "TOPIC", "Topic of the camera info."),
    "detections_topic": _Option(str, "TOPIC", "Topic of detections."),
    "map_topic": _Option(str, "TOPIC", "Topic of an occupancy map."),
    "max_time_difference": _Option(
        float, "SECONDS", "Largest time difference between matching images."
    ),
    "max_pose_gap": _Option(
        float, "SECONDS", "Longest gap between two poses that is interpolated."
    ),
}
_LISTS = {"intrinsics", "map_T_world"}


def takes_recording_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options above to a command, which gets them as the argument `recording_options`."""

    @functools.wraps(command)
    def wrapper(**arguments: Any) -> None:
        given = {name: arguments.pop(name) for name in OPTIONS}
        command(recording_options=_recording_options(given), **arguments)

    # The class itself is not imported here: that would take longer than showing the help.
    signature = inspect.signature(command, locals={"RecordingOptions": Any}, eval_str=True)
    own = [p for p in signature.parameters.values() if p.name != "recording_options"]
    added = [_parameter(name, option) for name, option in OPTIONS.items()]
    wrapper.__signature__ = signature.replace(parameters=own + added)  # type: ignore[attr-defined]
    wrapper.__annotations__ = {p.name: p.annotation for p in own + added}
    return wrapper


def _parameter(name: str, option: _Option) -> inspect.Parameter:
    flag = option.flag or f"--{name.replace('_', '-')}"
    declared = typer.Option(
        flag, metavar=option.metavar, help=option.help, rich_help_panel=PANEL, show_default=False
    )
    return inspect.Parameter(
        name,
        inspect.Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[option.kind | None, declared],
    )


def _recording_options(given: dict[str, Any]) -> RecordingOptions:
    from hypermap.recordings import RecordingOptions

    values = {name: value for name, value in given.items() if value is not None}
    for name in _LISTS & values.keys():
        values[name] = _numbers(values[name], name)
    try:
        return RecordingOptions(**values)
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
