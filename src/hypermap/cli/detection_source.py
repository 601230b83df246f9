"""Where `hypermap map` takes detections from: as the user says, or from the recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.perception.frame import DetectionSource
    from hypermap.perception.recording import Recording, RecordingInfo

FILE = "detections.json"  # in the recording's folder


def detection_source(
    recording: Recording,
    detector: str | None,
    labels: Path | None,
    score: float,
    detections: Path | None,
    objects: bool = True,
) -> DetectionSource | None:
    """Return what says what is on the images; None if there are to be no objects.

    Raises:
        HypermapError: If the user says two things, there are no detections, or the recording in
            which these are looked for cannot be mapped at all.
    """
    from hypermap.perception.detectors import load_detector, sources

    if detector is not None and detections is not None:
        raise HypermapError("give either --detector or --detections, not both")
    if labels is not None and detector is None:
        raise HypermapError("--labels needs --detector")
    if not objects:
        if detector is not None or detections is not None:
            raise HypermapError("--no-objects leaves no work for --detector or --detections")
        return None
    if detector is not None:
        return sources.detections_from_detector(load_detector(detector, labels, score))
    if detections is not None:
        return sources.detections_from_file(detections)
    own_file = recording.path / FILE
    if own_file.is_file():
        note(f"taking detections from {own_file}")
        return sources.detections_from_file(own_file)
    len(recording)  # if it is damaged or incomplete, that comes first
    info = recording.info()
    if has_recorded_detections(info):
        note("taking the detections recorded in the bag")
        return sources.detections_from_recording()
    raise HypermapError(f"{recording.path}: {no_detections(info)}")


def has_recorded_detections(info: RecordingInfo) -> bool:
    """Whether a map of a recording can have objects without a detector."""
    is_in_it = any(stream.use == "recorded detections" for stream in info.streams)
    return is_in_it or (info.path / FILE).is_file()


def no_detections(info: RecordingInfo) -> str:
    """Return what to do about a recording without detections."""
    has_color = any("detection of objects" in stream.use for stream in info.streams)
    if not has_color:
        return (
            "there are neither detections nor color images in which a detector could find objects; "
            "give --detections FILE, or --no-objects for a map without them"
        )
    return (
        "nothing says what is on the images; give --detector MODEL.onnx, or --detector yolox-nano "
        "after `hypermap detectors get yolox-nano`, or --detections FILE, or a recording that has "
        f"detections (in a bag, or as {FILE} in its folder), or --no-objects for a map without "
        "objects"
    )
