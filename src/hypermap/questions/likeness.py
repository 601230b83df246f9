"""Finds the objects whose embeddings are most similar to a vector.

A first pass over numbers of one byte leaves few candidates, which are then compared exactly: by the
Cauchy-Schwarz inequality, a cosine is off by no more than the length of the error of the rounded
vector.
"""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import IntArray
from hypermap.core.embeddings import Embeddings, TextEncoder
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap, Matches
from hypermap.core.outside import text_encoder
from hypermap.core.semantic import SemanticLayer

_FEW = 2_000  # embeddings; so many are compared exactly at once
_THREADS = 2
_USUAL = 5  # objects, if nothing says how many


def most_like(
    hypermap: Hypermap,
    text: str,
    found: Matches,
    count: int | None = None,
    encoder: TextEncoder | None = None,
) -> tuple[IntArray, NDArray[np.float32]]:
    """Return which objects look most like a text.

    Args:
        hypermap: their map.
        text: what they are to look like.
        found: the objects.
        count: how many at most; None for 5.
        encoder: of the text; None for the one that the environment names.

    Returns:
        The rows of the objects, and the cosines, shape (K,) each, the largest first.

    Raises:
        HypermapError: If no object of the map was embedded, or by other encoders.
    """
    layers = [layer for layer in hypermap if isinstance(layer, SemanticLayer)]
    embedded = [layer for layer in layers if layer.kept_embeddings is not None]
    if not embedded:
        raise HypermapError(
            "the objects of this map have no embeddings; `hypermap map --embedder FOLDER` makes "
            "them"
        )
    encoder = text_encoder() if encoder is None else encoder
    (vector,) = encoder.texts([text])
    cosines = np.full(len(found), np.nan, dtype=np.float32)
    for layer in embedded:
        kept = layer.kept_embeddings
        assert kept is not None  # or it would not be among them
        if kept.model != encoder.model or kept.vectors.shape[1] != len(vector):
            raise HypermapError(
                f"the objects of layer {layer.name!r} were embedded by {kept.model!r}, and the "
                f"text by {encoder.model!r}; use the same encoders"
            )
        rows = np.flatnonzero(found.are_of(layer.name))
        ids = found.take(rows).column("ids")
        if len(ids) > _FEW and np.array_equal(ids, kept.ids):
            best, known = most_similar(kept, vector, count or _USUAL)
            cosines[rows[np.searchsorted(ids, best)]] = known
        else:
            cosines[rows] = kept.similarities(vector, ids)
    order = np.argsort(-cosines, kind="stable")
    order = order[~np.isnan(cosines[order])][: count or _USUAL]
    return order, cosines[order]


def most_similar(
    embeddings: Embeddings, vector: NDArray[np.float32], k: int
) -> tuple[IntArray, NDArray[np.float32]]:
    """Return the k objects that are most similar to a unit vector.

    Args:
        embeddings: of the objects.
        vector: of length 1, shape (D,).
        k: how many at most.

    Returns:
        Their ids, shape (K,), and the cosines, the largest first.
    """
    rows = np.arange(len(embeddings))
    if len(rows) > _FEW:
        coarse, error = _coarse_cosines(embeddings, vector)
        least = np.partition(coarse, len(rows) - k)[len(rows) - k] if k < len(rows) else -np.inf
        rows = np.flatnonzero(coarse >= least - 2 * error)
    ids = embeddings.ids[rows]
    cosines = embeddings.similarities(vector, ids)
    order = np.argsort(-cosines, kind="stable")[:k]
    return ids[order], cosines[order]


def _coarse_cosines(
    embeddings: Embeddings, vector: NDArray[np.float32]
) -> tuple[NDArray[np.float32], float]:
    """Return about the cosine of each embedding, shape (N,), and how far they are off at most."""
    codes, scales, error = embeddings.coarse
    steps = min(32_767, (2**31 - 1) // (127 * len(vector)))  # so that no sum overflows
    step = max(float(np.abs(vector).max()), 1e-12) / steps
    wanted = np.rint(vector / step).astype(np.int16)
    sums = np.empty(len(codes), dtype=np.float32)
    bounds = np.linspace(0, len(codes), _THREADS + 1, dtype=np.int64).tolist()
    with ThreadPoolExecutor(_THREADS) as pool:
        parts = itertools.pairwise(bounds)
        list(pool.map(lambda part: _scan(codes, wanted, sums, *part), parts))
    rounding = 0.5 * step * float(np.sqrt(len(vector)))  # of the vector that is looked for
    return sums * scales * np.float32(step), error + 1.01 * rounding + 1e-5


@loop(nogil=True)
def _scan(
    codes: NDArray[np.int8],
    wanted: NDArray[np.int16],
    sums: NDArray[np.float32],
    begin: int,
    end: int,
) -> None:
    """Fill `sums`, shape (N,), with the products of rows of `codes`, (N, D), and `wanted`, (D,)."""
    for i in range(begin, end):
        total = np.int32(0)
        for j in range(codes.shape[1]):
            total += np.int32(codes[i, j]) * np.int32(wanted[j])
        sums[i] = total
