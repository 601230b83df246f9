"""Loads a map, saves it and says what that took: a process of its own, so that memory counts.

    python map_process.py MAP SMALL_MAP OUT FORM

Loads SMALL_MAP first, so that no import is timed. Prints one JSON object as `load_map.cpp` does.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from hypermap import OccupancyLayer, SemanticLayer, open_map, save_map
from hypermap.core.hypermap import Hypermap


def main() -> None:
    """Load and save, and print what was measured."""
    path, small, out, form = sys.argv[1:5]
    save_map(open_map(small), out, semantic=form)  # type: ignore[arg-type]  # checked there
    before = resident_mb()
    load_seconds, hypermap = timed(lambda: open_map(path))
    measured: dict[str, Any] = {
        "load": load_seconds,
        "before_mb": before,
        "resident_mb": resident_mb(),
        "load_peak_mb": peak_mb(),
    }
    measured["save"], _ = timed(lambda: save_map(hypermap, out, semantic=form))  # type: ignore[arg-type]
    measured["peak_mb"] = peak_mb()
    print(json.dumps({**measured, **sums(hypermap)}))


def sums(hypermap: Hypermap) -> dict[str, float]:
    """Return what answers are compared by."""
    found: dict[str, float] = {}
    for layer in hypermap.layers:
        if isinstance(layer, SemanticLayer):
            table = layer.table
            found["objects"] = len(table)
            found["tags"] = sum(map(len, table.tags))
            found["area"] = float(shapely.area(table.footprints).sum())
            found["confidence"] = float(sum(map(sum, table.confidence)))
            found["seen"] = float(np.nansum(table.last_seen - table.first_seen))
        elif isinstance(layer, OccupancyLayer) and layer.cells is not None:
            for name, value in (("free", 0), ("occupied", 100), ("unknown", -1)):
                found[name] = int(np.count_nonzero(layer.cells == value))
    return found


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Return the seconds that a call takes, and its answer."""
    start = time.perf_counter()
    answer = work()
    return time.perf_counter() - start, answer


def resident_mb() -> float:
    """Return the memory that this process has now [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1e6


def peak_mb() -> float:
    """Return the most memory that this process ever had [MB].

    Not `ru_maxrss`, in which the process that started this one counts, too.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    [peak] = [line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:")]
    return int(peak) * 1024 / 1e6


if __name__ == "__main__":
    main()
