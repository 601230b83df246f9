"""`hypermap info`: what is inside a map or a recording."""

from __future__ import annotations

import functools
import logging
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.options import AsJson, name_of
from hypermap.cli.recording_options import RecordingRequest, takes_recording_options
from hypermap.cli.terminal import facts, note, out, say, say_json, table
from hypermap.core.errors import HypermapError
from hypermap.text import counted, is_address, printable

if TYPE_CHECKING:
    from rich.table import Table

    from hypermap.core.hypermap import Hypermap
    from hypermap.core.layer import Layer
    from hypermap.core.semantic import SemanticLayer
    from hypermap.core.value_layer import ValueLayer
    from hypermap.mapping.preflight import Finding
    from hypermap.perception.frame import RgbdFrame
    from hypermap.perception.recording import RecordingInfo
    from hypermap.recordings import RecordingOptions

_COLORS = 3  # color images that are decoded to see whether they can be
_LINE = 1000  # characters of a sentence about a recording, in which its names may occur


@takes_recording_options
def command(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="PATH", readable=False, show_default=False, help="A map or a recording."
        ),
    ],
    request: RecordingRequest,
    as_json: AsJson = False,
) -> None:
    """Show what is inside a map, or inside a recording and what it lacks for mapping.

    -v also shows all settings that made the map.

    For a recording, this checks some frames: whether the floor is level at z = 0, the depth unit is
    right, depth is registered to color, poses and images share a clock, and images are upright.
    Each problem is printed with its effect on a map and the option that fixes it.

    The exit code is 0 even if something is missing for mapping. With --json, the list "missing" is
    empty if `hypermap map` can map the recording without further options.

    Examples:
        hypermap info lab.hmap
        hypermap info lab.hmap -v
        hypermap info drive.bag
    """
    show: Callable[[dict[str, Any]], None]
    if is_map(path):
        from hypermap.formats import open_map

        hypermap = open_map(path)
        if hypermap.history is not None:
            hypermap.history.revisions()  # which says if a part of it is lost
        content = describe_map(hypermap)
        is_long = logging.getLogger("hypermap").isEnabledFor(logging.INFO)
        show = functools.partial(show_map, with_settings=is_long)
    else:
        recording, options = request.open(path)
        info = recording.info()
        content = describe_recording(info)
        content["checks"] = [] if info.frames == 0 else _checks(path, options, content)
        show = show_recording
    if as_json:
        say_json({"path": name_of(path), **content})
    else:
        show(content)


def is_map(path: Path) -> bool:
    """Return whether a path looks like a map rather than a recording."""
    if is_address(path):
        return True
    if path.is_dir():
        return (path / "hmap_config.yaml").is_file()
    name = path.with_suffix("") if path.suffix.lower() == ".bak" else path
    return name.suffix.lower() in {".hmap", ".yaml", ".yml"}


def describe_map(hypermap: Hypermap) -> dict[str, Any]:
    """Return what `--json` prints of a map."""
    return {
        "kind": "map",
        "base_frame": hypermap.base_frame,
        "frames": [
            {"parent": t.parent, "child": t.child, "pose": [t.pose.x, t.pose.y, t.pose.yaw]}
            for t in hypermap.frames
        ],
        "layers": [_describe_layer(layer) for layer in hypermap.layers],
        "metadata": dict(hypermap.metadata),
    }


def _describe_layer(layer: Layer) -> dict[str, Any]:
    from hypermap.core.notes_layer import NotesLayer
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.core.semantic import SemanticLayer
    from hypermap.core.value_layer import ValueLayer

    extent = layer.extent()
    content: dict[str, Any] = {
        "name": layer.name,
        "class": layer.class_name,
        "frame_id": layer.frame_id,
        "extent": None if extent.is_empty else list(extent.bounds),
        "summary": layer.summary(),
    }
    if isinstance(layer, SemanticLayer):
        content |= _describe_objects(layer)
    elif isinstance(layer, OccupancyLayer) and layer.grid is not None:
        grid = layer.grid
        content["width"], content["height"] = grid.width, grid.height
        content["resolution"] = grid.resolution
        content["origin"] = [grid.origin.x, grid.origin.y, grid.origin.yaw]
        content["cells"] = layer.counts()
    elif isinstance(layer, ValueLayer) and layer.grid is not None:
        content |= _describe_values(layer)
    elif isinstance(layer, NotesLayer):
        files = [each for note in layer for each in note.attachments]
        content["notes"] = len(layer)
        content["files"] = len(files)
        content["missing_files"] = [each.name for each in files if not each.is_there]
    return content


def _describe_objects(layer: SemanticLayer) -> dict[str, Any]:
    return {
        "objects": len(layer),
        "names": _counts(layer.names),
        "observations": _observations(layer),
        "pictures": sum(map(len, layer.pictures_by_id().values())),
        "rejected": [
            {"position": r.position, "name": r.name, "reason": r.reason} for r in layer.rejected
        ],
    }


