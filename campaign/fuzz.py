"""Fuzz: bytes of strangers, at each place where such come in."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from campaign.fuzz_targets import targets_here
from campaign.part import Budget, Finding, Result

CHECKOUT = Path(__file__).resolve().parent.parent
SHORT_RUNS = 15  # of each target, beside its examples
_LEAST = 5.0  # seconds for a target, however little time is left
_PATIENCE = 300.0  # seconds beyond its time, until a process counts as hanging


def run(budget: Budget) -> Result:
    """Fuzz all targets that can be asked here, one after the other, each in its own process."""
    return fuzz(budget, targets_here())


def fuzz(budget: Budget, names: Sequence[str]) -> Result:
    """Fuzz some targets, as many at a time as there are cores; see `run`."""
    workers = os.cpu_count() or 1
    ends, begun = time.monotonic() + budget.seconds, itertools.count()

    def one_of(name: str) -> dict[str, Any] | None:
        """Give a target its share of what is left: some take long to begin on a busy machine."""
        left = (ends - time.monotonic()) * workers / (len(names) - next(begun))
        return _of_process(name, max(min(left, ends - time.monotonic()), _LEAST), budget)

    runs, refused, slowest, way = 0, 0, (0.0, ""), ""
    findings: list[Finding] = []
    figures: dict[str, float | str] = {}
    with ThreadPoolExecutor(workers) as pool:
        answers = pool.map(one_of, names)
        for name, one in zip(names, answers, strict=True):
            now = budget.folder / name / "now"
            if one is None:
                findings.append(Finding(f"{name}: the process hung or died", budget.seed, now))
                continue
            runs, refused, way = runs + one["runs"], refused + one["refused"], one["way"]
            slowest = max(slowest, (one["slowest"], name))
            figures[name] = (
                f"{one['runs']:,} runs in {one['seconds']:.0f} s, {one['refused']:,} refused, "
                f"slowest {one['slowest']:.2f} s, {one['peak'] / 1e6:.0f} MB, "
                f"{len(one['findings'])} findings"
            )
            findings += [
                Finding(f"{name}: {found['what']}", budget.seed, Path(found["file"]))
                for found in one["findings"]
            ]
    figures["guided by"] = way
    figures["refused"] = refused
    figures["slowest"] = f"{slowest[0]:.2f} s ({slowest[1]})"
    return Result("fuzz", runs, findings, figures)


def _of_process(name: str, seconds: float, budget: Budget) -> dict[str, Any] | None:
    """Return what a process says that fuzzes one target; None if it had to be ended."""
    folder = budget.folder / name
    started = time.monotonic()
    shutil.rmtree(folder, ignore_errors=True)
    command = [sys.executable, "-m", "campaign.fuzz_worker", name, f"{seconds:.1f}"]
    command += [str(budget.seed), str(folder)]
    if budget.short:
        command.append(str(SHORT_RUNS))
    try:
        done = subprocess.run(
            command,
            cwd=CHECKOUT,
            stdout=subprocess.PIPE,
            timeout=seconds + _PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return None
    lines = done.stdout.splitlines()
    if not lines:
        return None
    return {**json.loads(lines[-1]), "seconds": time.monotonic() - started}
