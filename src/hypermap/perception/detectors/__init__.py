"""Detectors: neural networks in ONNX files, and recorded detections."""

from hypermap.perception.detectors.load import load_detector

__all__ = ["load_detector"]
