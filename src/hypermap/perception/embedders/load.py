"""Loads an embedder from a user's argument: a folder of ONNX encoders, or the name of a plug-in."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.entry_points import entry_point, in_words, installed, is_packages_fault
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
        return _Named(f"embedder plug-in {name!r} ({plugin.value})", plugin.load, argument)
    if colon and not Path(path).exists():
        hint = did_you_mean(name, installed(ENTRY_POINT_GROUP))
        raise HypermapError(f"{path}: no embedder {name!r} is installed; {hint}")
    from hypermap.perception.embedders.onnx_embedder import OnnxEmbedder

    return OnnxEmbedder(path, threads)


class _Named:
    """An embedder of another package, whose name is in its errors."""

    def __init__(self, name: str, load: Callable[[], Any], argument: str) -> None:
        """Make it from its argument.

        Raises:
            HypermapError: If that cannot be done.
        """
        self._name = name
        with self._errors(f"cannot be created from {argument!r}"):
            self._embedder = load()(argument)
            self.model: str = self._embedder.model

    def images(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        """Return a unit vector for each RGB image, uint8, (H, W, 3); shape (N, D)."""
        with self._errors("cannot embed images"):
            vectors: NDArray[np.float32] = self._embedder.images(images)
        return vectors

    def texts(self, texts: list[str]) -> NDArray[np.float32]:
        """Return a unit vector for each text, shape (N, D)."""
        with self._errors("cannot embed texts"):
            vectors: NDArray[np.float32] = self._embedder.texts(texts)
        return vectors

    @contextmanager
    def _errors(self, what: str) -> Iterator[None]:
        try:
            yield
        except HypermapError:
            raise
        except BaseException as error:
            if not is_packages_fault(error):
                raise
            raise HypermapError(f"{self._name} {what}: {in_words(error)}") from error


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
