"""Snippets: a query of the page as Python code and as a shell command, to copy."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from typing import TypeAlias

Snippets: TypeAlias = dict[str, str]
Point: TypeAlias = Sequence[float]


def snippets_at(path: str, point: Point, frame: str | None, layers: Iterable[str]) -> Snippets:
    """Return snippets for a query at a point."""
    python = (
        f"{_open_lines(path)}for layer in {list(layers)!r}:\n"
        f"    print(layer, *hypermap.labels_at(layer, {_pair(point)}{_in_frame(frame)}))\n"
    )
    return _snippets(python, path, f"--at={_text(point)}", frame)


def snippets_in_area(
    path: str, corners: Sequence[Point], frame: str | None, grids: Sequence[str]
) -> Snippets:
    """Return snippets for a query in a polygon."""
    python = (
        f"import shapely\n{_open_lines(path)}area = {_polygon(corners)}\n"
        f"for found in hypermap.objects(area=area{_in_frame(frame)}):\n"
        "    print(found.layer, found.object.id, found.object.name)\n"
    )
    if grids:
        python += (
            f"for layer in {list(grids)!r}:\n"
            f"    print(layer, len(hypermap.labels_in(layer, area{_in_frame(frame)})), 'cells')\n"
        )
    return _snippets(python, path, f"--in={' '.join(map(_text, corners))}", frame)


def snippets_for_search(
    path: str,
    name: str | None,
    *,
    near: str | Point | None = None,
    within: float | None = None,
    inside: str | None = None,
    corners: Sequence[Point] | None = None,
    frame: str | None = None,
) -> Snippets:
    """Return snippets for a search for objects, the nearest first."""
    asked_near = near if near is None or isinstance(near, str) else _text(near)
    where = {
        "near": None if near is None else repr(near) if isinstance(near, str) else _pair(near),
        "within": None if within is None else _number(within),
        "inside": None if inside is None else repr(inside),
        "area": None if corners is None else "area",
        "frame_id": None if frame is None else repr(frame),
    }
    given = [] if name is None else [repr(name)]
    given += [f"{key}={value}" for key, value in where.items() if value is not None]
    shown = "" if near is None else ", found.distance"
    opened = _open_lines(path)
    if corners is not None:
        opened = f"import shapely\n{opened}area = {_polygon(corners)}\n"
    python = (
        f"{opened}for found in hypermap.objects({', '.join(given)}):\n"
        f"    print(found.layer, found.object.id, found.point_xy{shown})\n"
    )
    options = {
        "name": name,
        "near": asked_near,
        "within": where["within"],
        "inside": inside,
        "in": None if corners is None else " ".join(map(_text, corners)),
    }
    words = [f"--{key}={value}" for key, value in options.items() if value is not None]
    return _snippets(python, path, *words, frame)


def snippets_for_evidence(path: str, layer: str, number: int) -> Snippets:
    """Return snippets for the evidence of an object."""
    python = (
        f"{_open_lines(path)}seen = hypermap[{layer!r}].evidence_of({number})\n"
        "for view, score, shape in zip(seen.views, seen.scores, seen.footprints):\n"
        "    print(seen.stamps[view], score, shape)\n"
    )
    return _snippets(python, path, f"--id={number}", f"--layer={layer}", "--evidence", None)


def snippets_for_path(path: str, start: Point, goal: Point, radius: float) -> Snippets:
    """Return snippets for a path between two places, for a robot of a radius [m]."""
    settings = f", PathSettings(robot_radius={_number(radius)})" if radius else ""
    needed = "PathSettings, Planner" if radius else "Planner"
    python = (
        f"from hypermap import open_map\nfrom hypermap.paths import {needed}\n\n"
        f"planner = Planner(open_map({path!r}){settings})\n"
        f"path = planner.path({_pair(start)}, {_pair(goal)})\n"
        "print(path.length, path.points_xy, [room.name for room in path.rooms])\n"
    )
    words = ["hypermap", "path", _file(path), _text(start), _text(goal)]
    words += [f"--robot-radius={_number(radius)}"] if radius else []
    return {"python": python, "command": shlex.join(words)}


def snippets_for_question(path: str, question: str, place: Point | None) -> Snippets:
    """Return snippets for a question in English, asked from a place."""
    pose = "" if place is None else f", Pose2D({', '.join(map(_number, place))})"
    python = (
        f"from hypermap import {'' if place is None else 'Pose2D, '}open_map\n"
        "from hypermap.questions.asking import answer_to\n\n"
        f"answer = answer_to(open_map({path!r}), {question!r}{pose})\n"
        "print(answer.count, [found.object.id for found in answer.objects])\n"
    )
    words = ["hypermap", "ask", _file(path), question]
    words += [] if place is None else [f"--pose={_text(place)}"]
    return {"python": python, "command": shlex.join(words)}


def _file(path: str) -> str:
    return f"./{path}" if path.startswith("-") else path


def _open_lines(path: str) -> str:
    return f"from hypermap import open_map\n\nhypermap = open_map({path!r})\n"


def _snippets(python: str, path: str, *options: str | None) -> Snippets:
    *asked, frame = options
    words = ["hypermap", "query", _file(path)]
    words += [option for option in asked if option is not None]
    if frame is not None:
        words.append(f"--frame={frame}")
    return {"python": python, "command": shlex.join(words)}


def _in_frame(frame: str | None) -> str:
    return "" if frame is None else f", frame_id={frame!r}"


def _polygon(corners: Sequence[Point]) -> str:
    points = ", ".join(f"({_number(x)}, {_number(y)})" for x, y in corners)
    return f"shapely.Polygon([{points}])"


def _pair(point: Point) -> str:
    return f"[{_number(point[0])}, {_number(point[1])}]"


def _text(point: Point) -> str:
    return f"{_number(point[0])},{_number(point[1])}"


def _number(value: float) -> str:
    """Return a number exactly, in its shortest form."""
    return repr(int(value)) if value == int(value) and abs(value) < 1e15 else repr(float(value))
