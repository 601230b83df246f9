"""The history of a map as files of lines of JSON, one line per version.

The specification is docs/formats/history.md.
"""

from __future__ import annotations

import json
import logging
import math
import re
import threading
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import FormatError
from hypermap.core.history import KINDS, Change, History, Revision, latest_time
from hypermap.core.objects import SemanticObject
from hypermap.formats import limits
from hypermap.formats.semantic.records import is_json, object_from_record, record_from_object
from hypermap.formats.yaml_text import plain_value, read_yaml, write_yaml
from hypermap.history.policy import HistoryPolicy
from hypermap.text import counted

logger = logging.getLogger(__name__)

KEY, END_KEY = "history", "history_end"
"""The configuration's keys: that lists the files of the history, oldest first; and that holds the
version of the last line, by which it is known that it is there."""

_PER_METER = 10_000  # the unit of coordinates is 0.1 mm
_FULL = 256 * 1024  # bytes of a file, from which on another one is begun
_DAY, _LONG_PAUSE = 86_400.0, 30 * 86_400.0  # s
_EDIT = b'"cause":"edit"'
_LOST = b'{"lost":true}\n'
_VERSION = re.compile(rb'\{"version":(\d{1,9}),(?:"previous":(\d{1,9}),)?')
_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
_WRONG = (
    *(KeyError, TypeError, ValueError, IndexError, OverflowError, RecursionError),
    *(AttributeError, FormatError, shapely.GEOSException),
)


class HistoryFiles:
    """The files of a history, parsed at the first access.

    Attributes:
        files: their contents by name, oldest first; None for one that is lost.
        where: how messages name the map.
    """

    def __init__(self, files: Mapping[str, bytes | None], where: str = "") -> None:
        self.files = dict(files)
        self.where = where
        self._revisions: tuple[Revision, ...] | None = None
        self._is_end_lost = False
        self._reading = threading.Lock()

    def __getstate__(self) -> dict[str, Any]:
        return {"files": self.files, "where": self.where}

    def __setstate__(self, state: dict[str, Any]) -> None:
        HistoryFiles.__init__(self, **state)

    def __call__(self) -> tuple[Revision, ...]:
        """Return the revisions that can be read, oldest first; others are counted and logged."""
        with self._reading:
            if self._revisions is None:
                self._revisions = self._parsed()
            return self._revisions

    def loses_end(self) -> bool:
        """Return whether the last of the revisions cannot be read."""
        self()
        return self._is_end_lost

    def _parsed(self) -> tuple[Revision, ...]:
        revisions: list[Revision] = []
        is_lost, lost = False, 0
        when: list[str] = []
        told: set[int] = set()  # hashes of the lines
        for line in _lines({name: content or _LOST for name, content in self.files.items()}):
            revision = _revision_in(line)
            if revision is not None:
                if hash(line) in told:  # it stands twice
                    continue
                told.add(hash(line))
                if not is_lost and revisions and _is_missing_before(line, revisions[-1].version):
                    is_lost, lost = True, lost + 1
                if is_lost:
                    when.append(_span(revisions[-1:], revision))
                revisions.append(replace(revision, follows_loss=is_lost))
            is_lost = revision is None
            lost += is_lost
        self._is_end_lost = is_lost
        if is_lost:
            when.append(_span(revisions[-1:], None))
        if lost:
            said = "%s: a part of the map's history is lost: %s of it cannot be read: %s"
            logger.warning(said, self.where, counted(lost, "part"), ", ".join(when))
        return tuple(revisions)


def history_files(history: History, policy: HistoryPolicy) -> dict[str, bytes]:
    """Return the files of a history, by name, without what a policy drops.

    In the place of a lost file stands one with a line that says so.
    """
    earlier, added = history.earlier, history.added
    if isinstance(earlier, HistoryFiles):
        kept = {name: content or _LOST for name, content in earlier.files.items()}
    else:
        kept, added = {}, tuple(history.revisions())
    for revision in added:
        name = next(reversed(kept), None)
        if name is None or len(kept[name]) > _FULL:
            name = f"{KEY}.{revision.version:06}.jsonl"
        before = kept.get(name, b"")
        if before and not before.endswith(b"\n"):  # damaged: its end is missing
            before += b"\n"
        kept[name] = before + dump_revision(revision, end_of(kept)) + b"\n"
    return _bounded(kept, policy) if added else kept


