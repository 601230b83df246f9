"""Folders of the TUM RGB-D format, whole and damaged."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from hypermap.perception.recording import Recording
from hypermap.recordings import RecordingOptions, open_recording

from .shots import INTRINSICS


def opened(folder: Path, **options: object) -> Recording:
    known = {"depth_scale": 1000.0, "intrinsics": INTRINSICS} | options
    return open_recording(folder, RecordingOptions(**known))  # type: ignore[arg-type]


def line_of(name: str, number: int, text: str) -> Callable[[Path], None]:
    """Replace a line of a list."""

    def change(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        lines[number - 1] = text
        (folder / name).write_text("\n".join(lines))

    return change


def content_of(pattern: str, content: bytes | None) -> Callable[[Path], None]:
    """Replace the content of the first file that fits; cut it off for None."""

    def change(folder: Path) -> None:
        path = min(folder.glob(pattern))
        path.write_bytes(path.read_bytes()[:60] if content is None else content)

    return change


def picture_of(pattern: str, pixels: np.ndarray) -> Callable[[Path], None]:
    return lambda folder: Image.fromarray(pixels).save(min(folder.glob(pattern)))


def pgm_of(pattern: str, most: int) -> Callable[[Path], None]:
    """Replace the first file that fits by a PGM with this largest value."""
    header = f"P5 32 24 {most}\n".encode()
    return content_of(pattern, header + np.full((24, 32), 1500, ">u2").tobytes())


def tiff_of(pattern: str, pixels: np.ndarray) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        Image.fromarray(pixels).save(min(folder.glob(pattern)), format="TIFF")

    return change


def remove(pattern: str) -> Callable[[Path], None]:
    return lambda folder: min(folder.glob(pattern)).unlink()
