"""How a flow layer is kept: `FILE.npy` holds the headings, `FILE.yaml` where they lie.

The YAML file has the keys `resolution` (meters) and `origin` (x, y, yaw of the lower left corner of
the first cell; meters, radians). The first row of numbers is the lowest.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flow_layer.layer import FlowLayer
from hypermap.core.errors import FormatError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.layer import Store
from hypermap.formats.yaml_text import read_yaml, write_yaml

_DTYPE = np.dtype("<f4")
# All that may stand before the numbers. `numpy.load` would allow more: pickled objects, and shapes
# that fill the memory.
_HEADER = re.compile(
    rb"\x93NUMPY\x01\x00(..)\{'descr': '<f4', 'fortran_order': False, "
    rb"'shape': \(([1-9]\d{0,8}), ([1-9]\d{0,8})\), \} *\n",
    re.DOTALL,
)
_MAX_NUMBER = 1e9  # meters; also refuses infinity and NaN


class FlowFiles:
    """The plug-in: what Hypermap calls to make, open and save flow layers."""

    def empty(self, name: str, frame_id: str, settings: Mapping[str, Any]) -> FlowLayer:
        """Return a layer that holds nothing yet."""
        return FlowLayer(name, frame_id, settings=settings)

    def load(
        self, store: Store, file: str, name: str, frame_id: str, settings: Mapping[str, Any]
    ) -> FlowLayer:
        """Return the layer kept under `file`.

        Raises:
            FormatError: If its files are missing or hold something else.
        """
        numbers, about = f"{file}.npy", f"{file}.yaml"
        cells = _read_numbers(store.read(numbers), store.path_of(numbers))
        path = store.path_of(about)
        keys = read_yaml(store.read(about), path)
        if not isinstance(keys, Mapping):
            raise FormatError("expected keys and values", path=path)
        x, y, yaw = _numbers(keys, "origin", 3, path)
        (resolution,) = _numbers(keys, "resolution", 1, path)
        try:
            grid = GridGeometry(cells.shape[1], cells.shape[0], resolution, Pose2D(x, y, yaw))
        except ValueError as error:
            raise FormatError(str(error), path=path) from error
        return FlowLayer(name, frame_id, grid, cells, settings)

    def save(self, layer: FlowLayer, store: Store, file: str) -> None:
        """Write the layer's files; an empty layer needs none."""
        if layer.grid is None or layer.cells is None:
            return
        content = io.BytesIO()
        np.lib.format.write_array(content, layer.cells.astype(_DTYPE), version=(1, 0))
        store.write(f"{file}.npy", content.getvalue())
        origin = layer.grid.origin
        about = {
            "resolution": layer.grid.resolution,
            "origin": [origin.x, origin.y, origin.yaw],
        }
        store.write(f"{file}.yaml", write_yaml(about))


PLUGIN = FlowFiles()


def _read_numbers(content: bytes, path: str) -> NDArray[np.float32]:
    """Return the array of an .npy file."""
    header = _HEADER.match(content)
    if header is None or header.end() != 10 + int.from_bytes(header[1], "little"):
        expected = "rows and columns of float32, as numpy.save writes them"
        raise FormatError(f"is no .npy file of {expected}", path=path)
    rows, cols, data = int(header[2]), int(header[3]), content[header.end() :]
    if len(data) != rows * cols * _DTYPE.itemsize:
        raise FormatError(f"its {len(data)} bytes are not {rows} x {cols} numbers", path=path)
    cells = np.frombuffer(data, dtype=_DTYPE).reshape(rows, cols)
    if (np.abs(cells) > np.float32(np.pi)).any():
        raise FormatError("holds headings that are not from -pi to pi", path=path)
    return cells


def _numbers(keys: Mapping[Any, Any], key: str, count: int, path: str) -> list[float]:
    """Return the numbers under a key: a list, or a single one."""
    found = keys.get(key)
    given: list[Any] = found if isinstance(found, list) else [found]
    values = [float(x) for x in given if type(x) in (int, float) and abs(x) < _MAX_NUMBER]
    if len(values) != count or len(given) != count:
        expected = "a number" if count == 1 else f"{count} numbers"
        raise FormatError(f"expected {expected}, found {found!r}", path=path, key=key)
    return values
