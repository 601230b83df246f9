"""`hypermap batch`: map many recordings."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.corrected_poses import CorrectPoses
from hypermap.cli.finding_options import Detector, Objects, Profile
from hypermap.cli.options import AsJson
from hypermap.cli.signals import stop_on_signal
from hypermap.cli.terminal import err, note, out, say_json, table
from hypermap.cli.worker_options import MOST_WORKERS, Address, opened_workers
from hypermap.core.errors import HypermapError
from hypermap.text import counted, printable

if TYPE_CHECKING:
    from hypermap.fleet.batch.batch import Result
    from hypermap.fleet.batch.jobs import Job

_FAILED = 2


def command(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="JOBS.YAML|FOLDER|RECORDING",
            show_default=False,
            readable=False,
            help="A list of jobs, a folder of recordings, or one recording.",
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="OUT", show_default=False, help="Save here: the maps."
        ),
    ],
    detector: Detector = None,
    objects: Objects = True,
    profile: Profile = None,
    correct_poses: CorrectPoses = None,
    sweeps: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="STAGE.KEY=VALUE,...",
            show_default=False,
            help="Map with each of these values of a setting. May be repeated, to try all "
            "combinations.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            metavar="N",
            min=1,
            max=MOST_WORKERS,
            show_default="one per core",
            help="Number of processes: each maps one recording at a time.",
        ),
    ] = None,
    address: Address = None,
    as_json: AsJson = False,
) -> None:
    """Map many recordings, several at a time.

    A job is one recording and its options. JOBS.YAML lists jobs; in a FOLDER, each recording is a
    job. A job that fails is reported, and does not affect the others. If the ground truth is known
    (truth.hmap in a recording's folder, or `truth:` of a job), the map is compared with it.

    OUT contains the maps, and results.csv, results.json and results.html. Running the same command
    again skips finished jobs, unless their recording, settings or version of Hypermap have
    changed. Ctrl-C keeps the finished maps.

    Examples:
        hypermap batch recordings -o maps
        hypermap batch jobs.yaml -o maps --workers 4
        hypermap batch jobs.yaml -o maps --address 10.0.0.1:6379
        hypermap batch drive.bag -o losses --set evidence.loss=0.1,0.2,0.3
    """
    from hypermap.fleet.batch.batch import run_batch
    from hypermap.fleet.batch.jobs import jobs_in, swept
    from hypermap.fleet.batch.table import rows_of, summary, write_tables

    common = {"detector": detector, "profile": profile and profile.value, "objects": objects}
    common["correct_poses"] = correct_poses
    given = {key: value for key, value in common.items() if value is not None}
    jobs = swept(jobs_in(source, given), sweeps or [])
    _check_folder(output)
    began = time.monotonic()
    with stop_on_signal() as stop:
        with (
            opened_workers(workers, address, len(jobs)) as pool,
            _progress(jobs, min(pool.count, len(jobs))) as report,
        ):
            results = run_batch(jobs, output, pool, report, lambda: stop.is_wanted)
        write_tables(results, output)
    note(f"{summary(results)} in {time.monotonic() - began:.0f} s; saved in {output}")
    if as_json:
        say_json(rows_of(results))
    else:
        _show(rows_of(results))
    if stop.is_wanted:
        note(f"stopped by {stop.name}; the same command goes on with the rest")
        raise typer.Exit(stop.exit_code)
    if any(result.state == "failed" for result in results):
        raise typer.Exit(_FAILED)


def _check_folder(output: Path) -> None:
    if output.exists() and not output.is_dir():
        raise HypermapError(f"{output}: a file; expected a folder for the maps")


@contextmanager
def _progress(jobs: Sequence[Job], workers: int) -> Iterator[Callable[[Result], None]]:
    """Show one line for each job that ends, above a bar for all at a terminal."""
    note(f"mapping {counted(len(jobs), 'recording')}, {workers} at a time")
    done = 0

    def line(result: Result) -> None:
        nonlocal done
        done += 1
        note(f"{done} of {len(jobs)}: {result.job.name}: {_said(result)}")

    if not err().is_terminal:
        yield line
        return
    from rich import progress as rich

    with rich.Progress(
        rich.TextColumn("mapping"),
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        rich.TextColumn("recordings,"),
        rich.TimeElapsedColumn(),
        console=err(),
    ) as bar:
        task = bar.add_task("mapping", total=len(jobs))

        def report(result: Result) -> None:
            line(result)
            bar.advance(task)

        yield report


def _said(result: Result) -> str:
    if result.error:
        return f"{result.state}: {result.error}"
    if result.state == "unchanged":
        return "unchanged, not done again"
    figures = result.figures
    return f"{counted(figures['objects'], 'object')}, {figures['frames_per_second']} frames/s"


def _show(rows: Sequence[dict[str, Any]]) -> None:
    columns = [name for name in rows[0] if name not in ("recording", "error")]
    grid = table(*(name.replace("_", " ") for name in columns))
    for row in rows:
        grid.add_row(*(printable("" if row[name] is None else str(row[name])) for name in columns))
    out().print(grid)
