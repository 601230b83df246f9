"""The commands of the console: a line of text in, an answer in text out.

Source: INTERFACES, section 4: the commands and their spelling are those of the first Hypermap.
`query` and `ask` are new, and ask what `hypermap query` and `hypermap ask` ask.
"""

from __future__ import annotations

import json
import math
import os
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.console.answer import document, plain, shown
from hypermap.console.asked import lines, understood
from hypermap.console.evidence import DescribeEvidence, add_evidence, plain_evidence
from hypermap.console.options import help_text, parse
from hypermap.console.questions import answered
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.hypermap import Hypermap
from hypermap.formats import open_map
from hypermap.formats.backup import save_with_backup
from hypermap.questions.asking import answer_to, parse_pose
from hypermap.text import counted, fit_for_json

_EXAMPLES = """\
Examples:
  query --at 3,-2
  query --name cup --nearest --from 1,1
  query --name chair --near sink --within 2
  query --name "potted plant" --json"""


class Leave(Exception):
    """The user said `exit` or `quit`."""


@dataclass(frozen=True)
class Command:
    """What a command is called with, and what it does.

    Attributes:
        words: its arguments as the help shows them.
        meaning: what the help says.
        run: takes the console and the arguments and returns the answer.
    """

    words: str
    meaning: str
    run: Callable[[Console, list[str]], str]

    def takes(self, arguments: list[str]) -> bool:
        """Return whether the number of arguments is right."""
        if self.words.startswith("[") and "..." in self.words:
            return True
        names = self.words.replace("...", "").split()
        if self.words.endswith("..."):
            return len(arguments) >= len(names) and (len(arguments) - len(names)) % 2 == 0
        optional = sum(name.startswith("[") for name in names)
        return len(names) - optional <= len(arguments) <= len(names)


class Console:
    """A map that is asked line by line.

    Attributes:
        hypermap: the map; a load that fails leaves it as it was.
        republish: called when the user asks to publish everything again; returns the answer.
        source: where the map was loaded from, as in JSON; None if nowhere.
        describe_evidence: returns the evidence for an object; None where there is none to ask for.
        automap: called when the user asks to show what a camera covers; returns the answer.
    """

    def __init__(
        self,
        hypermap: Hypermap | None = None,
        republish: Callable[[], str] = lambda: "nothing is published here",
        source: str | None = None,
        describe_evidence: DescribeEvidence | None = None,
        automap: Callable[[], str] = lambda: "automap is for the console of `hypermap serve`",
    ) -> None:
        self.hypermap = Hypermap() if hypermap is None else hypermap
        self.republish = republish
        self.source = source
        self.describe_evidence = describe_evidence
        self.automap = automap

    def run(self, line: str) -> str:
        """Carry out one line and return the answer; empty for an empty line.

        Raises:
            HypermapError: If the line is not understood or cannot be carried out.
            Leave: If the line is `exit` or `quit`.
        """
        words = split(line)
        if not words:
            return ""
        name, arguments = words[0], words[1:]
        command = _command(name)
        if not command.takes(arguments):
            raise HypermapError(f"usage: {name} {command.words}".rstrip())
        return command.run(self, arguments)

    def _help(self, arguments: list[str]) -> str:
        if arguments:
            return _help_of(arguments[0])
        calls = {f"{name} {command.words}".strip(): command for name, command in COMMANDS.items()}
        width = max(map(len, calls))
        lines = [f"{call:<{width}}  {command.meaning}" for call, command in calls.items()]
        lines.append("`help query` lists the options of a question.")
        lines.append('Put words with spaces in "double quotes"; a backslash escapes.')
        return "\n".join(lines)

    def _load(self, arguments: list[str]) -> str:
        self.hypermap = open_map(_path(arguments[0]))
        self.source = arguments[0]
        return f"loaded {counted(len(self.hypermap.layers), 'layer')} from {arguments[0]}"

    def _save(self, arguments: list[str]) -> str:
        path = _path(arguments[0])
        if path.suffix.lower() in (".yaml", ".yml") or path.is_dir():
            raise HypermapError(f"{path}: save writes an archive; give a name that ends in .hmap")
        save_with_backup(self.hypermap, path)
        return f"saved {counted(len(self.hypermap.layers), 'layer')} to {arguments[0]}"

    def _get_string(self, arguments: list[str]) -> str:
        layer, *coordinates = arguments
        return str(self.hypermap.label_at(layer, _points(coordinates))[0])

    def _get_strings(self, arguments: list[str]) -> str:
        layer, *corners = arguments
        hits = self.hypermap.labels_in(layer, _area(corners))
        lines = zip(_lines(hits.points_xy), hits.values, strict=True)
        return "\n".join(f"{place} {label}" for place, label in lines)

    def _get_coords(self, arguments: list[str]) -> str:
        layer, label = arguments
        return "\n".join(_lines(self.hypermap.find(layer, label)))

    def _get_coords_area(self, arguments: list[str]) -> str:
        layer, label, *corners = arguments
        return "\n".join(_lines(self.hypermap.find(layer, label, _area(corners))))

    def _query(self, arguments: list[str]) -> str:
        given = parse(arguments)
        found = answered(self.hypermap, given)
        rows = found.rows
        if given.get("--evidence"):
            if self.describe_evidence is None:
                raise HypermapError("--evidence is for `hypermap query` and `hypermap shell`")
            add_evidence(self.hypermap, rows, self.describe_evidence)
        if given.get("--json"):
            answer = document(self.source, self.hypermap, rows)
            return json.dumps(fit_for_json(answer), indent=2, default=str)
        said = [plain(shown(found)), plain_evidence(rows)]
        return "\n".join(filter(None, [*said, *found.remarks]))

    def _ask(self, arguments: list[str]) -> str:
        words = arguments[2:] if arguments[:1] == ["--pose"] else arguments
        if not words:
            raise HypermapError("usage: ask [--pose X,Y[,YAW]] QUESTION, as: ask where is a cup?")
        asker = None if words is arguments else parse_pose(arguments[1])
        answer = answer_to(self.hypermap, " ".join(words), asker)
        parts = [f"{part}: {text}" for part, text in understood(answer.query)]
        return "\n".join([*parts, *lines(self.hypermap, answer)])

    def _path(self, arguments: list[str]) -> str:
        # Compiled loops take their time, and few lines ask for paths.
        from hypermap.console.paths import lines as path_lines
        from hypermap.console.paths import plan
        from hypermap.paths import PathSettings, Planner
        from hypermap.paths.settings import STAND_OFF

        start, goal, *radius = arguments
        try:
            settings = PathSettings(float(radius[0]) if radius else 0.0)
        except ValueError:
            raise HypermapError(f"{radius[0]!r} is not a radius in meters, such as 0.3") from None
        return "\n".join(path_lines(plan(Planner(self.hypermap, settings), start, goal, STAND_OFF)))

    def _republish(self, _: list[str]) -> str:
        return self.republish()

    def _automap(self, _: list[str]) -> str:
        return self.automap()

    def _clear(self, _: list[str]) -> str:
        self.hypermap, self.source = Hypermap(), None
        return "the map is empty now"

    def _get_layer_count(self, _: list[str]) -> str:
        return str(len(self.hypermap.layers))

    def _exit(self, _: list[str]) -> str:
        raise Leave