def _describe_values(layer: ValueLayer) -> dict[str, Any]:
    found = layer.summary_in(layer.extent())
    return {
        "quantity": layer.quantity,
        "unit": layer.unit,
        "min": found.least,
        "mean": found.mean,
        "max": found.most,
        "samples": None if layer.samples is None else len(layer.samples),
        "made_by": layer.made_by,
    }


def _observations(layer: SemanticLayer) -> int | None:
    """Return how many observations are kept behind the objects; None if that cannot be read."""
    from hypermap.core.errors import HypermapError

    try:
        evidence = layer.evidence()
    except HypermapError:
        return None
    return 0 if evidence is None else len(evidence)


def _counts(names: Any) -> dict[str, int]:
    """Return how often each name occurs, the most frequent first."""
    counts = Counter(map(str, names))
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def _layers(layers: Sequence[dict[str, Any]]) -> Table:
    """Return a table with a row for each layer."""
    rows = table("layer", "class", "frame", "extent in meters", "content")
    for layer in layers:
        names = (printable(layer[key]) for key in ("name", "class", "frame_id"))
        rows.add_row(*names, _extent(layer["extent"]), _content(layer))
    return rows


def show_map(content: dict[str, Any], with_settings: bool) -> None:
    """Print a map as text."""
    out().print(_layers(content["layers"]))
    for layer in content["layers"]:
        if layer.get("names"):
            counts = [f"{count} {printable(name)}" for name, count in layer["names"].items()]
            say(f"\n{printable(layer['name'])}: {', '.join(counts)}")
        for entry in layer.get("rejected", ()):
            name, reason = printable(entry["name"]), printable(entry["reason"], 200)
            say(f"rejected: object {entry['position']} ({name}): {reason}")
        for name in layer.get("missing_files", ()):
            say(f"missing: {printable(name, 60)}, attached to a note, is not next to the map")
    for frame in content["frames"]:
        x, y, yaw = frame["pose"]
        child, parent = printable(frame["child"]), printable(frame["parent"])
        say(f"frame {child} is in {parent} at x {x:g}, y {y:g}, yaw {yaw:g}")
    made_with = dict(content["metadata"])
    if "floor" in made_with:
        say(f"floor: {printable(made_with.pop('floor'))}")
    connectors = made_with.pop("connectors", ())
    for entry in connectors if isinstance(connectors, list) else ():
        if isinstance(entry, dict):
            name = entry.get("name") or entry.get("kind") or "lift"
            say(f"{printable(name)} leads to {printable(entry.get('to'))}")
    for drive in made_with.pop("drives", ()):
        say(_drive(drive))
    if made_with:
        # Settings come in groups, one for each stage.
        short = {key: value for key, value in made_with.items() if not _has_groups(value)}
        say("\nmade with")
        out().print(facts(_flat(made_with if with_settings else short)))
        if len(short) < len(made_with) and not with_settings:
            hidden = len(_flat(made_with)) - len(_flat(short))
            note(f"and {counted(hidden, 'line')} of settings; show them with -v")


def _drive(drive: Any) -> str:
    if not isinstance(drive, dict):
        return f"drive {printable(drive)}"
    times = [printable(drive[key]) for key in ("began", "ended") if key in drive]
    when = f" from {' to '.join(times)}" if times else ""
    frames = drive.get("frames")
    many = counted(frames, "frame") if isinstance(frames, int) else f"{printable(frames)} frames"
    return f"drive {printable(drive.get('name'))}{when}: {many}"


def _has_groups(value: Any) -> bool:
    return isinstance(value, dict) and any(isinstance(inner, dict) for inner in value.values())


def _extent(bounds: list[float] | None) -> str:
    if bounds is None:
        return "empty"
    x0, y0, x1, y1 = bounds
    return f"{x1 - x0:.1f} x {y1 - y0:.1f} from ({x0:.1f}, {y0:.1f})"


def _content(layer: dict[str, Any]) -> str:
    if "names" in layer:
        kinds = counted(len(layer["names"]), "class", "classes")
        kept = [(layer[f"{kind}s"], kind) for kind in ("observation", "picture")]
        behind = " and ".join(counted(count, kind) for count, kind in kept if count)
        objects = f"{counted(layer['objects'], 'object')} of {kinds}"
        return f"{objects}, with {behind}" if behind else objects
    if "cells" in layer:
        cells = ", ".join(f"{label} {count}" for label, count in layer["cells"].items())
        return f"{layer['width']} x {layer['height']} cells of {layer['resolution']:g} m: {cells}"
    return printable(layer.get("summary", ""), 200)


