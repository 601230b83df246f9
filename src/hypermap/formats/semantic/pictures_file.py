"""The pictures of objects as a file of arrays.

The specification is docs/formats/pictures.md.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.core.layer import Store
from hypermap.core.pictures import ObjectPicture, best_pictures
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import limits
from hypermap.formats.array_file import ArrayFile, dump_arrays, parse_arrays

logger = logging.getLogger(__name__)

KEY = "pictures"
"""The key of a layer's configuration that names the file of the pictures of its objects."""

FORMAT = "hypermap pictures"
VERSION = 1

Pictures = Mapping[int, Sequence[ObjectPicture]]


def load_pictures(
    store: Store, settings: Mapping[str, Any]
) -> dict[int, tuple[ObjectPicture, ...]]:
    """Return the pictures that a layer's configuration names, by the objects' ids.

    Older programs do not copy the file. Without it, and if it is damaged, the map still opens, and
    a warning is logged.
    """
    name = settings.get(KEY)
    if not isinstance(name, str):
        return {}
    try:
        return parse_pictures(store.read(name), store.path_of(name))
    except FormatError as error:
        logger.warning("the pictures of the objects are missing: %s", error)
        return {}


def save_pictures(layer: SemanticLayer, store: Store, file: str) -> Mapping[str, Any]:
    """Write the pictures of a layer's objects next to the layer's file.

    Of too many, only the best one of each object is written; this is logged.

    Returns:
        What the layer's configuration has to say; nothing if there are no pictures.
    """
    found: Pictures = layer.pictures_by_id()
    for most in (None, 1, 0):
        found = {number: kept[:most] for number, kept in found.items() if kept[:most]}
        if _size(found) <= limits.MAX_PICTURES_BYTES:
            break
        megabytes = _size(found) // 1_000_000
        logger.warning(
            "layer %r: pictures are left out: %d MB of them are too much", layer.name, megabytes
        )
    if not found:
        return {}
    name = f"{file}.{KEY}"
    store.write(name, dump_pictures(found))
    return {KEY: name}


def without_pictures(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return a layer's configuration without the keys about pictures."""
    return {key: value for key, value in settings.items() if key != KEY}


def dump_pictures(pictures: Pictures) -> bytes:
    """Return a file; `parse_pictures` gives the same again."""
    return dump_arrays(ArrayFile({}, packed_pictures(pictures)), FORMAT, VERSION)


def parse_pictures(content: bytes, path: str) -> dict[int, tuple[ObjectPicture, ...]]:
    """Return the pictures in a file, by the objects' ids.

    Args:
        content: the file.
        path: how messages name it.

    Raises:
        FormatError: If it has none, or is of a later version.
    """
    try:
        return unpacked_pictures(parse_arrays(content, FORMAT, VERSION, path).arrays)
    except (KeyError, ValueError, TypeError, OverflowError) as error:
        raise FormatError(f"is damaged: {error}", path=path) from None


def packed_pictures(pictures: Pictures) -> dict[str, NDArray[Any]]:
    """Return pictures as arrays, those of one object behind each other."""
    rows = [(number, each) for number, kept in pictures.items() for each in kept]
    numbers = [(each.stamp, each.azimuth, each.quality, each.sharpness) for _, each in rows]
    return {
        "picture.object": np.array([number for number, _ in rows], np.int64),
        "picture.numbers": np.array(numbers, np.float64).reshape(-1, 4),
        "picture.length": np.array([len(each.jpeg) for _, each in rows], np.int64),
        "picture.jpeg": np.frombuffer(b"".join(each.jpeg for _, each in rows), np.uint8),
    }


def unpacked_pictures(arrays: Mapping[str, NDArray[Any]]) -> dict[int, tuple[ObjectPicture, ...]]:
    """Return the pictures of `packed_pictures`, by the objects' ids.

    Raises:
        KeyError, ValueError: If the arrays hold none.
    """
    content, lengths = arrays["picture.jpeg"].tobytes(), arrays["picture.length"]
    ids, numbers = arrays["picture.object"], arrays["picture.numbers"]
    if ids.shape != lengths.shape or numbers.shape != (len(ids), 4) or ids.dtype != np.int64:
        raise ValueError("the columns of the pictures differ in length")
    if lengths.dtype != np.int64 or (lengths < 0).any() or lengths.sum() != len(content):
        raise ValueError("the lengths of the pictures do not match the data")
    found: dict[int, list[ObjectPicture]] = {}
    ends = np.cumsum(lengths).tolist()
    for number, values, length, end in zip(
        ids.tolist(), numbers.tolist(), lengths.tolist(), ends, strict=True
    ):
        found.setdefault(number, []).append(ObjectPicture(content[end - length : end], *values))
    return {number: best_pictures(kept) for number, kept in found.items()}


def _size(pictures: Pictures) -> int:
    return sum(len(each.jpeg) for kept in pictures.values() for each in kept)
