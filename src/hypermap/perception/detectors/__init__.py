"""Detectors: neural networks in ONNX files, and recorded detections."""
