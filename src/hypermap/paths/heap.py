"""A binary heap of numbered items whose keys may decrease, for compiled loops."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop


class Heap(NamedTuple):
    """A priority queue, lowest key first.

    Attributes:
        items: the items in the heap, int32, shape (N,).
        places: where in `items` each item is; -1 if it is not there.
        keys: of each item, float64.
        size: how many wait, int64, shape (1,).
    """

    items: NDArray[np.int32]
    places: NDArray[np.int32]
    keys: NDArray[np.float64]
    size: NDArray[np.int64]


def empty_heap(count: int) -> Heap:
    """Return a heap for items 0 to `count`."""
    return Heap(
        np.empty(count, dtype=np.int32),
        np.full(count, -1, dtype=np.int32),
        np.empty(count, dtype=np.float64),
        np.zeros(1, dtype=np.int64),
    )


@inner_loop()
def push(heap: Heap, item: int, key: float) -> None:
    """Push an item, or decrease the key of one in the heap."""
    place = heap.places[item]
    if place < 0:
        place = heap.size[0]
        heap.size[0] += 1
    heap.keys[item] = key
    while place > 0:
        above = (place - 1) // 2
        other = heap.items[above]
        if heap.keys[other] <= key:
            break
        heap.items[place] = other
        heap.places[other] = place
        place = above
    heap.items[place] = item
    heap.places[item] = place


@inner_loop()
def pop(heap: Heap) -> int:
    """Pop the item with the lowest key; the heap must not be empty."""
    first = int(heap.items[0])
    heap.places[first] = -1
    heap.size[0] -= 1
    size = heap.size[0]
    if size == 0:
        return first
    item = heap.items[size]
    key = heap.keys[item]
    place = 0
    while True:
        below = 2 * place + 1
        if below >= size:
            break
        if below + 1 < size and heap.keys[heap.items[below + 1]] < heap.keys[heap.items[below]]:
            below += 1
        other = heap.items[below]
        if heap.keys[other] >= key:
            break
        heap.items[place] = other
        heap.places[other] = place
        place = below
    heap.items[place] = item
    heap.places[item] = place
    return first
