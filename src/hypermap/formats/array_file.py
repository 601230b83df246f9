"""Named arrays of numbers and shapes in the bytes of one file, exactly as they are.

A line of JSON says what there is, and the arrays follow one behind the other. The specification is
in docs/formats/mapper_state.md.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pydantic_core
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.errors import FormatError
from hypermap.core.tangles import has_empty_hole
from hypermap.formats.columns.footprints import footprints_from_wkb

_SIZES = {"<f8": 8, "<f4": 4, "<f2": 2, "<i8": 8, "<u4": 4, "|u1": 1}  # bytes of each type
_MOST_HEADER = 16_000_000  # bytes
_WRONG = (KeyError, TypeError, ValueError, OverflowError, shapely.GEOSException)


@dataclass(frozen=True)
class ArrayFile:
    """What such a file holds.

    Attributes:
        facts: of what JSON can hold.
        arrays: by name; of float64, float32, float16, int64, uint32 or uint8.
    """

    facts: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def dump_arrays(content: ArrayFile, format_name: str, version: int) -> bytes:
    """Return a file; `parse_arrays` gives the same again, to the last bit."""
    header = {
        "format": format_name,
        "version": version,
        "facts": content.facts,
        "arrays": [[name, a.dtype.str, list(a.shape)] for name, a in content.arrays.items()],
    }
    parts = [json.dumps(header, separators=(",", ":"), allow_nan=False).encode(), b"\n"]
    for array in content.arrays.values():
        # The first bytes of all numbers, then the second: so they compress better.
        flat = np.frombuffer(array.tobytes(), np.uint8).reshape(-1, array.dtype.itemsize)
        parts.append(flat.T.tobytes())
    return b"".join(parts)


def parse_arrays(content: bytes, format_name: str, version: int, path: str) -> ArrayFile:
    """Return what a file holds.

    Args:
        content: the file.
        format_name: what it must say that it is.
        version: the newest that is understood.
        path: how messages name it.

    Raises:
        FormatError: If it is another one, of another version, or damaged.
    """
    end = content.find(b"\n", 0, _MOST_HEADER)
    try:
        header = pydantic_core.from_json(content[: max(end, 0)])  # faster than json
    except ValueError:
        header = None
    if not isinstance(header, dict) or header.get("format") != format_name:
        raise FormatError(f"does not say that its format is {format_name!r}", path=path)
    given = header.get("version")
    if type(given) is not int or not 1 <= given <= version:
        known = "1" if version == 1 else f"1 to {version}"
        raise FormatError(f"is of version {given!r}; this program reads {known}", path=path)
    try:
        return ArrayFile(dict(header["facts"]), _arrays(header["arrays"], content, end + 1))
    except _WRONG as error:
        raise FormatError(f"is damaged: {error}", path=path) from None


def _arrays(described: Any, content: bytes, begin: int) -> dict[str, NDArray[Any]]:
    """Return the arrays, which begin at a byte of the file."""
    arrays: dict[str, NDArray[Any]] = {}
    for name, kind, shape in described:
        if kind not in _SIZES or not all(type(n) is int and n >= 0 for n in shape):
            raise ValueError(f"{name!r} is described as {kind!r} of the shape {shape!r}")
        count = _SIZES[kind] * math.prod(shape)
        if begin + count > len(content):
            raise ValueError(f"{name!r} ends too early")
        flat = np.frombuffer(content, np.uint8, count, begin)
        size = _SIZES[kind]
        whole = flat.copy() if size == 1 else flat.reshape(size, -1).T.copy().view(kind)
        arrays[name] = whole.reshape(shape)
        begin += count
    if begin != len(content):
        raise ValueError(f"{len(content) - begin} bytes are left over")
    return arrays


def packed_shapes(name: str, shapes: ObjectArray) -> dict[str, NDArray[Any]]:
    """Return geometries as arrays: their points, and WKB of the same without places."""
    bare = shapely.to_wkb(shapely.transform(shapes, np.zeros_like), byte_order=1)
    return {
        f"{name}.points": shapely.get_coordinates(shapes).T.copy(),
        f"{name}.wkb": np.frombuffer(b"".join(bare), np.uint8),
        f"{name}.lengths": np.array([len(one) for one in bare], np.int64),
    }


def unpacked_shapes(name: str, arrays: Mapping[str, NDArray[Any]]) -> ObjectArray:
    """Return the geometries of `packed_shapes`.

    Raises:
        KeyError, ValueError, GEOSException: If the arrays hold none.
    """
    wkb, lengths = arrays[f"{name}.wkb"].tobytes(), arrays[f"{name}.lengths"]
    if (lengths < 0).any() or lengths.sum() != len(wkb):
        raise ValueError(f"the lengths of {name} do not match the data")
    ends = np.cumsum(lengths).tolist()
    bare = [wkb[end - n : end] for end, n in zip(ends, lengths.tolist(), strict=True)]
    shapes = footprints_from_wkb(as_objects(bare))
    kinds = (shapely.GeometryType.POLYGON, shapely.GeometryType.MULTIPOLYGON)
    points = arrays[f"{name}.points"].T
    if not (np.isin(shapely.get_type_id(shapes), kinds).all() and np.isfinite(points).all()):
        raise ValueError(f"{name} are not polygons")
    if has_empty_hole(shapes).any():
        raise ValueError(f"one of {name} has an empty hole")
    return np.asarray(shapely.set_coordinates(shapes, points))
