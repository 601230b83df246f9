"""The machine that a benchmark ran on: what it is, and how all is kept on one core of it."""

from __future__ import annotations

import datetime
import importlib.metadata
import os
import platform
from collections.abc import Mapping
from pathlib import Path

THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "GDAL_NUM_THREADS",
)
LIBRARIES = (
    "numpy",
    "shapely",
    "scipy",
    "numba",
    "geopandas",
    "rtree",
    "rasterio",
    "scikit-image",
    "scikit-learn",
    "open3d",
)


def stay_on_one_core() -> None:
    """Pin this process and those it starts to one core, and libraries to one thread.

    To be called before libraries are imported, since they read the number of threads then.
    """
    os.environ.update(dict.fromkeys(THREADS, "1"))
    if hasattr(os, "sched_setaffinity"):  # not on macOS and Windows
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def describe() -> Mapping[str, str]:
    """Return what a reader of the figures wants to know of the machine, and its load just now."""
    versions = {name: _version(name) for name in LIBRARIES}
    return {
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d %H:%M UTC"),
        "processor": f"{_line_of('/proc/cpuinfo', 'model name')}, {os.cpu_count()} cores, one used",
        "memory": _line_of("/proc/meminfo", "MemTotal"),
        "system": platform.platform(terse=True),
        "load before": " ".join(f"{load:.2f}" for load in os.getloadavg()),
        "Python": platform.python_version(),
        "libraries": ", ".join(f"{name} {version}" for name, version in versions.items()),
    }


def _version(library: str) -> str:
    try:
        return importlib.metadata.version(library)
    except importlib.metadata.PackageNotFoundError:
        return "missing"


def _line_of(path: str, key: str) -> str:
    """Return the value of the first line "key: value" of a file of the system."""
    if Path(path).is_file():
        for line in Path(path).read_text(encoding="utf-8").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == key:
                return value.strip()
    return platform.machine()
