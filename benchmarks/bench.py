"""Run the benchmark: Hypermap and its peers, on one core, with both answers compared.

    python benchmarks/bench.py [GROUP...] [--data ../shared/data] [--repeat 5] [--quick]
                               [--times FILE] [--markdown FILE] [--plots FOLDER]

Exit codes: 0 measured; 1 answers differ somewhere; 2 bad input; 130 Ctrl-C, what was measured is
saved.
"""

from __future__ import annotations

import argparse
import importlib
import json
import shlex
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from operator import methodcaller
from pathlib import Path

from suite import machine, report
from suite.race import Group, Growth, Row, Settings, guarded

GROUPS = (
    "perception",
    "mapping",
    "evidence",
    "queries",
    "grids",
    "files",
    "startup",
    "asking",
    "likeness",
    "rooms",
    "paths",
    "values",
    "fleet",
)
CHECKOUT = Path(__file__).resolve().parent.parent
WRONG, BAD_INPUT, INTERRUPTED = 1, 2, 130  # exit codes


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark and return the exit code."""
    options = _parser().parse_args(arguments)
    names = options.groups or GROUPS
    signal.signal(signal.SIGINT, signal.default_int_handler)  # some shells switch Ctrl-C off
    complaint = _complaint(options)
    if complaint:
        print(f"hypermap bench: error: {complaint}", file=sys.stderr)
        return BAD_INPUT
    machine.stay_on_one_core()
    settings = Settings(options.data, options.repeat, options.quick, options.build)
    command = shlex.join(["hypermap", "bench", *(sys.argv[1:] if arguments is None else arguments)])
    described = machine.describe()
    for name, value in described.items():
        print(f"{name:<12} {value}")
    return _run({name: _group(name) for name in names}, settings, options, described, command)


def _run(
    groups: Mapping[str, Group],
    settings: Settings,
    options: argparse.Namespace,
    described: Mapping[str, str],
    command: str,
) -> int:
    """Measure the groups, print each row as it comes, save all rows, and return the exit code."""
    results: list[report.GroupResult] = []
    was_interrupted = False
    try:
        for name, group in groups.items():
            print(f"\n{name}", flush=True)
            results.append(report.GroupResult(name))
            for row in guarded(f"the rest of {name}", group, settings):
                results[-1].rows.append(row)
                print(report.line(row), flush=True)
    except KeyboardInterrupt:
        print("\nhypermap bench: stopped; what was measured so far is kept", file=sys.stderr)
        was_interrupted = True
    if options.times is not None:
        data = report.as_json(described, command, results)
        text = json.dumps(data, indent=1, default=methodcaller("item"))  # numpy's numbers
        options.times.write_text(text + "\n", encoding="utf-8")
    if options.markdown is not None:
        page = report.as_markdown(described, command, results)
        options.markdown.write_text(page, encoding="utf-8")
    if options.plots is not None:
        _save_plots(options.plots, results)
    if was_interrupted:
        return INTERRUPTED
    return WRONG if any(result.is_wrong for result in results) else 0


def _save_plots(folder: Path, results: Sequence[report.GroupResult]) -> None:
    from suite import plots  # matplotlib takes a while

    growths = [row for result in results for row in result.rows if isinstance(row, Growth)]
    if not growths:
        print("\nhypermap bench: no growth was measured, so nothing is drawn", file=sys.stderr)
    for file in plots.save(growths, folder):
        print(f"\nsaved {file}")


def _group(name: str) -> Group:
    """Return a group by its name; its libraries are imported when its first row is asked for."""

    def rows(settings: Settings) -> Iterator[Row]:
        group: Group = importlib.import_module(f"suite.{name}").rows
        yield from group(settings)

    return rows


def _complaint(options: argparse.Namespace) -> str:
    """Return what is wrong with the options, before hours are spent; empty if all is well."""
    for name in options.groups:
        if name not in GROUPS:
            return f"there is no group {name!r}; known: {', '.join(GROUPS)}"
    if options.repeat < 1:
        return f"--repeat must be at least 1, got {options.repeat}"
    for file in (options.times, options.markdown):
        if file is not None and (file.is_dir() or not file.absolute().parent.is_dir()):
            return f"{file}: no file can be written there"
    folder = options.plots
    if folder is not None and (folder.is_file() or not folder.absolute().parent.is_dir()):
        return f"{folder}: no folder can be made there"
    return ""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="hypermap bench", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    beside = CHECKOUT.parent / "shared" / "data"
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=", ".join(GROUPS))
    parser.add_argument(
        "--data",
        type=Path,
        default=beside if beside.is_dir() else None,
        help="real maps and recordings; without them, some groups are left out",
    )
    parser.add_argument("--repeat", type=int, default=5, help="how often each side does the work")
    parser.add_argument("--quick", action="store_true", help="small sizes, to see that all runs")
    parser.add_argument("--times", type=Path, metavar="FILE", help="save every single time")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="save the tables")
    parser.add_argument("--plots", type=Path, metavar="FOLDER", help="draw how it grows: .png")
    parser.add_argument(
        "--build",
        type=Path,
        default=CHECKOUT / "build" / "benchmarks",
        help="folder for compiled programs and made-up inputs",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
