"""Run the campaign: faults, hostile input and long runs, with a table at the end.

    python -m campaign [PART ...] [--minutes M] [--seed S] [--short] [--folder FOLDER]

Exit codes: 0 nothing fell; 1 something did; 2 bad input; 130 Ctrl-C.
"""

from __future__ import annotations

import argparse
import importlib
import multiprocessing
import random
import resource
import signal
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from campaign import report
from campaign.part import Budget, Finding, Result

# Each part, and its share of the time. A part is a module with a function `run(budget)`.
PARTS = {"kill": 3, "fuzz": 5, "differential": 2, "long_runs": 3, "world_faults": 2}
MINUTES, SHORT_MINUTES = 60.0, 2.0
CHECKOUT = Path(__file__).resolve().parent.parent
FOUND, BAD_INPUT, INTERRUPTED = 1, 2, 130  # exit codes


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaign and return the exit code."""
    options = _parser().parse_args(arguments)
    names = options.parts or list(PARTS)
    for name in names:
        if name not in PARTS:
            known = ", ".join(PARTS)
            print(f"campaign: error: there is no part {name!r}; known: {known}", file=sys.stderr)
            return BAD_INPUT
    signal.signal(signal.SIGINT, signal.default_int_handler)  # some shells switch Ctrl-C off
    seed = random.randrange(2**31) if options.seed is None else options.seed
    minutes = options.minutes or (SHORT_MINUTES if options.short else MINUTES)
    seconds = 60 * minutes / sum(PARTS[name] for name in names)
    rows = []
    try:
        for name in names:
            print(f"{name}, with seed {seed}", flush=True)
            folder = options.folder.absolute() / name
            folder.mkdir(parents=True, exist_ok=True)
            rows.append(_row(name, Budget(PARTS[name] * seconds, seed, options.short, folder)))
            for lines in (report.figures(rows[-1].result), report.findings(rows[-1].result)):
                if lines:
                    print(lines, flush=True)
    except KeyboardInterrupt:
        print("\ncampaign: stopped", file=sys.stderr)
        return INTERRUPTED
    finally:
        print(f"\n{report.table(rows)}", flush=True)
    return FOUND if any(row.result.findings for row in rows) else 0


def _row(name: str, budget: Budget) -> report.Row:
    """Run a part in a process of its own, whose end does not end the campaign."""
    started = time.monotonic()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        try:
            result, peak_mb = pool.submit(_run, name, budget).result()
        except BrokenProcessPool:
            died = Finding("the part's process was killed", budget.seed)
            result, peak_mb = Result(name, 0, [died]), 0.0
    return report.Row(result, time.monotonic() - started, peak_mb)


def _run(name: str, budget: Budget) -> tuple[Result, float]:
    """Return what a part hands back, and the most memory that one of its processes held, in MB."""
    result: Result = importlib.import_module(f"campaign.{name}").run(budget)
    whose = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return result, max(resource.getrusage(who).ru_maxrss for who in whose) * 1024 / 1e6


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m campaign",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--minutes", type=float, help="for all parts together (default: 60)")
    parser.add_argument("--seed", type=int, help="draw what an earlier run drew (default: any)")
    parser.add_argument("--short", action="store_true", help="the little that CI runs")
    parser.add_argument(
        "--folder",
        type=Path,
        default=CHECKOUT / "build" / "campaign",
        help="for the files of findings (default: build/campaign)",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
