"""The metadata of a Parquet file, checked before anything is unpacked."""

from __future__ import annotations

import contextlib
import io
from dataclasses import dataclass
from typing import Any

from hypermap.core.errors import FormatError
from hypermap.formats import limits

WIDTH = 8  # bytes, of numbers
_ENCODINGS = {"PLAIN", "RLE", "BIT_PACKED", "RLE_DICTIONARY", "PLAIN_DICTIONARY"}


class _Sealed(Exception):
    """More was read than the file's metadata."""


class _Sealable(io.BytesIO):
    """A file that can be sealed, so that no more is read from it."""

    is_sealed = False

    def read(self, size: int | None = -1) -> bytes:
        if self.is_sealed:
            raise _Sealed
        return super().read(size)


def _metadata(parquet: Any, content: bytes, path: str) -> Any:
    """Return the metadata of a Parquet file, as Arrow reads it.

    Arrow raises an error for damaged metadata of a chunk when it reads the chunk, but crashes the
    process when asked for that metadata first. So it has to start reading each chunk here.
    """
    source = _Sealable(content)
    file = parquet.ParquetFile(source, buffer_size=1)
    metadata = file.metadata
    if metadata.num_rows > limits.MAX_ROWS or metadata.num_columns > limits.MAX_COLUMNS:
        raise FormatError(
            f"has {metadata.num_rows} rows and {metadata.num_columns} columns, more than the "
            f"{limits.MAX_ROWS} and {limits.MAX_COLUMNS} that are allowed",
            path=path,
        )
    source.is_sealed = True
    for group in range(file.num_row_groups):
        with contextlib.suppress(_Sealed):
            file.read_row_group(group, use_threads=False)
    return metadata


@dataclass
class Leaf:
    """A column of plain values, as the file describes it.

    Attributes:
        kind: the physical type.
        width: bytes of a value; of texts, those of its place among the words.
        encodings: of its chunks.
    """

    kind: str
    width: int
    encodings: set[str]


def leaves_of(parquet: Any, content: bytes, path: str) -> dict[str, Leaf]:
    """Return the columns of plain values by their paths, of a file within the limits.

    Args:
        parquet: the module `pyarrow.parquet`.
        content: the file.
        path: how messages name it.

    Raises:
        FormatError: If it goes beyond the limits, has a column twice, or an encoding that is none.
        pyarrow.ArrowException, OSError: If it is damaged.
    """
    metadata = _metadata(parquet, content, path)
    leaves: dict[str, Leaf] = {}
    for column in range(metadata.num_columns):
        described = metadata.schema.column(column)
        kind = described.physical_type
        width = described.length if kind == "FIXED_LEN_BYTE_ARRAY" else WIDTH
        if described.path in leaves:
            raise FormatError("appears twice", path=path, key=described.path)
        leaves[described.path] = Leaf(kind, width, set())
    groups = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
    unpacked = 0  # bytes; a file of equal values can be tiny itself
    for group in groups:
        for chunk, leaf in zip(
            map(group.column, range(group.num_columns)), leaves.values(), strict=False
        ):
            leaf.encodings.update(chunk.encodings)
            unpacked += max(0, chunk.num_values) * leaf.width
    if max(unpacked, sum(group.total_byte_size for group in groups)) > limits.MAX_TABLE_BYTES:
        raise FormatError(f"unpacks to more than {limits.MAX_TABLE_BYTES} bytes", path=path)
    for name, leaf in leaves.items():
        for unusual in sorted(leaf.encodings - _ENCODINGS)[:1]:
            raise FormatError(f"has the encoding {unusual}", path=path, key=name)
    return leaves
