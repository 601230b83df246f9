"""Columns of values as Arrow arrays; the only module that imports pyarrow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray
from hypermap.core.errors import FormatError, MissingExtra
from hypermap.formats.letters import check_savable


def has_pyarrow() -> bool:
    """Return whether GeoParquet is supported, that is, pyarrow is installed."""
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        return False
    return True


def pyarrow_and_parquet() -> tuple[Any, Any]:
    """Return the modules `pyarrow` and `pyarrow.parquet`.

    Raises:
        MissingExtra: If pyarrow is not installed.
    """
    try:
        import pyarrow
        import pyarrow.compute
        import pyarrow.parquet
    except ImportError:
        raise MissingExtra("a semantic layer as GeoParquet", "parquet") from None
    return pyarrow, pyarrow.parquet


@dataclass(frozen=True, eq=False)
class Words:
    """Texts with many duplicates.

    Attributes:
        codes: the index of each in the vocabulary, int32, shape (N,); -1 for none.
        vocabulary: the texts.
    """

    codes: NDArray[np.int32]
    vocabulary: Sequence[str]


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers or truth values.

    Attributes:
        values: float64, int64 or bool, shape (N,).
        there: whether there is one, shape (N,).
    """

    values: NDArray[Any]
    there: BoolArray


@dataclass(frozen=True, eq=False)
class Lists:
    """A list for each row.

    Attributes:
        offsets: where each list begins among the items, and where the last one ends, shape (N+1,).
        items: of all lists.
    """

    offsets: NDArray[np.int64]
    items: Words | Numbers

    @property
    def lengths(self) -> list[int]:
        """How many items each list has."""
        lengths: list[int] = np.diff(self.offsets).tolist()
        return lengths


Column: TypeAlias = Words | Numbers | Lists


def kinds_of(lists: Lists) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return which lists of words or numbers are the same.

    Returns:
        The kind of each list, from 0, shape (N,), and a list of each kind, shape (K,).

    Raises:
        MissingExtra: If pyarrow is not installed.
    """
    pa, _ = pyarrow_and_parquet()
    items = lists.items.codes if isinstance(lists.items, Words) else lists.items.values
    bounds = lists.offsets * items.itemsize
    buffers = [None, pa.py_buffer(bounds), pa.py_buffer(np.ascontiguousarray(items))]
    rows = pa.Array.from_buffers(pa.large_binary(), len(bounds) - 1, buffers)
    kinds = rows.dictionary_encode().indices.to_numpy()
    firsts = np.empty(kinds.max(initial=-1) + 1, dtype=np.int64)
    firsts[kinds] = np.arange(len(kinds))
    return kinds, firsts


def leaf_of(name: str, column: Column) -> str:
    """Return the path of a column's plain values in a Parquet file."""
    return f"{name}.list.element" if isinstance(column, Lists) else name


def words_in(column: Column) -> Words | None:
    """Return the words of a column or of its lists; None if it has none."""
    items = column.items if isinstance(column, Lists) else column
    return items if isinstance(items, Words) else None


def most_values(column: Column) -> int:
    """Return how many values the file will give for a column; an empty list counts as one."""
    if isinstance(column, Lists):
        return len(column.offsets) + most_values(column.items)
    return len(column.codes if isinstance(column, Words) else column.values)


def to_arrow(pa: Any, column: Column) -> Any:
    """Return a column as an array of Arrow."""
    if isinstance(column, Lists):
        return pa.ListArray.from_arrays(
            pa.array(column.offsets, pa.int32()), to_arrow(pa, column.items)
        )
    if isinstance(column, Words):
        for word in column.vocabulary:
            check_savable(word, "a text")
        indices = pa.array(column.codes, mask=column.codes < 0)
        words = pa.array(list(column.vocabulary), pa.string())
        return pa.DictionaryArray.from_arrays(indices, words).dictionary_decode()
    return pa.array(column.values, mask=~column.there)


def whole(pa: Any, chunked: Any) -> Any:
    """Return a column's chunks as one array."""
    array = chunked.unify_dictionaries().combine_chunks()
    return array.chunk(0) if isinstance(array, pa.ChunkedArray) else array


def from_arrow(pa: Any, chunked: Any, name: str, path: str) -> Column:
    """Return a column of Arrow.

    Args:
        pa: the module `pyarrow`.
        chunked: the column, in chunks.
        name: of the column, for messages.
        path: of its file, for messages.

    Raises:
        FormatError: If it holds no texts, numbers or truth values, or lists of such.
    """
    array = whole(pa, chunked)
    kind = array.type
    if pa.types.is_list(kind) or pa.types.is_large_list(kind):
        # A row without a list has an empty one; `flatten` skips any values behind it.
        counts = pa.compute.fill_null(pa.compute.list_value_length(array), 0).to_numpy()
        items = _plain_from_arrow(pa, array.flatten(), name, path)
        return Lists(np.append(0, np.cumsum(counts, dtype=np.int64)), items)
    return _plain_from_arrow(pa, array, name, path)


def _plain_from_arrow(pa: Any, array: Any, name: str, path: str) -> Words | Numbers:
    kind = array.type
    there = np.asarray(array.is_valid().to_numpy(zero_copy_only=False), dtype=bool)
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        array = array.dictionary_encode()
        kind = array.type
    if pa.types.is_dictionary(kind) and (
        pa.types.is_string(kind.value_type) or pa.types.is_large_string(kind.value_type)
    ):
        codes = array.indices.fill_null(-1).to_numpy().astype(np.int32)
        return Words(codes, array.dictionary.to_pylist())
    if pa.types.is_boolean(kind):
        return Numbers(array.fill_null(False).to_numpy(zero_copy_only=False), there)
    if pa.types.is_integer(kind):
        return Numbers(array.fill_null(0).cast(pa.int64()).to_numpy(), there)
    if pa.types.is_floating(kind):
        return Numbers(array.cast(pa.float64()).fill_null(np.nan).to_numpy(), there)
    if pa.types.is_null(kind):
        return Words(np.full(len(array), -1, dtype=np.int32), [])
    raise FormatError(f"is of the type {kind}, which no object has", path=path, key=name)
