"""Loads a detector from a user's argument: an ONNX file, or the name of a plug-in."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path

from hypermap.core.errors import FileMissing, HypermapError, did_you_mean
from hypermap.entry_points import entry_point, in_words, installed, is_packages_fault
from hypermap.perception.detections import Detector
from hypermap.perception.detectors.catalog import known_network

ENTRY_POINT_GROUP = "hypermap.detectors"


def load_detector(
    path: str | Path,
    labels: str | Path | None = None,
    score_threshold: float = 0.3,
    iou_threshold: float = 0.45,
    threads: int | None = None,
) -> Detector:
    """Return the detector in an ONNX file, or one of a plug-in.

    Args:
        path: an ONNX file; or the name of a network that was downloaded by `hypermap detectors
            get`; or ``name:argument``, where `name` is an entry point in the group
            `hypermap.detectors` whose value makes a detector from the argument. Such a detector
            has its own settings: the other parameters are for ONNX files.
        labels: file of the class names (see `read_labels`); by default those in the model, or
            COCO's if it has 80 classes and names none.
        score_threshold: detections with a lower score are dropped.
        iou_threshold: of two boxes of a class that overlap more, the better one is kept; unused
            for models that include suppression.
        threads: how many the network may use; by default all cores.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If the model or its labels cannot be read, or its outputs are unknown.
        HypermapError: If no detector of that name is installed, or it cannot be made.
    """
    name, colon, argument = str(path).partition(":")
    plugin = entry_point(ENTRY_POINT_GROUP, name)
    if colon and plugin is not None:
        return _made_by(plugin, argument)
    if colon and Path(path).suffix.lower() != ".onnx" and not Path(path).exists():
        hint = did_you_mean(name, installed(ENTRY_POINT_GROUP))
        raise HypermapError(f"{path}: no detector {name!r} is installed; {hint}")
    from hypermap.perception.detectors.onnx_detector import OnnxDetector

    network = None if Path(path).exists() else known_network(str(path))
    if network is not None:
        path = network.downloaded()
    elif not Path(path).exists():
        if plugin is not None:
            raise HypermapError(
                f"{path}: the installed detector of this name needs an argument: {name}:ARGUMENT"
            )
        raise FileMissing(
            f"{path}: there is no such model; `hypermap detectors` lists those that can be "
            "downloaded and called by name"
        )
    return OnnxDetector.load(path, labels, score_threshold, iou_threshold, threads)


def _made_by(plugin: EntryPoint, argument: str) -> Detector:
    """Return the detector that a plug-in makes.

    Raises:
        HypermapError: If it cannot; names the plug-in.
    """
    try:
        detector: Detector = plugin.load()(argument)
    except HypermapError:
        raise
    except BaseException as error:
        if not is_packages_fault(error):
            raise
        raise HypermapError(
            f"detector plug-in {plugin.name!r} ({plugin.value}) cannot be created from "
            f"{argument!r}: {in_words(error)}"
        ) from error
    return detector
