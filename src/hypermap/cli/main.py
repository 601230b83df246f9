"""The command `hypermap`, and the single place where errors become one line and an exit code."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Sequence
from typing import Annotated, NoReturn

import typer

from hypermap import __version__
from hypermap.cli import (
    bench,
    convert,
    demo,
    evaluate,
    experiment,
    info,
    live,
    map_,
    query,
    render,
    ros1_env,
    rviz,
    serve,
    shell,
    simulate,
    view,
)
from hypermap.cli.terminal import (
    BAD_INPUT,
    INTERRUPTED,
    complain,
    describe,
    log_to_standard_error,
    prepare_streams,
)
from hypermap.core.errors import HypermapError

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
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
    verbose: Annotated[
        int,
        typer.Option(
            "-v",
            "--verbose",
            count=True,
            show_default=False,
            help="Tell more on standard error; twice for details.",
        ),
    ] = 0,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Version.")
    ] = False,
) -> None:
    """Maps for robots that hold more than free and occupied, built from RGB-D and easy to ask."""
    log_to_standard_error(verbose)


def _flowing(docstring: str) -> str:
    """Return a docstring as help: paragraphs flow, indented lines (the examples) stay."""
    text = inspect.cleandoc(docstring).replace("Examples:", "[bold]Examples:[/bold]")
    return re.sub(r"(?<=[^\n])\n(?=[^\s])", " ", text)


for _name, _module in {
    "demo": demo,
    "map": map_,
    "info": info,
    "query": query,
    "view": view,
    "render": render,
    "evaluate": evaluate,
    "convert": convert,
    "simulate": simulate,
    "experiment": experiment,
    "shell": shell,
    "serve": serve,
    "live": live,
    "rviz": rviz,
    "ros1-env": ros1_env,
    "bench": bench,
}.items():
    app.command(
        _name,
        cls=getattr(_module, "COMMAND_CLASS", None),
        help=_flowing(_module.command.__doc__ or ""),
    )(_module.command)


def main(args: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit: 0 done, 2 bad input or usage, 130 stopped by Ctrl-C."""
    prepare_streams()
    try:
        app(args, prog_name="hypermap")
    except (HypermapError, OSError) as error:
        complain(describe(error))
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    sys.exit(BAD_INPUT)
