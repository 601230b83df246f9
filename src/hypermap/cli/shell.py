"""`hypermap shell`: query a map line by line."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.options import name_of
from hypermap.cli.terminal import BAD_INPUT, complain, describe, say
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.console.commands import Console
    from hypermap.core.hypermap import Hypermap


def command(
    path: Annotated[
        Path | None,
        typer.Argument(metavar="[MAP]", readable=False, show_default=False, help="A map to open."),
    ] = None,
) -> None:
    """Query a map interactively, with the commands of the map server and of `hypermap query`.

    The Tab key completes commands, options, layers, names and files. The arrow keys recall earlier
    lines. Without a terminal, lines are read from standard input. A line that fails does not stop
    the others, but sets the exit code to 2.

    Examples:
        hypermap shell lab.hmap
        echo 'getCoords semantic sink' | hypermap shell lab.hmap
        echo 'query --name chair --near sink --within 2' | hypermap shell lab.hmap
        echo 'query --id 7 --evidence --json' | hypermap shell lab.hmap
    """
    from hypermap.console.commands import Console, Leave
    from hypermap.formats import open_map

    if path is None:
        console = Console(describe_evidence=_describe_evidence)
    else:
        console = Console(
            open_map(path), source=name_of(path), describe_evidence=_describe_evidence
        )
    is_typed = sys.stdin.isatty()
    all_went_well = True
    with contextlib.suppress(Leave):
        for line in _typed_lines(console) if is_typed else sys.stdin:
            all_went_well &= _answer(console, line)
    if not (is_typed or all_went_well):
        raise typer.Exit(BAD_INPUT)


def _describe_evidence(hypermap: Hypermap, layer: str, number: int) -> dict[str, Any]:
    """Return the evidence for an object; its code is loaded on demand."""
    from hypermap.viewer.live.object_evidence import describe_evidence

    return describe_evidence(hypermap, layer, number)


def _answer(console: Console, line: str) -> bool:
    """Print the answer to a line and return whether there was one."""
    try:
        answer = console.run(line)
    except (HypermapError, OSError) as error:
        complain(describe(error))
        return False
    if answer:
        say(answer)
    return True


def _typed_lines(console: Console) -> Iterator[str]:
    """Yield what is typed at the terminal, until the end of input; Ctrl-C drops a line."""
    from hypermap.console.prompt import Prompt

    prompt = Prompt(console)
    say("Type help for the commands, exit or quit to leave.", style="dim")
    with contextlib.suppress(EOFError):
        while True:
            with contextlib.suppress(KeyboardInterrupt):
                yield prompt.line()
