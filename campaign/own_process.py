"""Each part runs in a process of its own, whose memory is its own and whose end is not ours."""

from __future__ import annotations

import importlib
import multiprocessing
import resource
import time
import traceback
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from campaign.part import Budget, Finding, Result
from campaign.report import Row


def row_of(name: str, budget: Budget) -> Row:
    """Run a part, and return what it did and took; that its process died is a finding, too."""
    started = time.monotonic()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        try:
            result, peak_mb = pool.submit(_run, name, budget).result()
        except BrokenProcessPool:
            died = Finding("the part's process was killed", budget.seed)
            result, peak_mb = Result(name, 0, [died]), 0.0
        except Exception as error:  # of the part itself: the others go on
            traceback.print_exc()
            fell = Finding(f"the part itself fell: {type(error).__name__}: {error}", budget.seed)
            result, peak_mb = Result(name, 0, [fell]), 0.0
    return Row(result, time.monotonic() - started, peak_mb)


def _run(name: str, budget: Budget) -> tuple[Result, float]:
    """Return what a part hands back, and the most memory that one of its processes held, in MB."""
    result: Result = importlib.import_module(f"campaign.{name}").run(budget)
    whose = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return result, max(resource.getrusage(who).ru_maxrss for who in whose) * 1024 / 1e6


def peak_bytes() -> int:
    """Return the most memory that this process ever had, in bytes.

    Not `ru_maxrss`, in which the process that started this one counts, too.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    [peak] = [line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:")]
    return int(peak) * 1024
