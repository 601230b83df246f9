"""Arrays of numbers as `.npy` files, read safely even from untrusted sources.

Source: numpy's NEP 1. `numpy.load` would also allow pickled objects, and shapes that fill the
memory.
"""

from __future__ import annotations

import io
import re
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from hypermap.core.errors import FormatError

_HEADER = re.compile(
    rb"\x93NUMPY\x01\x00(..)\{'descr': '([<>=|]\w\d+)', 'fortran_order': False, "
    rb"'shape': \((\d{1,9}), (\d{1,9})\), \} *\n",
    re.DOTALL,
)


def dump_npy(array: NDArray[Any], dtype: DTypeLike) -> bytes:
    """Return an array of rows and columns as a file."""
    content = io.BytesIO()
    np.lib.format.write_array(content, np.ascontiguousarray(array, dtype), version=(1, 0))
    return content.getvalue()


def parse_npy(content: bytes, dtype: DTypeLike, path: str) -> NDArray[Any]:
    """Return the rows and columns that a file holds, read-only, shape (R, C).

    Args:
        content: the file.
        dtype: the type that its numbers must have, as "<f4".
        path: how messages name it.

    Raises:
        FormatError: If it holds something else.
    """
    numbers = np.dtype(dtype)
    header = _HEADER.match(content)
    if (
        header is None
        or header.end() != 10 + int.from_bytes(header[1], "little")
        or header[2].decode() != numbers.str
    ):
        expected = f"rows and columns of {numbers.name}, as numpy.save writes them"
        raise FormatError(f"is not a .npy file of {expected}", path=path)
    rows, cols, data = int(header[3]), int(header[4]), content[header.end() :]
    if len(data) != rows * cols * numbers.itemsize:
        raise FormatError(f"its {len(data)} bytes are not {rows} x {cols} numbers", path=path)
    return np.frombuffer(data, dtype=numbers).reshape(rows, cols)
