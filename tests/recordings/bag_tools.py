"""What the tests of bags share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from hypermap.perception.frame import RgbdFrame
from hypermap.recordings import RecordingOptions, open_recording

from .bag_builder import BagBuilder, add_images, add_poses
from .shots import SHOTS


def frames_of(path: Path, **options: Any) -> list[RgbdFrame]:
    return list(open_recording(path, RecordingOptions(**options)).frames())


def without(*topics: str) -> Callable[[BagBuilder], None]:
    """Write a complete bag but for some topics."""

    def write(bag: BagBuilder) -> None:
        add = bag.add
        bag.add = lambda topic, *rest: None if topic in topics else add(topic, *rest)  # type: ignore[method-assign]
        add_poses(bag, SHOTS)
        for shot in SHOTS:
            add_images(bag, shot)

    return write


def storage_file(path: Path) -> Path:
    return path if path.is_file() else next(p for p in path.iterdir() if p.suffix != ".yaml")
