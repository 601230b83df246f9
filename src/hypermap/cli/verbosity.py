"""Verbosity: -v and -q, before or after a command."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any

import typer

from hypermap.cli.added_options import with_options
from hypermap.cli.terminal import change_verbosity

Verbose = Annotated[
    int,
    typer.Option(
        "-v",
        "--verbose",
        count=True,
        show_default=False,
        help="More messages on standard error; twice for details.",
    ),
]
Quiet = Annotated[
    int,
    typer.Option(
        "-q", "--quiet", count=True, show_default=False, help="Print only answers and errors."
    ),
]


def takes_verbosity(command: Callable[..., None]) -> Callable[..., None]:
    """Add both options to a command; they count together with those before it."""

    @functools.wraps(command)
    def wrapper(verbose: int, quiet: int, **arguments: Any) -> None:
        change_verbosity(verbose - quiet)
        command(**arguments)

    signature = inspect.signature(command, eval_str=True)
    own = list(signature.parameters.values())
    added = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=0, annotation=option)
        for name, option in (("verbose", Verbose), ("quiet", Quiet))
    ]
    return with_options(wrapper, own + added)
