"""What detectors say: recorded detections, and the notes in a network."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from campaign.fuzz_targets.target import Target
from campaign.mutation import joined, mutate_parts, mutate_text, parted
from hypermap.perception.detectors.recorded import RecordedDetections


def detections(folder: Path) -> Target:
    """Recorded detections."""
    path = folder / "detections.json"
    box = {"box": [1.0, 2.0, 5.5, 6.0], "name": "cup", "score": 0.5}
    masked = {**box, "mask": {"size": [4, 6], "counts": [5, 3, 16]}}
    corpus = [
        {"image_size": [640, 480], "frames": {"1.5": [box, box], "2.5": []}},
        {"image_size": [6, 4], "frames": {"1.25": [masked, masked]}},
        {"frames": {"1.25": [masked]}},
    ]

    def ask(data: bytes) -> None:
        path.write_bytes(data)
        recorded = RecordedDetections.load(path)
        for stamp in recorded.stamps[:3]:
            recorded.at(stamp)
        recorded.save(folder / "again.json")

    return Target(ask, [json.dumps(each).encode() for each in corpus], mutate_text)


def onnx(folder: Path) -> Target:
    """The notes that stand in a network: names of classes, sizes, what it is for."""
    import onnx as library
    from onnx import helper, numpy_helper

    from hypermap.perception.detectors.load import load_detector

    table = np.array([[[23.2, 23.2, 40.8, 40.8, 0.2, 0]]], np.float32)
    graph = helper.make_graph(
        [helper.make_node("Identity", ["found"], ["output0"])],
        "network",
        [helper.make_tensor_value_info("images", library.TensorProto.FLOAT, (1, 3, "h", "w"))],
        [helper.make_tensor_value_info("output0", library.TensorProto.FLOAT, None)],
        [numpy_helper.from_array(table, "found")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path = folder / "network.onnx"
    notes = {"names": "{0: 'chair', 1: 'cup'}", "task": "detect", "imgsz": "[64, 64]"}
    notes |= {"stride": "32", "end2end": "True"}
    image = np.zeros((48, 64, 3), np.uint8)

    def ask(data: bytes) -> None:
        given = {name: content.decode(errors="replace") for name, content in parted(data).items()}
        helper.set_model_props(model, given)
        path.write_bytes(model.SerializeToString())
        load_detector(path, threads=1).detect(image)

    corpus = [joined({name: text.encode() for name, text in notes.items()})]
    return Target(ask, corpus, mutate_parts)
