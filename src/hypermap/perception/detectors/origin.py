"""Where the detections of a recording come from: as a user says, or from the recording itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hypermap.core.errors import HypermapError
from hypermap.perception.detectors import sources
from hypermap.perception.detectors.load import load_detector
from hypermap.perception.frame import DetectionSource
from hypermap.perception.recording import Recording, RecordingInfo

FILE = "detections.json"  # in the recording's folder


@dataclass(frozen=True)
class DetectionOrigin:
    """Says how to open a source of detections, which each process does for itself.

    Without a detector and a file, they are those recorded with the frames.

    Attributes:
        detector: see `load_detector`.
        labels: file of its class names.
        score: detections of a network with a lower score are dropped.
        file: of recorded detections.
        is_found: whether the file was found in the recording, and not named by the user.
    """

    detector: str | None = None
    labels: Path | None = None
    score: float = 0.3
    file: Path | None = None
    is_found: bool = False

    def open(self, threads: int | None = None) -> DetectionSource:
        """Return the source.

        Args:
            threads: how many a network may use; by default all cores.

        Raises:
            HypermapError: If it cannot be made.
        """
        if self.detector is not None:
            detector = load_detector(self.detector, self.labels, self.score, threads=threads)
            return sources.detections_from_detector(detector)
        if self.file is not None:
            return sources.detections_from_file(self.file)
        return sources.detections_from_recording()


def detection_origin(
    recording: Recording,
    detector: str | None,
    labels: Path | None,
    score: float,
    detections: Path | None,
    objects: bool = True,
) -> DetectionOrigin | None:
    """Return where detections come from; None if there are to be no objects.

    Raises:
        HypermapError: If the options contradict each other, there are no detections, or the
            recording cannot be mapped at all.
    """
    if detector is not None and detections is not None:
        raise HypermapError("give either --detector or --detections, not both")
    if labels is not None and detector is None:
        raise HypermapError("--labels needs --detector")
    if not objects:
        if detector is not None or detections is not None:
            raise HypermapError("--no-objects leaves no work for --detector or --detections")
        return None
    if detector is not None or detections is not None:
        return DetectionOrigin(detector, labels, score, detections)
    own_file = recording.path / FILE
    if own_file.is_file():
        return DetectionOrigin(file=own_file, is_found=True)
    len(recording)  # if it is damaged or incomplete, that comes first
    info = recording.info()
    if has_recorded_detections(info):
        if info.missing:
            raise HypermapError(f"{recording.path}: {'; '.join(info.missing)}")
        return DetectionOrigin()
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
