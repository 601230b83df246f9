"""The embeddings of objects as a file of arrays.

The specification is docs/formats/embeddings.md.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.embeddings import Embeddings
from hypermap.core.errors import FormatError
from hypermap.core.layer import Store
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import limits
from hypermap.formats.array_file import ArrayFile, dump_arrays, parse_arrays

logger = logging.getLogger(__name__)

KEY = "embeddings"
"""The key of a layer's configuration that names the file of the embeddings of its objects."""

FORMAT = "hypermap embeddings"
VERSION = 1


def load_embeddings(store: Store, settings: Mapping[str, Any]) -> Embeddings | None:
    """Return the embeddings that a layer's configuration names; None if there are none.

    Older programs do not copy the file. Without it, and if it is damaged, the map still opens, and
    a warning is logged.
    """
    name = settings.get(KEY)
    if not isinstance(name, str):
        return None
    try:
        return parse_embeddings(store.read(name), store.path_of(name))
    except FormatError as error:
        logger.warning("the embeddings of the objects are missing: %s", error)
        return None


def save_embeddings(layer: SemanticLayer, store: Store, file: str) -> Mapping[str, Any]:
    """Write the embeddings of a layer's objects next to the layer's file.

    Returns:
        What the layer's configuration has to say; nothing if there are none, or too many, which is
        logged.
    """
    kept = layer.kept_embeddings
    if kept is None:
        return {}
    found = kept.of_objects(layer.ids)
    if not len(found):
        return {}
    if found.vectors.nbytes > limits.MAX_EMBEDDINGS_BYTES:
        megabytes = found.vectors.nbytes // 1_000_000
        logger.warning(
            "layer %r: embeddings are left out: %d MB of them are too much", layer.name, megabytes
        )
        return {}
    name = f"{file}.{KEY}"
    store.write(name, dump_embeddings(found))
    return {KEY: name}


def without_embeddings(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return a layer's configuration without the keys about embeddings."""
    return {key: value for key, value in settings.items() if key != KEY}


def dump_embeddings(embeddings: Embeddings) -> bytes:
    """Return a file; `parse_embeddings` gives the same again."""
    file = ArrayFile({"model": embeddings.model}, packed_embeddings(embeddings))
    return dump_arrays(file, FORMAT, VERSION)


def parse_embeddings(content: bytes, path: str) -> Embeddings:
    """Return the embeddings in a file.

    Args:
        content: the file.
        path: how messages name it.

    Raises:
        FormatError: If it has none, or is of a later version.
    """
    file = parse_arrays(content, FORMAT, VERSION, path)
    try:
        return unpacked_embeddings(file.facts["model"], file.arrays)
    except (KeyError, ValueError, TypeError) as error:
        raise FormatError(f"is damaged: {error}", path=path) from None


def packed_embeddings(embeddings: Embeddings) -> dict[str, NDArray[Any]]:
    """Return embeddings as arrays."""
    return {
        "embedding.object": embeddings.ids,
        "embedding.vector": embeddings.vectors,
        "embedding.length": embeddings.lengths,
    }


def unpacked_embeddings(model: Any, arrays: Mapping[str, NDArray[Any]]) -> Embeddings:
    """Return the embeddings of `packed_embeddings`.

    Args:
        model: the encoders that made them.
        arrays: the columns.

    Raises:
        KeyError, ValueError, TypeError: If the arrays hold none.
    """
    if not isinstance(model, str):
        raise TypeError("the model of the embeddings is not text")
    ids, lengths = arrays["embedding.object"], arrays["embedding.length"]
    if ids.dtype != np.int64 or ids.ndim != 1:
        raise ValueError("the ids of the embeddings are not a column of integers")
    return Embeddings(model, ids, arrays["embedding.vector"], lengths)