def _flat(values: dict[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Return names and values; what belongs together and holds no more groups is one row."""
    rows: list[tuple[str, str]] = []
    for key, value in values.items():
        name = printable(f"{prefix}{key}", 60)
        if not isinstance(value, dict):
            rows.append((name, printable(value, 100)))
        elif _has_groups(value):
            rows += _flat(value, f"{prefix}{key}.")
        else:
            pairs = [f"{printable(k, 60)} {printable(v, 100)}" for k, v in value.items()]
            rows.append((name, ", ".join(pairs)))
    return rows


def describe_recording(info: RecordingInfo) -> dict[str, Any]:
    """Return what `--json` prints of a recording."""
    from hypermap.perception.detectors.origin import has_recorded_detections, no_detections

    content = asdict(info)
    content.pop("path")
    if not info.missing and not has_recorded_detections(info):
        content["missing"] = (no_detections(info),)
    return {"kind": "recording", **content}


class _Tried:
    """The frames that were checked, and why some of them cannot be used.

    Attributes:
        good: how many can be mapped.
        bad: reasons why others cannot.
        colors: reasons why color images of the good ones cannot be read.
    """

    def __init__(self) -> None:
        self.good = 0
        self.bad: list[str] = []
        self.colors: list[str] = []

    def add(self, frame: RgbdFrame) -> None:
        """Count a frame that can be mapped; of the first ones, the color is decoded."""
        self.good += 1
        if self.good <= _COLORS:
            try:
                _ = frame.color
            except HypermapError as error:
                self.colors.append(str(error))

    def add_bad(self, _stamp: float, error: HypermapError) -> None:
        """Count a frame that cannot."""
        self.bad.append(str(error))

    @property
    def are_too_many(self) -> bool:
        """Whether mapping would give up, if all frames are like these."""
        from hypermap.mapping.recording_to_map import MAX_BAD

        return len(self.bad) > MAX_BAD * (len(self.bad) + self.good)

    def sentence(self) -> str:
        """Say how many cannot be used, and why the first one cannot."""
        tried = counted(len(self.bad) + self.good, "frame")
        return f"{len(self.bad)} of {tried} tried cannot be used; the first one: {self.bad[0]}"


def _checks(path: Path, options: RecordingOptions, content: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what the pre-flight check finds in some frames all over, and in the first ones.

    Of those that cannot be used, `content` says it: as missing, if mapping would give up.
    """
    from hypermap.cli.measured_options import IN_A_ROW, SPREAD, usable_frames
    from hypermap.mapping.preflight import Preflight

    found: list[Finding] = []
    preflight = Preflight(
        found.append,
        map_T_world=options.world_pose(),
        pose_convention=options.pose_convention,
    )
    tried = _Tried()
    for frame in usable_frames(path, options, SPREAD, tried.add_bad):
        preflight.add_mapped(frame)
        tried.add(frame)
    if tried.bad:
        content["missing" if tried.are_too_many else "notes"] += (tried.sentence(),)
    if tried.colors:
        what = "no --detector can find objects in color images like the first one"
        content["notes"] += (f"{what}: {tried.colors[0]}",)
    if not tried.good:
        return []
    for frame in islice(usable_frames(path, options), IN_A_ROW):
        preflight.add(frame)
    return [
        {"check": f.check, "is_wrong": f.is_wrong, "measured": f.measured}
        | ({"effect": f.effect, "remedy": f.remedy} if f.is_wrong else {})
        for f in preflight.findings()
    ]


def show_recording(content: dict[str, Any]) -> None:
    """Print a recording as text."""
    size = content["image_size"]
    overview = [
        ("format", content["format"]),
        ("frames", str(content["frames"])),
        ("duration", f"{content['duration']:.1f} s"),
        ("images", "none" if size is None else f"{size[0]} x {size[1]} pixels"),
    ]
    out().print(facts(overview))
    rows = table("stream", "kind", "count", "used for", right=("count",))
    for stream in content["streams"]:
        name, kind = printable(stream["name"], 60), printable(stream["kind"], 60)
        rows.add_row(name, kind, str(stream["count"]), stream["use"] or "-")
    say()
    out().print(rows)
    for check in content["checks"]:
        if check["is_wrong"]:
            problem = "; ".join(check[part] for part in ("measured", "effect", "remedy"))
            say(f"wrong: {check['check']}: {printable(problem, _LINE)}", style="bold")
        else:
            say(f"checked: {check['check']}: {printable(check['measured'], _LINE)}")
    for text in content["notes"]:
        say(f"note: {printable(text, _LINE)}")
    for text in content["missing"]:
        say(f"missing: {printable(text, _LINE)}", style="bold")
    if not content["missing"]:
        say("Nothing is missing: `hypermap map` can make a map of it.")
