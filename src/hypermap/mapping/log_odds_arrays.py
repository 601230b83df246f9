"""The log-odds of a grid as arrays: whole, or the blocks where something was seen.

A pose that is far off makes a grid large and nearly empty.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

_SIDE = 64  # cells of a block
_LARGE = 1 << 20  # cells; smaller grids are stored whole
_MOST = 100_000_000  # cells of all grids in blocks together, as their file may be small
_SHARE = 1 / 8  # of the blocks; from here on, grids are stored whole
_PARTS = "shape", "blocks", "values"

_Arrays = Mapping[str, NDArray[Any]]


def packed_log_odds(grids: Mapping[str, NDArray[np.float32]]) -> dict[str, NDArray[Any]]:
    """Return the arrays of grids' log-odds, NaN if never seen, shape (H, W), by their prefixes."""
    are_few = sum(grid.size for grid in grids.values()) <= _MOST
    arrays: dict[str, NDArray[Any]] = {}
    for prefix, grid in grids.items():
        arrays |= (_in_blocks(prefix, grid) if are_few else None) or {f"{prefix}log_odds": grid}
    return arrays


def are_in_blocks(arrays: _Arrays) -> bool:
    """Return whether a grid among the arrays is stored in blocks, as in files of version 2."""
    return any(name.endswith("log_odds.blocks") for name in arrays)


def unpacked_log_odds(
    prefixes: Iterable[str], arrays: _Arrays
) -> dict[str, NDArray[np.float32] | None]:
    """Return the log-odds of `packed_log_odds` by their prefixes; None if there are none.

    Raises:
        KeyError, ValueError: If the arrays are damaged.
    """
    found: dict[str, NDArray[np.float32] | None] = {}
    cells = 0
    for prefix in prefixes:
        if f"{prefix}log_odds.blocks" in arrays:
            shape, blocks, values = (arrays[f"{prefix}log_odds.{part}"] for part in _PARTS)
            height, width = (int(n) for n in shape.reshape(2))
            cells += height * width
            if min(height, width) < 1 or cells > _MOST:
                raise ValueError(f"log_odds have the shape ({height}, {width})")
            found[prefix] = _joined(height, width, blocks, values)
            continue
        found[prefix] = log_odds = arrays.get(f"{prefix}log_odds")
        if log_odds is not None and (log_odds.ndim != 2 or log_odds.dtype != np.float32):
            raise ValueError(f"log_odds have the shape {log_odds.shape}")
    return found


def _in_blocks(prefix: str, log_odds: NDArray[np.float32]) -> dict[str, NDArray[Any]] | None:
    """Return the arrays of a grid in blocks; None if it is small, or much of it was seen."""
    if log_odds.size < _LARGE:
        return None
    is_seen = ~np.isnan(log_odds)
    for axis in (0, 1):
        begins = np.arange(0, log_odds.shape[axis], _SIDE)
        is_seen = np.logical_or.reduceat(is_seen, begins, axis=axis)
    if np.count_nonzero(is_seen) > _SHARE * is_seen.size:
        return None
    blocks = np.argwhere(is_seen)
    values = np.full((len(blocks), _SIDE, _SIDE), np.nan, np.float32)
    for value, (row, col) in zip(values, _SIDE * blocks, strict=True):
        there = log_odds[row : row + _SIDE, col : col + _SIDE]
        value[: there.shape[0], : there.shape[1]] = there
    return {
        f"{prefix}log_odds.shape": np.array(log_odds.shape, np.int64),
        f"{prefix}log_odds.blocks": blocks.astype(np.int64),
        f"{prefix}log_odds.values": values,
    }


def _joined(
    height: int, width: int, blocks: NDArray[Any], values: NDArray[Any]
) -> NDArray[np.float32]:
    if values.shape != (len(blocks), _SIDE, _SIDE) or values.dtype != np.float32:
        raise ValueError(f"blocks of log_odds have the shape {values.shape}")
    if blocks.dtype != np.int64:  # others might overflow
        raise ValueError(f"places of blocks of log_odds are of type {blocks.dtype}")
    count = -(-np.array([height, width]) // _SIDE)
    if not ((blocks >= 0) & (blocks < count)).all():
        raise ValueError("a block of log_odds is outside of the grid")
    log_odds = np.full((height, width), np.nan, np.float32)
    for value, (row, col) in zip(values, (_SIDE * blocks).tolist(), strict=True):
        there = log_odds[row : row + _SIDE, col : col + _SIDE]
        there[:] = value[: there.shape[0], : there.shape[1]]
    return log_odds
