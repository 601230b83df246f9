"""Snippets: a query of the page as Python code and as a shell command, to copy."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

Snippets: TypeAlias = dict[str, str]
Point: TypeAlias = Sequence[float]


@dataclass(frozen=True)
class AskedMap:
    """The map that a snippet asks.

    Attributes:
        path: its file.
        version: it is asked as it was in this version; None for as it is.
    """

    path: str
    version: int | None = None

    def imports(self, *names: str) -> str:
        """Return the import statements that `opened` needs, and names of the package."""
        past = "" if self.version is None else "from hypermap.history import at_version\n"
        return f"from hypermap import {', '.join([*names, 'open_map'])}\n{past}"

    @property
    def opened(self) -> str:
        """The Python expression that opens it."""
        opened = f"open_map({self.path!r})"
        return opened if self.version is None else f"at_version({opened}, {self.version})"

    def command(self, *options: str) -> str:
        """Return the `hypermap query` command with some options."""
        past = () if self.version is None else (f"--as-of=v{self.version}",)
        return shlex.join(["hypermap", "query", _file(self.path), *options, *past])


def snippets_at(
    asked: AskedMap, point: Point, frame: str | None, layers: Iterable[str]
) -> Snippets:
    """Return snippets for a query at a point."""
    python = (
        f"{_open_lines(asked)}for layer in {list(layers)!r}:\n"
        f"    print(layer, *hypermap.labels_at(layer, {_pair(point)}{_in_frame(frame)}))\n"
    )
    return _snippets(python, asked, f"--at={_text(point)}", frame=frame)


def snippets_in_area(
    asked: AskedMap, corners: Sequence[Point], frame: str | None, grids: Sequence[str]
) -> Snippets:
    """Return snippets for a query in a polygon."""
    python = (
        f"import shapely\n{_open_lines(asked)}area = {_polygon(corners)}\n"
        f"for found in hypermap.objects(area=area{_in_frame(frame)}):\n"
        "    print(found.layer, found.object.id, found.object.name)\n"
    )
    if grids:
        python += (
            f"for layer in {list(grids)!r}:\n"
            f"    print(layer, len(hypermap.labels_in(layer, area{_in_frame(frame)})), 'cells')\n"
        )
    return _snippets(python, asked, f"--in={' '.join(map(_text, corners))}", frame=frame)


def snippets_for_search(
    asked: AskedMap,
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
    opened = _open_lines(asked)
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
    return _snippets(python, asked, *words, frame=frame)


def snippets_for_evidence(asked: AskedMap, layer: str, number: int) -> Snippets:
    """Return snippets for the evidence of an object."""
    python = (
        f"{_open_lines(asked)}seen = hypermap[{layer!r}].evidence_of({number})\n"
        "for view, score, shape in zip(seen.views, seen.scores, seen.footprints):\n"
        "    print(seen.stamps[view], score, shape)\n"
    )
    return _snippets(python, asked, f"--id={number}", f"--layer={layer}", "--evidence")


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


def snippets_for_question(asked: AskedMap, question: str, place: Point | None) -> Snippets:
    """Return snippets for a question in English, asked from a place.

    There is no command that asks how a map was.
    """
    pose = "" if place is None else f", Pose2D({', '.join(map(_number, place))})"
    python = (
        f"{asked.imports(*[] if place is None else ['Pose2D'])}"
        "from hypermap.questions.asking import answer_to\n\n"
        f"answer = answer_to({asked.opened}, {question!r}{pose})\n"
        "print(answer.count, [found.object.id for found in answer.objects])\n"
    )
    if asked.version is not None:
        return {"python": python}
    words = ["hypermap", "ask", _file(asked.path), question]
    words += [] if place is None else [f"--pose={_text(place)}"]
    return {"python": python, "command": shlex.join(words)}


def _file(path: str) -> str:
    return f"./{path}" if path.startswith("-") else path


def _open_lines(asked: AskedMap) -> str:
    return f"{asked.imports()}\nhypermap = {asked.opened}\n"


def _snippets(python: str, asked: AskedMap, *options: str, frame: str | None = None) -> Snippets:
    where = () if frame is None else (f"--frame={frame}",)
    return {"python": python, "command": asked.command(*options, *where)}


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
