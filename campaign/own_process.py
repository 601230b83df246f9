"""Each part runs in a process of its own, whose memory is its own and whose end is not ours."""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing
import os
import resource
import signal
import time
import traceback
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path

from campaign.part import Budget, Finding, Result
from campaign.report import Row

GRACE = 300.0  # seconds beyond its time, until a part counts as hanging
_CLEANING = 30.0  # seconds for what was interrupted to end what it has started


def row_of(name: str, budget: Budget, grace: float = GRACE) -> Row:
    """Run a part, and return what it did and took; that its process died is a finding, too."""
    ours, theirs = multiprocessing.get_context("spawn").Pipe(duplex=False)
    process = SpawnProcess(target=_run, args=(name, budget, theirs))
    process.start()
    theirs.close()
    fell = ""
    try:
        if ours.poll(None if budget.short else max(budget.left, 0.0) + grace):
            result, peak_mb = ours.recv()
            process.join(_CLEANING)
        else:
            fell = f"it hangs: it did not end within {grace:.0f} s after its time"
    except EOFError:
        fell = "the part's process was killed"
    finally:
        _end(process)
    if fell:
        result, peak_mb = Result(name, 0, [Finding(fell, budget.seed)]), 0.0
    return Row(result, time.monotonic() - budget.begun, peak_mb)


def _run(name: str, budget: Budget, answer: Connection) -> None:
    """Send what a part hands back, and the most memory that one of its processes held, in MB."""
    os.setsid()  # so that all that it starts can be ended with it
    try:
        result: Result = importlib.import_module(f"campaign.{name}").run(budget)
    except Exception as error:  # of the part itself: the others go on
        traceback.print_exc()
        fell = Finding(f"the part itself fell: {type(error).__name__}: {error}", budget.seed)
        result = Result(name, 0, [fell])
    except KeyboardInterrupt:
        return
    whose = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    answer.send((result, max(resource.getrusage(who).ru_maxrss for who in whose) * 1024 / 1e6))


def _end(process: SpawnProcess) -> None:
    """End a part that has not ended: first as Ctrl-C does, then all that it has started."""
    for ending in (signal.SIGINT, signal.SIGKILL):
        if process.is_alive():
            pid = process.pid or 0
            with contextlib.suppress(ProcessLookupError):
                (os.killpg if os.getpgid(pid) == pid else os.kill)(pid, ending)
            process.join(_CLEANING)
    process.close()


def peak_bytes() -> int:
    """Return the most memory that this process ever had, in bytes.

    Not `ru_maxrss`, in which the process that started this one counts, too.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    [peak] = [line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:")]
    return int(peak) * 1024
