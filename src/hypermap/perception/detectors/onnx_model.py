"""The bridge to ONNX Runtime: a network in a file, as a function from one image to arrays."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FileMissing, FormatError
from hypermap.core.outside import refuse_pointer
from hypermap.perception.detectors.labels import parse_literal

DEFAULT_SIDE = 640  # for a network that takes any size and does not name one
MAX_SIDE = 8192
INPUT_TYPES = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
# In which networks are trained, or run by other programs:
_OTHER_FORMATS = {".pt", ".pth", ".ckpt", ".safetensors", ".engine", ".tflite", ".pb", ".h5"}
SIZE_INPUT = "orig_target_sizes"  # of RT-DETR and D-FINE: columns and rows that boxes refer to


@dataclass(frozen=True)
class OnnxModel:
    """A network that takes one image.

    Attributes:
        path: its file.
        metadata: written by its author.
        input_size: columns and rows of the image that it takes.
    """

    path: Path
    metadata: Mapping[str, str]
    input_size: tuple[int, int]
    _session: Any

    @classmethod
    def load(cls, path: str | Path, threads: int | None = None) -> OnnxModel:
        """Return the network in a file.

        Raises:
            FileMissing: If there is no such file.
            FormatError: If it is not a network, or the network takes something other than an image.
        """
        path = Path(path)
        if not path.exists():
            raise FileMissing(f"{path}: there is no such model")
        if not path.is_file():
            raise FormatError("a folder; expected an ONNX file", path=path)
        session = open_session(path, threads)
        metadata = dict(session.get_modelmeta().custom_metadata_map)
        return cls(path, metadata, _input_size(path, session.get_inputs(), metadata), session)

    def run(self, image: NDArray[np.float32]) -> dict[str, NDArray[np.float32]]:
        """Return the outputs that are arrays of numbers, by name.

        Args:
            image: in the network's own colors and size, shape (H, W, 3).

        Raises:
            FormatError: If the network fails, or returns anything but finite numbers.
        """
        try:
            outputs = self._session.run(None, self._inputs(image))
        except MemoryError:
            raise
        except Exception as error:  # ONNX Runtime's errors have no common class of their own
            raise FormatError(
                f"the model fails on an image of {image.shape[1]} x {image.shape[0]} pixels: "
                f"{_reason(error)}",
                path=self.path,
            ) from error
        names = [output.name for output in self._session.get_outputs()]
        arrays = {
            name: output.astype(np.float32, copy=False)
            for name, output in zip(names, outputs, strict=True)
            if isinstance(output, np.ndarray) and output.dtype.kind in "fiu"
        }
        if not all(np.isfinite(array).all() for array in arrays.values()):
            raise FormatError("the model returned NaN or infinity", path=self.path)
        return arrays

    def _inputs(self, image: NDArray[np.float32]) -> dict[str, NDArray[Any]]:
        batch = image.transpose(2, 0, 1)[np.newaxis]
        return {
            entry.name: np.array([self.input_size], np.int64)
            if entry.name == SIZE_INPUT
            else np.ascontiguousarray(batch, INPUT_TYPES[entry.type])
            for entry in self._session.get_inputs()
        }


def open_session(path: Path, threads: int | None) -> Any:
    """Return ONNX Runtime's session of a file; `threads` is how many it may use, None for all.

    Raises:
        FormatError: If it is not a network that can be run here.
    """
    # Some builds report what is loaded to their vendor; turn that off.
    os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
    import onnxruntime  # slow to import

    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4  # only fatal messages: errors are raised
    options.intra_op_num_threads = threads or 0
    # Waiting threads sleep: as fast, and the cores are free for the rest of the mapping.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        return onnxruntime.InferenceSession(
            path, sess_options=options, providers=["CPUExecutionProvider"]
        )
    except Exception as error:  # ONNX Runtime's errors have no common class of their own
        refuse_pointer(path)
        if path.suffix.lower() in _OTHER_FORMATS:
            raise FormatError(
                f"a {path.suffix} file, not ONNX; export the network first, as with `yolo export "
                f"model={path.name} format=onnx` (docs/detectors.md)",
                path=path,
            ) from error
        raise FormatError(
            f"not a complete ONNX model that can be run here: {_reason(error)}", path=path
        ) from error


def _input_size(path: Path, inputs: list[Any], metadata: Mapping[str, str]) -> tuple[int, int]:
    """Return columns and rows of the image; check that the network takes an image."""
    images = [entry for entry in inputs if not _is_size(entry)]
    if len(images) != 1 or not _is_image(images[0]):
        found = ", ".join(f"{entry.name} {entry.type} {entry.shape}" for entry in inputs)
        raise FormatError(
            f"the model takes {found or 'nothing'}; "
            "expected one image, float, (1, 3, rows, columns)",
            path=path,
        )
    _, _, height, width = images[0].shape
    rows, columns = _size_in_metadata(path, metadata)
    size = (
        width if isinstance(width, int) else columns,
        height if isinstance(height, int) else rows,
    )
    if not all(1 <= side <= MAX_SIDE for side in size):
        raise FormatError(
            f"the model takes images of {size[0]} x {size[1]} pixels; "
            f"expected 1 to {MAX_SIDE} a side",
            path=path,
        )
    return size


def _is_size(entry: Any) -> bool:
    return entry.name == SIZE_INPUT and entry.type == "tensor(int64)" and len(entry.shape) == 2


def _is_image(entry: Any) -> bool:
    """Return whether an input takes an image; open sizes are names or None, not numbers."""
    if entry.type not in INPUT_TYPES or len(entry.shape) != 4:
        return False
    return all(
        size == wanted or not isinstance(size, int)
        for size, wanted in zip(entry.shape, (1, 3), strict=False)
    )


def _size_in_metadata(path: Path, metadata: Mapping[str, str]) -> tuple[int, int]:
    text = metadata.get("imgsz", f"[{DEFAULT_SIDE}, {DEFAULT_SIDE}]")
    try:
        size = parse_literal(text)
        rows, columns = (size, size) if isinstance(size, int) else size
        return int(rows), int(columns)
    except (TypeError, ValueError, OverflowError) as error:  # OverflowError: of inf
        raise FormatError(
            f"expected [rows, columns], got {text[:60]!r}", path=path, key="metadata imgsz"
        ) from error


def _reason(error: Exception) -> str:
    """Return the part of ONNX Runtime's message that helps a user."""
    return str(error).split("failed:")[-1].strip().partition("\n")[0]
