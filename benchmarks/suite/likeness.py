"""The objects that look most like a text, among many embeddings: a search without an index."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hypermap.core.embeddings import Embeddings
from hypermap.questions.likeness import most_similar
from suite.race import Disagreement, Figure, Row, Settings, each_of, library, race, run_of

NUMBERS, WANTED = 512, 5
ASKED = 100.0  # [ms] among a million, on two cores
_AT_ONCE = 50_000

Ids = NDArray[np.int64]


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the time of a search, alone and beside others that find the same."""
    count = 20_000 if settings.quick else 1_000_000
    embeddings, vector = _embeddings(count)

    def ours() -> Ids:
        return most_similar(embeddings, vector, WANTED)[0]

    ours()
    run = run_of(ours)
    values = tuple(1e3 * run() for _ in range(settings.repeat))
    work = f"the {WANTED} most similar of {count:,} embeddings of {NUMBERS} numbers"
    yield Figure(work, values, "ms", ASKED, less_is_better=True)

    singles = embeddings.vectors.astype(np.float32)
    peers: Mapping[str, Callable[[Settings], Iterator[Row]]] = {
        "numpy": partial(_beside_numpy, work, ours, singles, vector),
        "faiss": partial(_beside_faiss, work, ours, singles, vector),
    }
    yield from each_of(settings, peers)


def _beside_numpy(
    work: str,
    ours: Callable[[], Ids],
    singles: NDArray[np.float32],
    vector: NDArray[np.float32],
    settings: Settings,
) -> Iterator[Row]:
    def theirs() -> Ids:
        cosines = singles @ vector
        best = np.argpartition(-cosines, WANTED)[:WANTED]
        return best[np.argsort(-cosines[best])]

    peer = f"numpy {np.__version__} (C)"
    yield race(work, peer, ours, theirs, _same, settings)


def _beside_faiss(
    work: str,
    ours: Callable[[], Ids],
    singles: NDArray[np.float32],
    vector: NDArray[np.float32],
    settings: Settings,
) -> Iterator[Row]:
    faiss = library("faiss")
    index = faiss.IndexFlatIP(NUMBERS)
    index.add(singles)

    def theirs() -> Ids:
        found: Ids = index.search(vector[np.newaxis], WANTED)[1][0]
        return found

    yield race(work, f"faiss {faiss.__version__}, IndexFlatIP (C++)", ours, theirs, _same, settings)


def _same(ours: Ids, theirs: Ids) -> str:
    if ours.tolist() != theirs.tolist():
        raise Disagreement(f"{ours.tolist()} is not {theirs.tolist()}")
    return "the same ids in the same order"


def _embeddings(count: int) -> tuple[Embeddings, NDArray[np.float32]]:
    """Return random embeddings of length 1, and one to look for."""
    rng = np.random.default_rng(count)
    vectors = np.empty((count, NUMBERS), dtype=np.float16)
    for begin in range(0, count, _AT_ONCE):
        part = rng.standard_normal((min(_AT_ONCE, count - begin), NUMBERS), dtype=np.float32)
        vectors[begin : begin + len(part)] = part / np.linalg.norm(part, axis=1, keepdims=True)
    vector = rng.standard_normal(NUMBERS, dtype=np.float32)
    lengths = np.ones(count, dtype=np.float32)
    embeddings = Embeddings("random", np.arange(count), vectors, lengths)
    return embeddings, vector / np.linalg.norm(vector)
