"""`hypermap bench`: compare Hypermap with its peers, in a checkout of the source."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

import hypermap
from hypermap.core.errors import HypermapError


def command(
    groups: Annotated[
        list[str] | None,
        typer.Argument(metavar="GROUP", show_default=False, help="What to measure: all."),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", show_default=False, help="Real maps and recordings: ../shared/data."
        ),
    ] = None,
    repeat: Annotated[int, typer.Option(min=1, help="Repetitions.")] = 5,
    quick: Annotated[
        bool, typer.Option("--quick", help="Use small sizes, as a smoke test.")
    ] = False,
    times: Annotated[
        Path | None,
        typer.Option(metavar="FILE", show_default=False, help="Save all measured times: .json."),
    ] = None,
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="FILE", show_default=False, help="Save the tables: .md."),
    ] = None,
    plots: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", show_default=False, help="Plot time and memory over size: .png."
        ),
    ] = None,
) -> None:
    """Benchmark Hypermap against other programs: PCL, Boost, GeoPandas and more.

    Hypermap and another program take turns at each task, on one core, and their results are
    compared. The other programs need compilers and libraries, so this only runs in a checkout of
    the source, where `make bench` sets them up. Exit code 1: results differ.

    Examples:
        hypermap bench
        hypermap bench queries grids --repeat 3 --times races.json
        hypermap bench --quick
    """
    options = {
        "--data": data,
        "--repeat": repeat,
        "--times": times,
        "--markdown": markdown,
        "--plots": plots,
    }
    given = [text for name, value in options.items() if value is not None for text in (name, value)]
    arguments = [*(groups or []), *map(str, given), *(["--quick"] if quick else [])]
    os.execv(sys.executable, [sys.executable, str(_script()), *arguments])


def _script() -> Path:
    """Return the benchmark's script, of the checkout that this runs in or from."""
    installed_from = Path(hypermap.__file__).resolve().parents[2]
    for checkout in (Path.cwd(), installed_from):
        script = checkout / "benchmarks" / "bench.py"
        if script.is_file() and (checkout / "src" / "hypermap").is_dir():
            return script
    raise HypermapError(
        "the benchmark is part of the source, not of the package: "
        "clone the repository and run `make bench` in it"
    )
