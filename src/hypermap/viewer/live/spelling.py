"""A question of the page as Python and as a call of the command line, to copy."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from typing import TypeAlias

Spelled: TypeAlias = dict[str, str]
Point: TypeAlias = Sequence[float]


def spell_at(path: str, point: Point, frame: str | None, layers: Iterable[str]) -> Spelled:
    """Return how to ask what every layer says at a point."""
    python = (
        f"{_opened(path)}for layer in {list(layers)!r}:\n"
        f"    print(layer, *hypermap.labels_at(layer, {_pair(point)}{_in_frame(frame)}))\n"
    )
    return _both(python, path, f"--at={_text(point)}", frame)


def spell_area(
    path: str, corners: Sequence[Point], frame: str | None, grids: Sequence[str]
) -> Spelled:
    """Return how to ask what is in a polygon."""
    polygon = ", ".join(f"({_number(x)}, {_number(y)})" for x, y in corners)
    python = (
        f"import shapely\n{_opened(path)}area = shapely.Polygon([{polygon}])\n"
        f"for found in hypermap.objects(area=area{_in_frame(frame)}):\n"
        "    print(found.layer, found.object.id, found.object.name)\n"
    )
    if grids:
        python += (
            f"for layer in {list(grids)!r}:\n"
            f"    print(layer, len(hypermap.labels_in(layer, area{_in_frame(frame)})), 'cells')\n"
        )
    return _both(python, path, f"--in={' '.join(map(_text, corners))}", frame)


def spell_find(path: str, name: str, near: Point | None, frame: str | None) -> Spelled:
    """Return how to ask where things of a name are, the nearest first."""
    where = "" if near is None else f", near={_pair(near)}"
    shown = "" if near is None else ", found.distance"
    python = (
        f"{_opened(path)}for found in hypermap.objects({name!r}{where}{_in_frame(frame)}):\n"
        f"    print(found.layer, found.object.id, found.point_xy{shown})\n"
    )
    options = [f"--name={name}"] + ([] if near is None else [f"--near={_text(near)}"])
    return _both(python, path, *options, frame)


def spell_evidence(path: str, layer: str, number: int) -> Spelled:
    """Return how to look behind an object."""
    python = (
        f"{_opened(path)}seen = hypermap[{layer!r}].evidence_of({number})\n"
        "for view, score, shape in zip(seen.views, seen.scores, seen.footprints):\n"
        "    print(seen.stamps[view], score, shape)\n"
    )
    return _both(python, path, f"--id={number}", f"--layer={layer}", "--evidence", None)


def _opened(path: str) -> str:
    return f"from hypermap import open_map\n\nhypermap = open_map({path!r})\n"


def _both(python: str, path: str, *options: str | None) -> Spelled:
    *asked, frame = options
    words = ["hypermap", "query", f"./{path}" if path.startswith("-") else path]
    words += [option for option in asked if option is not None]
    if frame is not None:
        words.append(f"--frame={frame}")
    return {"python": python, "command": shlex.join(words)}


def _in_frame(frame: str | None) -> str:
    return "" if frame is None else f", frame_id={frame!r}"


def _pair(point: Point) -> str:
    return f"[{_number(point[0])}, {_number(point[1])}]"


def _text(point: Point) -> str:
    return f"{_number(point[0])},{_number(point[1])}"


def _number(value: float) -> str:
    """Return a number exactly, and as short as that can be."""
    return repr(int(value)) if value == int(value) and abs(value) < 1e15 else repr(float(value))