def edited_layers(files: Iterable[bytes]) -> set[str]:
    """Return the names of the layers whose objects a person or a program has changed.

    What cannot be read is left out.
    """
    edits = (_revision_in(line) for file in files for line in file.splitlines() if _EDIT in line)
    changes = (change for edit in edits if edit is not None for change in edit.changes)
    return {change.layer for change in changes}


def end_of(files: dict[str, bytes] | dict[str, bytes | None]) -> int | None:
    """Return the version of the last line of a history; None if it cannot be read."""
    content = next(reversed(files.values()), None) or b""
    found = _VERSION.match(content.rstrip(b"\n").rpartition(b"\n")[2])
    return None if found is None else int(found[1])


def with_end(files: dict[str, bytes | None], end: Any) -> dict[str, bytes | None]:
    """Return files with a line that says so if their last lines are lost.

    Args:
        files: by name, oldest first; None for one that is lost.
        end: the version of their last line; None if it is not known.
    """
    last = end_of(files)
    if last is None or not isinstance(end, int) or last >= end:
        return dict(files)
    name = next(reversed(files))
    return {**files, name: (files[name] or b"").rstrip(b"\n") + b"\n" + _LOST}


def _bounded(files: dict[str, bytes], policy: HistoryPolicy) -> dict[str, bytes]:
    """Return files without their oldest lines, as far as a policy drops these."""
    stamps = [stamp for stamp in map(_time_in, _lines(files)) if stamp is not None]
    begin = _newest_certain(stamps) - policy.seconds
    surplus = sum(map(len, files.values())) - policy.max_mb * 1e6
    bounded: dict[str, bytes] = {}
    for name, content in files.items():
        lines, dropped = content.splitlines(keepends=True), 0
        while dropped < len(lines) and not bounded:
            stamp = _time_in(lines[dropped])
            if surplus <= 0 and (stamp is None or stamp >= begin):
                break
            surplus -= len(lines[dropped])
            dropped += 1
        if dropped < len(lines):
            bounded[name] = b"".join(lines[dropped:])
    return bounded


def _newest_certain(stamps: Iterable[float]) -> float:
    """Return the newest time that is not likely to be that of a clock far ahead; -inf for none.

    A time long after all earlier ones counts once two others confirm it, each at least a day after
    the one before: neither a single session under a wrong clock nor two under different ones must
    make all that was before too old. Nothing is certain while our own clock is not set, as then
    nothing tells a clock ahead from a right one.
    """
    end = latest_time()
    if end == math.inf:
        return -math.inf
    right = sorted(stamp for stamp in stamps if stamp <= end)
    newest, before = -math.inf, -math.inf
    is_certain = False
    for stamp in right:
        if stamp - before > _LONG_PAUSE:
            is_certain = _is_confirmed(stamp, right)
        if is_certain:
            newest = stamp
        before = stamp
    return newest


def _is_confirmed(stamp: float, stamps: Sequence[float]) -> bool:
    """Return whether there are two later times, each at least a day after the one before."""
    second = bisect_left(stamps, stamp + _DAY)
    return second < len(stamps) and stamps[-1] - stamps[second] >= _DAY


def _span(before: Sequence[Revision], after: Revision | None) -> str:
    """Say when what is lost between two revisions had changed, of which there may be none."""
    if after is None:
        return f"what changed after version {before[0].version}" if before else "all of it"
    if not before:
        return f"what changed before version {after.version}"
    return f"what changed between versions {before[0].version} and {after.version}"


def _lines(files: Mapping[str, bytes]) -> Iterator[bytes]:
    for content in files.values():
        yield from content.splitlines()


def _time_in(line: bytes) -> float | None:
    """Return the time of a line, without reading what changed; None if there is none."""
    if b'"time"' not in line:
        return None
    head, _, _ = line.partition(b',"changes"')
    try:
        return _stamp(json.loads(head + b"}")["time"])
    except _WRONG:
        return None


def _is_missing_before(line: bytes, version: int) -> bool:
    """Return whether a line is not the next one after that of a version, where it says so."""
    found = _VERSION.match(line)
    return found is not None and found[2] is not None and int(found[2]) != version


