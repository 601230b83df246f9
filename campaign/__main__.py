"""Run the campaign: faults, hostile input and long runs, with a table at the end.

    python -m campaign [PART ...] [--minutes M] [--seed S] [--short] [--folder FOLDER]

Exit codes: 0 nothing fell; 1 something did; 2 bad input; 130 Ctrl-C.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from campaign import report
from campaign.own_process import row_of
from campaign.part import Budget

# Each part, and its share of the time. A part is a module with a function `run(budget)`.
PARTS = {
    "kill": 3,
    "store": 1,
    "fuzz": 8,
    "differential": 1,
    "long_runs": 3,
    "readers": 1,
    "world_faults": 2,
    "ros1_day": 2,
}
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
    budget = Budget(60 * minutes, seed, options.short, options.folder.absolute())
    rows = []
    try:
        for number, name in enumerate(names):
            print(f"{name}, with seed {seed}", flush=True)
            share = budget.share(sum(PARTS[other] for other in names[number:]) / PARTS[name])
            folder = budget.folder / name
            folder.mkdir(parents=True, exist_ok=True)
            rows.append(row_of(name, replace(share, folder=folder)))
            for lines in (report.figures(rows[-1].result), report.findings(rows[-1].result)):
                if lines:
                    print(lines, flush=True)
    except KeyboardInterrupt:
        print("\ncampaign: stopped", file=sys.stderr)
        return INTERRUPTED
    finally:
        print(f"\n{report.table(rows)}", flush=True)
    return FOUND if any(row.result.findings for row in rows) else 0


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
