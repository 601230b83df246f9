"""What is fuzzed: each place where bytes of strangers come in, and examples of what is right."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import cast

from campaign.fuzz_targets.target import Target

# Each target, and the module that has a function of its name.
TARGETS = {
    "archive": "maps",
    "config": "maps",
    "map_server": "maps",
    "png": "maps",
    "semantic_yaml": "maps",
    "wkt": "maps",
    "geojson": "maps",
    "geoparquet": "maps",
    "evidence": "maps",
    "values": "maps",
    "mapper_state": "left",
    "pictures": "left",
    "embeddings": "left",
    "history": "left",
    "notes": "left",
    "media": "media",
    "images": "media",
    "tum": "recordings",
    "seven_scenes": "recordings",
    "scannet": "recordings",
    "replica": "recordings",
    "redwood": "recordings",
    "ros1_bag": "recordings",
    "ros2_db3": "recordings",
    "ros2_mcap": "recordings",
    "sensor_messages": "recordings",
    "samples": "recordings",
    "detections": "detectors",
    "onnx": "detectors",
    "ros_messages": "nodes",
    "console": "nodes",
    "http": "servers",
    "websocket": "servers",
    "tools": "asked",
    "questions": "asked",
    "poses": "asked",
    "commands": "commands",
    "job_files": "commands",
    "spool": "asked",
    "store_api": "asked",
}

_NEEDS = {"spool": "psycopg", "store_api": "psycopg"}  # which a plain install lacks


def targets_here() -> list[str]:
    """Return the targets whose optional library is installed, or that need none."""
    missing = {name for name, needed in _NEEDS.items() if importlib.util.find_spec(needed) is None}
    return [name for name in TARGETS if name not in missing]


def target_of(name: str, folder: Path) -> Target:
    """Return a target that may work in an empty folder; only what it needs is imported."""
    module = importlib.import_module(f"campaign.fuzz_targets.{TARGETS[name]}")
    return cast(Callable[[Path], Target], getattr(module, name))(folder)
