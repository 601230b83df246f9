"""Fuzz: bytes of strangers, at each place where such come in."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from campaign.part import Budget, Finding, Result

CHECKOUT = Path(__file__).resolve().parent.parent
SHORT_RUNS = 15  # of each target, beside its examples
_START = 40.0  # seconds in which a process imports, warms up and ends
_PATIENCE = 120.0  # seconds beyond that, until a process counts as hanging


def run(budget: Budget) -> Result:
    """Fuzz all targets, one after the other, each in a process of its own."""
    return fuzz(budget, target_names())


def target_names() -> list[str]:
    """Return what can be fuzzed, without importing the program here."""
    from campaign.fuzz_targets import TARGETS

    return list(TARGETS)


def fuzz(budget: Budget, names: list[str]) -> Result:
    """Fuzz some targets; see `run`."""
    share = max(budget.seconds / len(names) - _START, 5.0)
    runs, refused, slowest, way = 0, 0, (0.0, ""), ""
    findings: list[Finding] = []
    figures: dict[str, float | str] = {}
    peak = 0.0
    for name in names:
        started = time.monotonic()
        folder = budget.folder / name
        told = _of_process(name, share, budget, folder)
        if told is None:
            findings.append(
                Finding(f"{name}: the process hung or died", budget.seed, folder / "now")
            )
            continue
        runs, refused, way = runs + told["runs"], refused + told["refused"], told["way"]
        slowest = max(slowest, (told["slowest"], name))
        peak = max(peak, told["peak"] / 1e6)
        figures[name] = (
            f"{told['runs']:,} runs in {time.monotonic() - started:.0f} s, "
            f"{told['refused']:,} refused, slowest {told['slowest']:.2f} s, "
            f"{told['peak'] / 1e6:.0f} MB, {len(told['findings'])} findings"
        )
        if not budget.short:
            print(f"  {name}: {figures[name]}", flush=True)
        findings += [
            Finding(f"{name}: {found['what']}", budget.seed, Path(found["file"]))
            for found in told["findings"]
        ]
    figures["guided by"] = way
    figures["refused"] = refused
    figures["slowest"] = f"{slowest[0]:.2f} s ({slowest[1]})"
    return Result("fuzz", runs, findings, figures)


def _of_process(name: str, seconds: float, budget: Budget, folder: Path) -> dict[str, Any] | None:
    """Return what a process says that fuzzes one target; None if it had to be ended."""
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
            timeout=seconds + _START + _PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return None
    lines = done.stdout.splitlines()
    return json.loads(lines[-1]) if lines else None