COMMANDS = {
    "help": Command("[COMMAND]", "this list, or more about a command", Console._help),
    "load": Command("FILE", "open an .hmap archive in place of this map", Console._load),
    "loadConfig": Command("FILE", "open a configuration file in a folder", Console._load),
    "save": Command(
        "FILE", "save this map as an .hmap archive; what was there stays as FILE.bak", Console._save
    ),
    "getString": Command("LAYER X Y", "what is at a point", Console._get_string),
    "getStrings": Command("LAYER X Y X Y X Y ...", "what is in an area", Console._get_strings),
    "getCoords": Command("LAYER STRING", "where something is", Console._get_coords),
    "getCoordsArea": Command(
        "LAYER STRING X Y X Y X Y ...", "where it is in an area", Console._get_coords_area
    ),
    "query": Command("[OPTION ...]", "ask a question, as --name cup --near sink", Console._query),
    "ask": Command("[WORD ...]", "ask in English, as: ask where is the sofa?", Console._ask),
    "path": Command(
        "FROM TO [RADIUS]",
        'the way from a point X,Y, room or object as "cup 3" to another, for a robot',
        Console._path,
    ),
    "republish": Command("", "publish all layers again", Console._republish),
    "automap": Command(
        "", "wait for an area on /polygon, and show what a camera covers of it", Console._automap
    ),
    "clear": Command("", "forget this map", Console._clear),
    "getLayerCount": Command("", "how many layers there are", Console._get_layer_count),
    "exit": Command("", "leave", Console._exit),
    "quit": Command("", "leave, too", Console._exit),
}


def _help_of(name: str) -> str:
    command = _command(name)
    call = f"{name} {command.words}".rstrip()
    more = f"\n{help_text()}\n{_EXAMPLES}" if name == "query" else ""
    return f"{call}: {command.meaning}{more}"


def _command(name: str) -> Command:
    if name not in COMMANDS:
        raise HypermapError(f"unknown command {name!r}; {did_you_mean(name, COMMANDS)}")
    return COMMANDS[name]


def split(line: str) -> list[str]:
    r"""Return the words of a line; double quotes hold blanks, a backslash escapes.

    Raises:
        HypermapError: If a quote or an escape is not finished.

    >>> split('getCoords semantic "potted plant"')
    ['getCoords', 'semantic', 'potted plant']
    >>> split('load my\\ map.hmap')
    ['load', 'my map.hmap']
    """
    lexer = shlex.shlex(line, posix=True)
    lexer.whitespace_split = True
    lexer.commenters = ""
    lexer.quotes = lexer.escapedquotes = '"'
    try:
        return list(lexer)
    except ValueError as error:
        raise HypermapError(f"{str(error).lower()} in: {line.strip()}") from None


def _path(word: str) -> Path:
    """Return a path; `~` is the user's home."""
    return Path(os.path.expanduser(word))  # noqa: PTH111 - unlike Path's, it leaves ~nobody alone


def _points(words: list[str]) -> NDArray[np.float64]:
    numbers = []
    for word in words:
        try:
            numbers.append(float(word))
        except ValueError:
            raise HypermapError(f"{word!r} is not a number") from None
        if not math.isfinite(numbers[-1]):
            raise HypermapError(f"{word!r} is not a finite number")
    return np.reshape(numbers, (-1, 2))


def _area(words: list[str]) -> shapely.Polygon:
    area = shapely.Polygon(_points(words))
    if not area.is_valid or area.area == 0:
        raise HypermapError("the corners do not enclose an area, or the outline crosses itself")
    return area


def _lines(points_xy: NDArray[np.float64]) -> list[str]:
    """Return each point as "x y", to the millimeter."""
    return [f"{x:.3f} {y:.3f}" for x, y in points_xy.round(3) + 0.0]
