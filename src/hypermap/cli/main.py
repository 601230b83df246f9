"""The command `hypermap`, and the single place where errors become one line and an exit code."""

from __future__ import annotations

import importlib
import inspect
import itertools
import re
import sys
from collections.abc import Sequence
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from hypermap import __version__
from hypermap.cli.renamed import takes_old_names
from hypermap.cli.signals import ended_by_signals
from hypermap.cli.terminal import (
    BAD_INPUT,
    INTERRUPTED,
    NO_MEMORY,
    NOBODY_READS,
    complain,
    describe,
    finish_writing,
    prepare_streams,
    set_verbosity,
)
from hypermap.cli.verbosity import Quiet, Verbose, takes_verbosity
from hypermap.core.errors import HypermapError

_MODULES = {
    "demo": "demo",
    "map": "map_",
    "batch": "batch",
    "detectors": "detectors",
    "info": "info",
    "query": "query",
    "ask": "ask",
    "view": "view",
    "render": "render",
    "rooms": "rooms",
    "values": "values",
    "notes": "notes",
    "path": "path",
    "connect": "connect",
    "align": "align",
    "merge": "merge",
    "diff": "diff",
    "changes": "changes",
    "history": "history",
    "expire": "expire",
    "frontiers": "frontiers",
    "migrate": "migrate",
    "push": "push",
    "pull": "pull",
    "sites": "sites",
    "log": "log",
    "thin": "thin",
    "refused": "refused",
    "find": "find",
    "api": "api",
    "evaluate": "evaluate",
    "convert": "convert",
    "simulate": "simulate",
    "experiment": "experiment",
    "shell": "shell",
    "serve": "serve",
    "mcp": "mcp",
    "live": "live",
    "rviz": "rviz",
    "ros1-env": "ros1_env",
    "warm-up": "warm_up",
    "bench": "bench",
}


class _Commands(TyperGroup):
    """The commands, each loaded when it is used; their list needs no more than their docstrings."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        for name in _MODULES:
            if name not in self.commands:
                self.commands[name] = TyperCommand(name, help=_help_of(_module_of(name)))
        return super().list_commands(ctx)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the name, the command and the arguments that the user asks for."""
        for before, word in itertools.pairwise(args):
            if not word and not before.startswith("-"):  # pathlib would take it for this folder
                raise HypermapError(
                    f"{args[0]}: an argument is empty; is a variable of the shell not set?"
                )
        if args[0] in _MODULES:
            self.commands[args[0]] = _command_of(args[0])
        else:
            self.list_commands(ctx)  # of which the message suggests one
        return super().resolve_command(ctx, args)


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"hypermap {__version__}")
        raise typer.Exit


@app.callback(epilog="Start with: hypermap demo. Every command explains itself with --help.")
def _options(
    verbose: Verbose = 0,
    quiet: Quiet = 0,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Version.")
    ] = False,
) -> None:
    """Semantic maps for mobile robots: build them from RGB-D, query them, view them, serve them."""
    set_verbosity(verbose - quiet)


def _help_of(module: Any) -> str:
    """Return a command's docstring as help: paragraphs flow, indented lines (the examples) stay."""
    text = inspect.cleandoc(module.command.__doc__ or "").replace(
        "Examples:", "[bold]Examples:[/bold]"
    )
    return re.sub(r"(?<=[^\n])\n(?=[^\s])", " ", text)


def _module_of(name: str) -> Any:
    return importlib.import_module(f"hypermap.cli.{_MODULES[name]}")


def _command_of(name: str) -> Any:
    module = _module_of(name)
    alone = typer.Typer(rich_markup_mode="rich", add_completion=False)
    command_class = getattr(module, "COMMAND_CLASS", None)
    alone.command(name, cls=command_class, help=_help_of(module))(
        takes_verbosity(takes_old_names(name, module.command))
    )
    return get_command(alone)


def main(args: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit.

    The codes: 0 done, 1 no memory, 2 bad input or usage, 129 SIGHUP, 130 Ctrl-C, 141 nobody reads
    on, 143 SIGTERM.
    """
    prepare_streams()
    try:
        try:
            with ended_by_signals():
                app(args, prog_name="hypermap")
        finally:
            finish_writing()
    except BrokenPipeError:  # the reader has seen enough, as `head` has
        sys.exit(NOBODY_READS)
    except SystemExit as end:
        if isinstance(end.__context__, BrokenPipeError):  # which typer has caught
            sys.exit(NOBODY_READS)
        raise
    except (HypermapError, OSError) as error:
        complain(describe(error))
    except MemoryError:
        complain(
            "there is not enough memory for this; close other programs, or give it less at once"
        )
        sys.exit(NO_MEMORY)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    sys.exit(BAD_INPUT)
