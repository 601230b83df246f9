"""The options of a query: the options of `hypermap query`, also in the shell."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from hypermap.core.errors import HypermapError, did_you_mean

AN_AREA = 'a rectangle X0,Y0,X1,Y1, corners "X,Y X,Y X,Y", or WKT'


@dataclass(frozen=True)
class Option:
    """One option of a query.

    Attributes:
        takes: its value, as the help shows it; empty for a switch.
        help: its description.
        kind: type of the value.
        least: the smallest number that it takes; None for any.
        repeats: whether it may be given several times.
        also: other names of it.
        panel: the heading that it is under in the help of `hypermap query`; empty for none.
        default: what the help shows as its default; empty for nothing.
    """

    takes: str
    help: str
    kind: type = str
    least: int | None = None
    repeats: bool = False
    also: tuple[str, ...] = ()
    panel: str = ""
    default: str = ""


_WHAT, _WHERE, _WHEN = "What", "Where", "When"

OPTIONS = {
    "--at": Option("X,Y", "What is at this point?", panel=_WHERE),
    "--in": Option(
        "AREA|ROOM",
        f"Only this area: {AN_AREA}; or the rooms of this name or kind. Alone: what is in it?",
        panel=_WHERE,
    ),
    "--name": Option(
        "NAME",
        "Only objects with this name: may be repeated, for any of them.",
        repeats=True,
        panel=_WHAT,
    ),
    "--value": Option(
        "N", "Where is this value? For objects, the id.", float, also=("--id",), panel=_WHAT
    ),
    "--nearest": Option("", "Only the nearest one.", bool, panel=_WHAT),
    "-k": Option("K", "The K nearest ones.", int, least=1, panel=_WHAT),
    "--from": Option(
        "X,Y", "Where --nearest and -k start to measure.", panel=_WHERE, default="0,0"
    ),
    "--by": Option(
        "air|path",
        "How --nearest and -k measure: air (straight line), or path (around walls).",
        panel=_WHERE,
        default="air",
    ),
    "--robot-radius": Option(
        "METERS", "Radius of the robot: for --by path.", float, least=0, panel=_WHERE
    ),
    "--near": Option("NAME|X,Y", "Only objects near this one.", panel=_WHERE),
    "--within": Option("METERS", "Largest distance of --near.", float, least=0, panel=_WHERE),
    "--inside": Option("NAME|AREA", "Only objects whose center is inside this one.", panel=_WHERE),
    "--like": Option(
        "TEXT", 'The 5 objects, or -k, that look most like this: "a place to sit".', panel=_WHAT
    ),
    "--embedder": Option(
        "FOLDER",
        "Encoders of images and texts: those that `map` used.",
        panel=_WHAT,
        default="HYPERMAP_EMBEDDER of the environment",
    ),
    "--with": Option("NAME", "Only rooms in which there is an object of this name.", panel=_WHAT),
    "--above": Option(
        "N",
        "Where a measured value is above this; with --measured, by the mean.",
        float,
        panel=_WHAT,
    ),
    "--below": Option(
        "N",
        "Where a measured value is below this; with --measured, by the mean.",
        float,
        panel=_WHAT,
    ),
    "--measured": Option(
        "LAYER",
        "The mean of these measured values in each room, or within half a meter of each other "
        "object: the lowest first.",
        panel=_WHAT,
    ),
    "--since": Option(
        "TIME",
        "Only from this time on: objects seen since yesterday, monday, 2026-11-20T10:00, 7d.",
        panel=_WHEN,
    ),
    "--new-since": Option("TIME", "Only objects first seen at this time or later.", panel=_WHEN),
    "--not-seen-for": Option(
        "TIME", "Only objects that were not seen for this long: 7d, 2h.", panel=_WHEN
    ),
    "--as-of": Option(
        "TIME",
        "The map as it was: yesterday, 2026-11-20T10:00, 7d, or v3 for version 3.",
        panel=_WHEN,
    ),
    "--last-seen": Option(
        "", "Show when objects were last seen, the latest first.", bool, panel=_WHEN
    ),
    "--evidence": Option("", "Show the evidence for the objects.", bool, panel=_WHAT),
    "--layer": Option("NAME", "Only this layer: may be repeated.", repeats=True),
    "--frame": Option(
        "FRAME",
        "Frame of the coordinates: of points and areas in the query.",
        default="the map's base frame",
    ),
    "--json": Option("", "Print JSON, for programs.", bool),
}
_BY_NAME = {name: first for first in OPTIONS for name in (first, *OPTIONS[first].also)}


def option_of(word: str) -> Option | None:
    """Return the option that a word names."""
    return OPTIONS[_BY_NAME[word]] if word in _BY_NAME else None


def parse(words: Sequence[str]) -> dict[str, Any]:
    """Return what is given in a line, by the options' names; lists of those that repeat.

    Raises:
        HypermapError: If an option is unknown, has no value, or one that it does not take.

    >>> parse(["--name", "cup", "--name=bottle", "-k", "2"])
    {'--name': ['cup', 'bottle'], '-k': 2}
    """
    given: dict[str, Any] = {}
    rest = iter(words)
    for word in rest:
        name, equals, value = word.partition("=") if word.startswith("--") else (word, "", "")
        option = option_of(name)
        if option is None:
            known = did_you_mean(name, _BY_NAME)
            raise HypermapError(f"a query has no option {name!r}; {known}")
        name = _BY_NAME[name]
        if option.takes == "":
            if equals:
                raise HypermapError(f"{name} takes no value")
            given[name] = True
            continue
        value = value if equals else _next(rest, name, option)
        if option.repeats:
            given.setdefault(name, []).append(value)
        else:
            given[name] = _converted(value, name, option)
    return given


def _next(rest: Iterator[str], name: str, option: Option) -> str:
    value = next(rest, None)
    if value is None:
        raise HypermapError(f"{name} needs a value: {name} {option.takes}")
    return value


def _converted(text: str, name: str, option: Option) -> Any:
    try:
        value = option.kind(text)
    except ValueError:
        number = "whole number" if option.kind is int else "number"
        raise HypermapError(f"{name} {text!r}: expected a {number}") from None
    if option.least is not None and not value >= option.least:
        raise HypermapError(f"{name} {text}: expected at least {option.least}")
    return value


def help_text() -> str:
    """Return a line for each option."""
    calls = [" ".join([*option.also, name, option.takes]) for name, option in OPTIONS.items()]
    width = max(map(len, calls))
    lines = zip(calls, OPTIONS.values(), strict=True)
    return "\n".join(f"  {call:<{width}}  {option.help}" for call, option in lines)
