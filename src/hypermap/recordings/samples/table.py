"""Samples in a CSV file, by a robot's logger or a spreadsheet."""

from __future__ import annotations

import csv
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from hypermap.core.errors import NOT_UTF8, FileMissing, FormatError, did_you_mean
from hypermap.core.iso_times import time_from_iso
from hypermap.core.moving_frames import Motion
from hypermap.core.stamps import in_seconds
from hypermap.recordings.samples.measured import Measured, checked, sensor_positions

# Names of the column of times: ours, those of `rostopic echo -p` and PlotJuggler, and of loggers.
_STAMPS = ("stamp", "field.header.stamp", "%time", "__time", "timestamp", "time")
_NOTHING = {"", "nan", "null", "none", "na", "n/a", "-"}
VALUE = "value"
_XY = 2  # columns of a place
_NO_PLACE = (
    "in meters; of samples with stamps, name the bag or trajectory of their poses, and give the "
    "table as --samples"
)


def read_table(
    path: Path,
    field: str | None = None,
    motion: Motion | None = None,
    *,
    censored_below: float | None = None,
) -> Measured:
    """Return the samples of a CSV file whose first line names the columns.

    The columns are `x` and `y` [m] and, if it is known, `stamp` ([s] or ISO 8601), which may have
    another usual name; without `x` and `y`, `stamp` and a motion say where the sensor was. Empty
    cells and NaN are not values. Cells are separated by commas or tabs, or by semicolons, as
    spreadsheets do where a comma is the decimal point.

    Args:
        path: the file.
        field: name of the column of values; None for `value`.
        motion: of the sensor in the map; None where the file has `x` and `y`.
        censored_below: the limit below which nothing is heard; None where an empty cell says
            nothing.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If a column is missing, a line has more or fewer cells than the first, or a
            cell is not a number.
        HypermapError: If the motion is known at no sample's time.
    """
    if not path.is_file():
        raise FileMissing(f"{path}: there is no such file")
    with path.open(encoding="utf-8-sig", newline="") as file:
        try:
            delimiter = _delimiter(file.readline())
            file.seek(0)
            rows = csv.reader(file, delimiter=delimiter, strict=True)
            names = [name.strip() for name in next(rows, [])]
            wanted = _columns(names, field or VALUE, path, motion is not None)
            columns = _read(rows, names, wanted, path, has_commas=delimiter == ";")
        except UnicodeDecodeError:
            raise FormatError(NOT_UTF8, path=path) from None
        except csv.Error as error:
            raise FormatError(f"is not a CSV file: {error}", path=path) from None
    if not len(columns[0]):
        raise FormatError("there are no samples in it, only the names of columns", path=path)
    values, *others = map(np.frombuffer, columns)
    stamps = np.full(len(values), np.nan) if len(others) == _XY else others[-1]
    stamps = in_seconds(np.where(np.isfinite(stamps), stamps, np.nan))
    if motion is not None:
        points = sensor_positions(motion, stamps)
    else:
        points = np.column_stack(others[:_XY])
    return checked(points, values, stamps, censored_below=censored_below)


def _delimiter(first_line: str) -> str:
    """Return what separates the names of the columns."""
    return max(",", ";", "\t", key=first_line.count)


def _columns(names: Sequence[str], value: str, path: Path, is_posed: bool) -> list[str]:
    """Return the names of the columns to read: that of the values, `x` and `y`, that of stamps."""
    if names and all(map(_is_number, names)):
        raise FormatError(
            "the first line must name the columns, such as x,y,value; it has numbers", path=path
        )
    known = {name.lower(): name for name in reversed(names)} | {name: name for name in names}
    if len(names) == 1 and " " in names[0]:
        raise FormatError(
            f"the first line names one column, {names[0]!r}; separate columns by commas, "
            "semicolons or tabs",
            path=path,
        )
    if value not in known and value.lower() not in known:
        listed = ", ".join(names[:12])
        raise FormatError(
            f"the first line names no column {value!r}, it has {listed or 'nothing'}; "
            f"name that of the values with --field; {did_you_mean(value, names)}",
            path=path,
        )
    stamps = [known[name] for name in _STAMPS if name in known][:1]
    if is_posed and not stamps:
        raise FormatError(
            f"the first line names no column {_STAMPS[0]!r}, which tells the pose", path=path
        )
    places = [] if is_posed else ["x", "y"]
    for name in places:
        if name not in known:
            raise FormatError(f"the first line names no column {name!r}, {_NO_PLACE}", path=path)
    own = known.get(value) or known[value.lower()]
    return [own, *(known[name] for name in places), *stamps]


def _read(
    rows: Iterator[list[str]],
    names: Sequence[str],
    wanted: Sequence[str],
    path: Path,
    has_commas: bool,
) -> list[array[float]]:
    """Return the columns; a table may have very many rows, so they are kept as arrays."""
    places = [names.index(name) for name in wanted]
    columns = [array("d") for _ in wanted]
    readers = [_number, *(_stamp if name.lower() in _STAMPS else _number for name in wanted[1:])]
    for number, row in enumerate(rows, start=2):
        if not row:
            continue
        if len(row) != len(names):
            raise FormatError(
                f"has {len(row)} cells, the first line {len(names)}",
                path=path,
                key=f"line {number}",
            )
        for column, place, read in zip(columns, places, readers, strict=True):
            text = row[place].replace(",", ".") if has_commas else row[place]
            column.append(read(text, names[place], path, number))
    return columns


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _stamp(text: str, name: str, path: Path, line: int) -> float:
    """Return a time as written: a number, or in ISO 8601, without a zone that of this computer."""
    try:
        return _number(text, name, path, line)
    except FormatError:
        pass
    try:
        return time_from_iso(text).timestamp()
    except (ValueError, OverflowError, OSError):
        raise FormatError(
            f"{name}: {text!r} is no time, such as 1764237600.5 or 2025-11-27T10:00:00.5Z; columns "
            "of other names are left out",
            path=path,
            key=f"line {line}",
        ) from None


def _number(text: str, name: str, path: Path, line: int) -> float:
    if text.strip().lower() in _NOTHING:
        return float("nan")
    try:
        return float(text)
    except ValueError:
        message = f"{name}: {text!r} is not a number"
        raise FormatError(message, path=path, key=f"line {line}") from None
