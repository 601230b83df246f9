"""Tiny encoders of images and texts, in the files that exports of CLIP have, for tests.

The encoder of images gives the mean color of an image without its gray; that of texts gives the
same of the words that it knows. It needs the packages `onnx` and `tokenizers`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

_SIDE = 16
_LENGTH = 8  # tokens


def write_encoders(folder: Path, words: Mapping[str, tuple[int, int, int]]) -> Path:
    """Write encoders that know the colors of some words into a folder, and return it.

    Args:
        folder: is made if it is not there.
        words: in lower case, each with its color as (red, green, blue), 0..255.
    """
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    folder.mkdir(parents=True, exist_ok=True)
    table = np.zeros((len(words) + 2, 3), dtype=np.float32)  # of padding and other words: nothing
    table[2:] = [np.array(color) / 127.5 - 1 for color in words.values()]
    table[2:] -= table[2:].mean(axis=1, keepdims=True)

    def save(name: str, nodes: list[Any], given: Any, result: str, tensors: list[Any]) -> None:
        output = helper.make_tensor_value_info(result, TensorProto.FLOAT, ("batch", 3))
        graph = helper.make_graph(nodes, name, [given], [output], tensors)
        opsets = [helper.make_opsetid("", 13)]
        onnx.save(helper.make_model(graph, opset_imports=opsets, ir_version=8), folder / name)

    make = helper.make_node
    image = helper.make_tensor_value_info(
        "pixel_values", TensorProto.FLOAT, ("batch", 3, _SIDE, _SIDE)
    )
    nodes = [
        make("ReduceMean", ["pixel_values"], ["mean"], axes=[2, 3], keepdims=0),
        make("ReduceMean", ["mean"], ["gray"], axes=[1], keepdims=1),
        make("Sub", ["mean", "gray"], ["image_embeds"]),
    ]
    save("vision_model.onnx", nodes, image, "image_embeds", [])
    ids = helper.make_tensor_value_info("input_ids", TensorProto.INT64, ("batch", _LENGTH))
    axes = numpy_helper.from_array(np.array([1], np.int64), "axes")
    nodes = [
        make("Gather", ["table", "input_ids"], ["each"]),
        make("ReduceSum", ["each", "axes"], ["text_embeds"], keepdims=0),
    ]
    tensors = [numpy_helper.from_array(table, "table"), axes]
    save("text_model.onnx", nodes, ids, "text_embeds", tensors)
    _write_tokenizer(folder, list(words))
    preparation = {"image_mean": [0.5] * 3, "image_std": [0.5] * 3, "size": {"shortest_edge": 16}}
    (folder / "preprocessor_config.json").write_text(json.dumps(preparation), encoding="utf-8")
    return folder


def _write_tokenizer(folder: Path, words: list[str]) -> None:
    import tokenizers

    numbers = {word: number for number, word in enumerate(["[PAD]", "[UNK]", *words])}
    tokenizer = tokenizers.Tokenizer(tokenizers.models.WordLevel(numbers, unk_token="[UNK]"))
    tokenizer.normalizer = tokenizers.normalizers.Lowercase()
    tokenizer.pre_tokenizer = tokenizers.pre_tokenizers.Whitespace()
    tokenizer.save(str(folder / "tokenizer.json"))
    settings = {"pad_token": "[PAD]", "model_max_length": _LENGTH}
    (folder / "tokenizer_config.json").write_text(json.dumps(settings), encoding="utf-8")