def dump_revision(revision: Revision, previous: int | None = None) -> bytes:
    """Return a line of the file, without its end.

    Args:
        revision: what it says.
        previous: version of the line before, by which it is known that this is there; None if there
            is none, or it cannot be read.
    """
    document = {
        "version": revision.version,
        **({} if previous is None else {"previous": previous}),
        "time": None if revision.time is None else _clock(revision.time),
        "cause": revision.cause,
        "drive": revision.drive,
        **({"begins": True} if revision.begins and revision.version != 1 else {}),
        "changes": [_dumped(change) for change in revision.changes],
    }
    text = json.dumps(document, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.encode()


def _revision_in(line: bytes) -> Revision | None:
    """Return the revision in a line; None if it is damaged."""
    if b'"changes"' not in line:  # sooner than by an exception: there may be millions of lines
        return None
    try:
        return parse_revision(line)
    except _WRONG:
        return None


def parse_revision(line: bytes) -> Revision:
    """Return the revision in a line; raises one of several errors for anything else."""
    document = json.loads(line)
    cause = document["cause"]
    if cause not in ("mapping", "edit"):
        raise ValueError(f"unknown cause {cause!r}")
    return Revision(
        version=int(document["version"]),
        time=_stamp(document["time"]),
        cause=cause,
        drive=str(document["drive"]),
        changes=tuple(map(_parsed, document["changes"])),
        begins=document.get("begins") is True,
    )


def _dumped(change: Change) -> dict[str, Any]:
    row: dict[str, Any] = {"what": change.kind, "layer": change.layer, "id": change.object.id}
    for key in ("distance", "confidence"):
        if (value := getattr(change, key)) is not None:
            row[key] = round(value, 4)
    for key, item in (("before", change.before), ("after", change.after)):
        if item is not None:
            row[key] = _record(item)
    return row


def _parsed(row: Mapping[str, Any]) -> Change:
    if row["what"] not in KINDS:
        raise ValueError(f"unknown change {row['what']!r}")
    before, after = (
        _object(row[key], row["id"]) if key in row else None for key in ("before", "after")
    )
    if before is None and after is None:
        raise ValueError("there is no object before or after the change")
    return Change(
        row["what"],
        str(row["layer"]),
        before,
        after,
        _number(row.get("distance")),
        _number(row.get("confidence")),
    )


def _number(value: Any) -> float | None:
    if value is None:
        return None
    if isinstance(value, bool) or not math.isfinite(number := float(value)):
        raise ValueError(f"{value!r} is not a number")
    return number


def _record(item: SemanticObject) -> dict[str, Any]:
    record = plain_value(record_from_object(item))
    if not is_json(record):  # attributes of other types
        record = {"yaml": write_yaml(record).decode()}
    return {**record, "shape": _steps(item.footprint)}


def _object(record: Mapping[str, Any], number: int) -> SemanticObject:
    others = {key: value for key, value in record.items() if key != "shape"}
    if "yaml" in others:
        others = read_yaml(others["yaml"].encode(), KEY)
    return object_from_record({**others, "id": number}, _shape(record["shape"]))


def _steps(shape: BaseGeometry) -> list[list[list[int]]]:
    """Return the rings of each polygon of a shape: the first point, then the steps from it."""
    found = []
    for polygon in shapely.get_parts(shape).tolist():
        rings = [polygon.exterior, *polygon.interiors]
        units = [np.rint(shapely.get_coordinates(r)[:-1] * _PER_METER).astype(int) for r in rings]
        found.append([np.diff(points, axis=0, prepend=0).ravel().tolist() for points in units])
    return found


def _shape(polygons: Sequence[Sequence[Sequence[int]]]) -> BaseGeometry:
    parts = []
    for rings in polygons:
        points = [np.cumsum(np.array(r, float).reshape(-1, 2), axis=0) / _PER_METER for r in rings]
        if any(np.abs(ring).max(initial=0) > limits.MAX_PLACE for ring in points):
            raise ValueError("a point is too far away")
        parts.append(shapely.Polygon(points[0], points[1:]))
    return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)


def _clock(stamp: float) -> str:
    """Return a time in UTC, in the form of ISO 8601; beyond the year 9999, the stamp."""
    try:
        moment = _EPOCH + timedelta(seconds=round(stamp, 3))
    except OverflowError:
        return repr(stamp)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _stamp(text: str | None) -> float | None:
    if text is None:
        return None
    if text.endswith("Z"):
        return (datetime.fromisoformat(text.replace("Z", "+00:00")) - _EPOCH).total_seconds()
    stamp = float(text)
    if not math.isfinite(stamp):
        raise ValueError("a time is not finite")
    return stamp
