"""Where the detections of a frame come from: a detector, a file, or the recording itself."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hypermap.core.errors import FormatError, HypermapError
from hypermap.entry_points import in_words, is_packages_fault
from hypermap.perception.detections import Detections, Detector
from hypermap.perception.detectors.recorded import RecordedDetections
from hypermap.perception.frame import DetectionSource, RgbdFrame

logger = logging.getLogger(__name__)


def detections_from_detector(detector: Detector) -> DetectionSource:
    """Return a source that runs the detector on the color image of each frame.

    It raises HypermapError for a frame without one; if the detector fails, the error names it.
    """
    kind = type(detector)
    name = f"detector {kind.__module__}.{kind.__qualname__}"

    def source(frame: RgbdFrame) -> Detections:
        if frame.color is None:
            raise HypermapError(
                f"the frame at {frame.stamp:.6f} has no color image, which a detector needs; "
                "give detections from a file instead, with --detections FILE"
            )
        color = frame.color
        return detections_of(name, lambda: detector.detect(color))

    return source


def detections_of(name: str, look: Callable[[], Any]) -> Detections:
    """Return the detections that a plug-in's or user's function finds in a frame.

    Raises:
        HypermapError: If it raises an exception, or returns something else; names that code,
            except when memory is full. Only this frame is lost.
    """
    try:
        found = look()
    except HypermapError:
        raise
    except MemoryError:
        raise HypermapError("there was not enough memory to find objects in it") from None
    except BaseException as error:
        if not is_packages_fault(error):
            raise
        logger.debug("%s failed", name, exc_info=True)
        raise HypermapError(f"{name} failed: {in_words(error)}") from error
    if not isinstance(found, Detections):
        raise HypermapError(f"{name} returned {type(found).__name__}, not Detections")
    return found


def detections_from_file(path: str | Path) -> DetectionSource:
    """Return a source that looks up each frame in a file (see `RecordedDetections`).

    It raises FormatError for a frame whose size differs from that of the images in the file. Where
    the file does not name it, a box beside the image is logged once.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it does not contain detections.
    """
    recorded = RecordedDetections.load(path)
    is_warned = False

    def source(frame: RgbdFrame) -> Detections:
        nonlocal is_warned
        expected, size = recorded.image_size, (frame.camera.width, frame.camera.height)
        if expected is not None and expected != size:
            raise FormatError(
                f"the detections are of images of {expected[0]} x {expected[1]} pixels, "
                f"but the recording has {size[0]} x {size[1]}",
                path=path,
                key="image_size",
            )
        found = recorded.at(frame.stamp if frame.color_stamp is None else frame.color_stamp)
        if found.masks is not None and found.masks.shape[1:] != size[::-1]:
            height, width = found.masks.shape[1:]
            raise FormatError(
                f"the masks have {width} x {height} pixels, "
                f"but the recording has {size[0]} x {size[1]}",
                path=path,
            )
        if not is_warned and (found.xyxy[:, :2] >= size).any():
            logger.warning(
                "%s: boxes lie beside the image of %d x %d pixels; are they of images of another "
                "size?",
                path,
                *size,
            )
            is_warned = True
        return found

    return source


def detections_from_recording() -> DetectionSource:
    """Return a source that takes the detections recorded with each frame.

    A frame without recorded detections counts as one without objects; the first is logged.
    """
    is_warned = False

    def source(frame: RgbdFrame) -> Detections:
        nonlocal is_warned
        if frame.detections is not None:
            return frame.detections
        if not is_warned:
            logger.warning(
                "the recording has no detections for the frame at %.6f; it counts as one without "
                "objects, and so do others like it",
                frame.stamp,
            )
            is_warned = True
        return Detections.of([], [])

    return source
