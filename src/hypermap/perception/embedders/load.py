"""Loads an embedder from a user's argument: a folder of ONNX encoders, or the name of a plug-in."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.entry_points import entry_point, installed
from hypermap.perception.embedders.embedder import Embedder

ENTRY_POINT_GROUP = "hypermap.embedders"
ENVIRONMENT = "HYPERMAP_EMBEDDER"
"""Names the embedder to use where no other is named."""


def load_embedder(path: str | Path, threads: int | None = None) -> Embedder:
    """Return the embedder in a folder, or one of a plug-in.

    Args:
        path: a folder, see `OnnxEmbedder`; or ``name:argument``, where `name` is an entry point in
            the group `hypermap.embedders` whose value makes an embedder from the argument.
        threads: how many encoders in a folder may use; None for all cores.

    Raises:
        FileMissing: If there is no such folder, or an encoder is missing in it.
        FormatError: If an encoder cannot be read.
        HypermapError: If no embedder of that name is installed, or it cannot be made.
    """
    name, colon, argument = str(path).partition(":")
    plugin = entry_point(ENTRY_POINT_GROUP, name)
    if colon and plugin is not None:
        try:
            made: Embedder = plugin.load()(argument)
        except (HypermapError, MemoryError):
            raise
        except Exception as error:
            raise HypermapError(
                f"embedder plug-in {name!r} cannot be created from {argument!r}: {error}"
            ) from error
        return made
    if colon and not Path(path).exists():
        hint = did_you_mean(name, installed(ENTRY_POINT_GROUP))
        raise HypermapError(f"{path}: no embedder {name!r} is installed; {hint}")
    from hypermap.perception.embedders.onnx_embedder import OnnxEmbedder

    return OnnxEmbedder(path, threads)


def embedder_in_use() -> Embedder:
    """Return the embedder that the environment variable HYPERMAP_EMBEDDER names.

    Raises:
        HypermapError: If it names none, or a wrong one.
    """
    path = os.environ.get(ENVIRONMENT)
    if not path:
        raise HypermapError(
            "to search by appearance, name the encoders that mapping used: "
            f"--embedder FOLDER, or {ENVIRONMENT} in the environment"
        )
    return _kept(path)


@lru_cache(maxsize=1)
def _kept(path: str) -> Embedder:
    return load_embedder(path)
