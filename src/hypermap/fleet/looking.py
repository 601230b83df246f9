"""Looking at single frames, in a worker."""

from __future__ import annotations

import functools
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from hypermap.core.errors import HypermapError
from hypermap.mapping.perceived import FrameDetections, Perceived, Perceiver, no_detections
from hypermap.mapping.stages import OccupancyConfig
from hypermap.mapping.usable import why_unusable
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.detectors.origin import DetectionOrigin
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.recording import PendingFrame


@dataclass(frozen=True)
class Look:
    """How frames are looked at; each worker prepares it once.

    Attributes:
        origin: of the detections; None for a map without objects.
        perception: how objects are cut out.
        occupancy: how depth becomes cells; None if it does not.
        corrects_poses: whether poses are corrected, by what earlier frames have taught. Then
            objects are cut out afterward.
        is_watched: whether an observer needs the color and the segments of the objects.
        threads: how many a network may use in each worker.
    """

    origin: DetectionOrigin | None
    perception: PerceptionConfig
    occupancy: OccupancyConfig | None
    corrects_poses: bool
    is_watched: bool
    threads: int


@dataclass(frozen=True, eq=False)
class Looked:
    """What a worker has made of a frame.

    Attributes:
        frame: the frame; None if it could not be read.
        error: why it could not be read, or looked at.
        is_usable: whether it can be mapped.
        found: its detections, if they were looked for.
        perceived: what it shows, if that was asked.
        warnings: what was logged meanwhile.
    """

    frame: RgbdFrame | None = None
    error: HypermapError | None = None
    is_usable: bool = False
    found: FrameDetections | None = None
    perceived: Perceived | None = None
    warnings: tuple[str, ...] = ()


def look_at(pending: PendingFrame, look: Look, is_keyframe: bool) -> Looked:
    """Read a frame, and look at it if it is a keyframe."""
    with _kept_warnings() as warnings:
        try:
            frame = pending.load()
        except HypermapError as error:
            return Looked(error=error)
        is_usable = why_unusable(frame) is None
        found, perceived, failure = None, None, None
        if is_usable and is_keyframe:
            perceiver = _perceiver(look)
            try:
                found = perceiver.found(frame)
                if not look.corrects_poses:
                    perceived = perceiver.perceived(frame, found)
            except HypermapError as error:
                failure = error
    return Looked(frame, failure, is_usable, found, perceived, tuple(warnings))


@functools.lru_cache(maxsize=1)
def _perceiver(look: Look) -> Perceiver:
    source = no_detections if look.origin is None else look.origin.open(look.threads)
    return Perceiver(source, look.perception, look.occupancy, look.is_watched)


class _Kept(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(record.getMessage())


@contextmanager
def _kept_warnings() -> Iterator[list[str]]:
    """Yield log messages, which are not shown in this process."""
    logger, handler = logging.getLogger("hypermap"), _Kept()
    logger.addHandler(handler)
    try:
        yield handler.lines
    finally:
        logger.removeHandler(handler)
