"""Fuzz: bytes of strangers, at each place where such come in."""

from __future__ import annotations

import json
import math
import os
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from enum import Enum
from pathlib import Path
from statistics import median
from typing import Any

from campaign.fuzz_targets import targets_here
from campaign.fuzz_worker import DIED, READY
from campaign.part import Budget, Finding, Result

CHECKOUT = Path(__file__).resolve().parent.parent
SHORT_RUNS = 15  # of each target, beside its examples
LEAST = 20.0  # seconds that a target must have after it has prepared itself
_PATIENCE = 100.0  # seconds beyond its time, until a process that asks counts as hanging


def run(budget: Budget) -> Result:
    """Fuzz all targets that can be asked here, in any order, each in its own process."""
    names = targets_here()
    return fuzz(budget, random.Random(budget.seed).sample(names, len(names)))


def fuzz(budget: Budget, names: Sequence[str]) -> Result:
    """Fuzz some targets, as many at a time as there are cores; see `run`."""
    shares = _Shares(budget, len(names))
    with ThreadPoolExecutor(shares.workers) as pool:
        answers = list(pool.map(shares.answer, names))
    said = {name: one for name, one in zip(names, answers, strict=True) if isinstance(one, dict)}
    findings = [
        Finding(f"{name}: {found['what']}", budget.seed, Path(found["file"]))
        for name, one in said.items()
        for found in one["findings"]
    ]
    figures: dict[str, float | str] = {name: _figure(one) for name, one in said.items()}
    figures["refused"] = sum(one["refused"] for one in said.values())
    slowest, which = max(((one["slowest"], name) for name, one in said.items()), default=(0.0, ""))
    figures["slowest"] = f"{slowest:.2f} s ({which})"
    left_out = []
    for name, one in zip(names, answers, strict=True):
        if one is _End.DIED:
            folder = budget.folder / name
            file = folder / (DIED if (folder / DIED).exists() else "now")
            findings.append(Finding(f"{name}: the process hung or died", budget.seed, file))
        elif one is _End.LATE:
            left_out.append(name)
    return Result("fuzz", sum(one["runs"] for one in said.values()), findings, figures, left_out)


class _End(Enum):
    """How a process ended that says nothing of what it did."""

    DIED = "it hung or died"
    LATE = "its time was over before it had prepared itself"


class _Shares:
    """Divides the time among targets, which take the longer to begin the busier the machine is.

    Where an equal share of the time is too short for code that is to guide, which takes several
    times as long to import, targets are fuzzed at random, so that all of them are.

    Attributes:
        workers: how many run at a time.
    """

    def __init__(self, budget: Budget, targets: int) -> None:
        self.workers = os.cpu_count() or 1
        self._budget, self._to_come = budget, targets
        # How long those that are guided, and others, took to begin, or had and did not [s].
        self._prepared: dict[bool, list[float]] = {True: [], False: []}

    def answer(self, name: str) -> dict[str, Any] | _End:
        """Return what the process says that fuzzes a target in its share of what is left."""
        if self._budget.short:
            return _answer_of_process(name, math.inf, self._budget, SHORT_RUNS)
        share = self._budget.left * self.workers / self._to_come
        is_guided = share >= self._needed(True)
        self._to_come -= 1
        if self._budget.left < self._needed(is_guided):
            return _End.LATE
        seconds = min(max(share, self._needed(is_guided)), self._budget.left)
        answer = _answer_of_process(name, seconds, self._budget, None if is_guided else "random")
        took = answer["prepared"] if isinstance(answer, dict) else seconds
        self._prepared[is_guided].append(took)
        return answer

    def _needed(self, is_guided: bool) -> float:
        """Return the least time that a target must have [s]."""
        prepared = self._prepared[is_guided]
        return (1.5 * median(prepared) if prepared else 0.0) + LEAST


def _figure(one: dict[str, Any]) -> str:
    return (
        f"{one['runs']:,} runs in {one['seconds'] - one['prepared']:.0f} s guided by {one['way']}, "
        f"{one['refused']:,} refused, slowest {one['slowest']:.2f} s, {one['peak'] / 1e6:.0f} MB, "
        f"{len(one['findings'])} findings"
    )


def _answer_of_process(
    name: str, seconds: float, budget: Budget, how: int | str | None
) -> dict[str, Any] | _End:
    """Return what a process says that fuzzes one target in so many seconds; see its RUNS."""
    folder = budget.folder / name
    started = time.monotonic()
    shutil.rmtree(folder, ignore_errors=True)
    command = [sys.executable, "-m", "campaign.fuzz_worker", name, str(seconds)]
    command += [str(budget.seed), str(folder)]
    if how is not None:
        command.append(str(how))
    with subprocess.Popen(command, cwd=CHECKOUT, stdout=subprocess.PIPE) as process:
        try:
            said = _said(process, seconds, folder)
        finally:
            process.kill()
    if isinstance(said, _End):
        return said
    lines = said.splitlines()
    if not lines:
        return _End.DIED
    return {**json.loads(lines[-1]), "seconds": time.monotonic() - started}


def _said(process: subprocess.Popen[bytes], seconds: float, folder: Path) -> bytes | _End:
    try:
        return process.communicate(timeout=None if math.isinf(seconds) else seconds)[0]
    except subprocess.TimeoutExpired:
        if not (folder / READY).exists():
            return _End.LATE
    try:
        return process.communicate(timeout=_PATIENCE)[0]
    except subprocess.TimeoutExpired:
        return _End.DIED
