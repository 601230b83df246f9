"""Tables of tracks as arrays: the present one, and earlier ones, which share evidence with it.

Evidence in several tables is one object in memory, and is saved once. A reader that ignores earlier
tables can read the present one: what only they have is in separate arrays (`more.*`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import as_objects
from hypermap.formats.array_file import packed_shapes, unpacked_shapes
from hypermap.mapping.color_arrays import packed_colors, unpacked_colors
from hypermap.mapping.evidence_buffer import Evidence, EvidenceBuffer, SeenColor
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import Track, TrackTable

T = TypeVar("T")
_Arrays = Mapping[str, NDArray[Any]]

_MORE = "more."
_COLUMNS = ("existence", "heights", "pending", "observations", "scores_and_times")


@dataclass(frozen=True, eq=False)
class PackedTables:
    """Tables of tracks in the form of a file.

    Attributes:
        facts: values of each table for JSON; the present one comes first.
        arrays: of all tables.
    """

    facts: Sequence[Mapping[str, Any]]
    arrays: _Arrays


def packed_tables(now: TrackTable, earlier: Sequence[TrackTable] = ()) -> PackedTables:
    """Return all columns of tables of tracks, of their evidence and of its views.

    Args:
        now: the present table.
        earlier: other tables, which share `Evidence` and shape objects with it.
    """
    tables = [now, *earlier]
    shapes, shape_rows = _together([table.shapes.polygons for table in tables])
    items, item_rows = _together([_evidence_of(table) for table in tables])
    arrays: dict[str, NDArray[Any]] = {}
    for number, table in enumerate(tables):
        arrays |= _columns(table_prefix(number), table)
        if number:
            arrays[f"{table_prefix(number)}track.shape"] = _whole(shape_rows[number])
            arrays[f"{table_prefix(number)}track.evidence"] = _whole(item_rows[number])
    own = len(now.objects)
    arrays |= _packed_polygons("track.shape", shapes[:own])
    arrays |= _packed_polygons(f"{_MORE}track.shape", shapes[own:])
    arrays |= _packed_evidence(items, len(_evidence_of(now)))
    return PackedTables([_facts(table) for table in tables], arrays)


def unpacked_tables(packed: PackedTables, config: EvidenceConfig) -> list[TrackTable]:
    """Return the tables that `packed_tables` has packed.

    Raises:
        KeyError, ValueError, IndexError, GEOSException: If the arrays are damaged.
    """
    arrays = packed.arrays
    shapes = PreparedPolygon.all_of(_unpacked_both("track.shape", arrays))
    items = _unpacked_evidence(arrays)
    own = len(arrays["track.id"]), len(arrays["observation.view"])
    tables = []
    for number, facts in enumerate(packed.facts):
        columns = _columns_with(table_prefix(number), arrays)
        shape_rows = columns.get("shape", np.arange(own[0]))
        item_rows = columns.get("evidence", np.arange(own[1]))
        if min(shape_rows.min(initial=0), item_rows.min(initial=0)) < 0:
            raise ValueError("a track has an impossible row")
        table_shapes = [shapes[row] for row in shape_rows.tolist()]
        table_items = [items[row] for row in item_rows.tolist()]
        tables.append(_table(facts, columns, table_shapes, table_items, config))
    return tables


def table_prefix(number: int) -> str:
    """Return the prefix of the names of a table's arrays; table 0 is the present one."""
    return "" if number == 0 else f"before.{number - 1}."


def _together(lists: Sequence[Sequence[T]]) -> tuple[list[T], list[list[int]]]:
    """Return the distinct objects of some lists, and the rows of each list among them.

    All objects of the first list come first.
    """
    things = list(lists[0])
    rows = {id(thing): row for row, thing in enumerate(things)}
    found = [list(range(len(things)))]
    for others in lists[1:]:
        for thing in others:
            if rows.setdefault(id(thing), len(things)) == len(things):
                things.append(thing)
        found.append([rows[id(thing)] for thing in others])
    return things, found


def _evidence_of(tracks: TrackTable) -> list[Evidence]:
    return [item for track in tracks.objects for item in track.buffer.items]


def _facts(tracks: TrackTable) -> dict[str, Any]:
    return {
        "names": [track.name for track in tracks.objects],
        "next_id": tracks.next_id,
        "first_id": tracks.first_id,
        "moved": [track.moved for track in tracks.objects],
        "moved_since": [track.moved_since for track in tracks.objects],
        "gone_since": [track.gone_since for track in tracks.objects],
    }


def _columns(prefix: str, tracks: TrackTable) -> dict[str, NDArray[Any]]:
    objects = tracks.objects
    buffers = [track.buffer for track in objects]
    both = [
        (track.id, other, count)
        for track in objects
        for other, count in sorted(track.co_occurrences.items())
    ]
    times = [(b.score_sum, b.first_seen, b.last_seen) for b in buffers]
    columns = {
        "id": _whole([track.id for track in objects]),
        "existence": tracks.existence.copy(),
        "spared": tracks.spared.copy(),
        "misses": tracks.misses.copy(),
        "heights": tracks.shapes.heights.copy(),
        "pending": _whole([track.pending for track in objects]),
        "observations": _whole([buffer.count for buffer in buffers]),
        "kept": _whole([len(buffer) for buffer in buffers]),
        "scores_and_times": np.array(times, np.float64).reshape(-1, 3),
        "co_occurrences": _whole(both).reshape(-1, 3),
        **_packed_colors(buffers),
    }
    return {f"{prefix}track.{name}": column for name, column in columns.items()}


def _columns_with(prefix: str, arrays: _Arrays) -> dict[str, NDArray[Any]]:
    begin = f"{prefix}track."
    return {name[len(begin) :]: array for name, array in arrays.items() if name.startswith(begin)}


def _packed_polygons(name: str, polygons: Sequence[PreparedPolygon]) -> dict[str, NDArray[Any]]:
    return packed_shapes(name, as_objects([polygon.geometry for polygon in polygons]))


def _packed_evidence(items: Sequence[Evidence], own: int) -> dict[str, NDArray[Any]]:
    """Return evidence and its views as arrays; those after the first `own` pieces as `more`."""
    rows: dict[tuple[int, int], int] = {}  # observations of one frame share its pose and area
    views: list[Evidence] = []
    view_of = []
    for item in items:
        view_of.append(rows.setdefault((id(item.map_T_camera), id(item.prepared_area)), len(views)))
        if view_of[-1] == len(views):
            views.append(item)
    own_views = max(view_of[:own], default=-1) + 1
    arrays: dict[str, NDArray[Any]] = {}
    for prefix, some, some_views in (
        ("", slice(0, own), slice(0, own_views)),
        (_MORE, slice(own, None), slice(own_views, None)),
    ):
        arrays[f"{prefix}observation.view"] = _whole(view_of[some])
        arrays |= _packed_observations(prefix, items[some])
        arrays |= _packed_views(prefix, views[some_views])
    return arrays


def _packed_observations(prefix: str, items: Sequence[Evidence]) -> dict[str, NDArray[Any]]:
    name = f"{prefix}observation"
    return {
        f"{name}.score": np.array([item.score for item in items], np.float64),
        f"{name}.z_min": np.array([item.z_min for item in items], np.float64),
        f"{name}.z_max": np.array([item.z_max for item in items], np.float64),
        **packed_shapes(f"{name}.footprint", as_objects(item.footprint for item in items)),
    }


def _packed_views(prefix: str, views: Sequence[Evidence]) -> dict[str, NDArray[Any]]:
    name = f"{prefix}view"
    corrections = np.array([view.correction for view in views], np.float64).reshape(-1, 3)
    return {
        f"{name}.stamp": np.array([view.stamp for view in views], np.float64),
        f"{name}.pose": np.array([v.map_T_camera for v in views], np.float64).reshape(-1, 4, 4),
        f"{name}.correction": corrections,
        **packed_shapes(f"{name}.area", as_objects(view.visible_area for view in views)),
    }


def _both(name: str, arrays: _Arrays) -> NDArray[Any]:
    """Return an array of the present table, followed by that of `more`."""
    more = arrays.get(f"{_MORE}{name}")
    return arrays[name] if more is None else np.concatenate([arrays[name], more])


def _unpacked_both(name: str, arrays: _Arrays) -> list[Any]:
    """Return the geometries of the present table, followed by those of `more`."""
    found = list(unpacked_shapes(name, arrays))
    if f"{_MORE}{name}.points" in arrays:
        found.extend(unpacked_shapes(f"{_MORE}{name}", arrays))
    return found


def _unpacked_evidence(arrays: _Arrays) -> list[Evidence]:
    """Return all evidence; pieces of one frame share its pose and area."""
    footprints = as_objects(_unpacked_both("observation.footprint", arrays))
    areas = PreparedPolygon.all_of(_unpacked_both("view.area", arrays))
    centroids = shapely.get_coordinates(shapely.centroid(footprints))
    poses = list(_both("view.pose", arrays).reshape(-1, 4, 4))
    stamps = _both("view.stamp", arrays).tolist()
    corrections = _corrections(len(stamps), arrays)
    prepared = PreparedPolygon.all_of(list(footprints))
    found = []
    columns = [_both(f"observation.{name}", arrays) for name in ("view", "score", "z_min", "z_max")]
    if any(column.shape != (len(footprints),) for column in columns):
        raise ValueError("the columns of the observations differ in length")
    if columns[0].size and columns[0].min() < 0:
        raise ValueError("an observation has no view")
    values = zip(*(column.tolist() for column in columns), strict=True)
    for i, (view, score, z_min, z_max) in enumerate(values):
        item = Evidence(
            stamp=stamps[view],
            map_T_camera=poses[view],
            prepared_area=areas[view],
            score=score,
            prepared=prepared[i],
            centroid_xy=centroids[i],
            z_min=z_min,
            z_max=z_max,
            correction=corrections[view],
        )
        found.append(item)
    return found


def _corrections(count: int, arrays: _Arrays) -> list[tuple[float, float, float]]:
    """Return how the pose of each view was corrected; not at all in files of earlier versions."""
    if "view.correction" not in arrays:
        return [(0.0, 0.0, 0.0)] * count
    found = _both("view.correction", arrays)
    if found.shape != (count, 3) or not np.isfinite(found).all():
        raise ValueError("the corrections of the views are no numbers, or not as many")
    return [(x, y, yaw) for x, y, yaw in found.tolist()]


def _table(
    facts: Mapping[str, Any],
    arrays: _Arrays,
    shapes: Sequence[PreparedPolygon],
    items: list[Evidence],
    config: EvidenceConfig,
) -> TrackTable:
    """Return a table from its columns, the shapes of its tracks and all evidence."""
    tracks = TrackTable(config.max_existence)
    ids = arrays["id"].tolist()
    if any(one >= next_one for one, next_one in pairwise(ids)):
        raise ValueError("the ids of the tracks do not increase")
    co_occurrences: dict[int, Counter[int]] = {number: Counter() for number in ids}
    for number, other, count in arrays["co_occurrences"].tolist():
        co_occurrences[number][other] = count
    ends = np.cumsum(arrays["kept"]).tolist()
    if (arrays["kept"] < 0).any() or (ends[-1] if ends else 0) != len(items):
        raise ValueError("the observations do not match the tracks")
    none = np.zeros(len(ids), np.int64)  # files of earlier versions do not have them
    missed = zip(*(arrays.get(key, none).tolist() for key in ("misses", "spared")), strict=True)
    columns = (ids, facts["names"], shapes, *(arrays[name].tolist() for name in _COLUMNS), missed)
    moved, moved_since, gone_since = (
        _numbers(ids, facts.get(key, ())) for key in ("moved", "moved_since", "gone_since")
    )
    colors = _unpacked_colors(arrays, len(ids))
    begin = 0
    for (id_, name, shape, existence, heights, pending, count, times, lost), end in zip(
        zip(*columns, strict=True), ends, strict=True
    ):
        buffer = EvidenceBuffer.of(items[begin:end], config.max_evidence, count, *times)
        buffer.colors = next(colors)
        track = Track(id_, str(name), buffer, co_occurrences[id_], pending)
        track.moved, track.moved_since = moved.get(id_), moved_since.get(id_)
        track.gone_since = gone_since.get(id_)
        tracks.add(track, 0, shape, tuple(heights), existence, lost)
        begin = end
    tracks.next_id = max(tracks.next_id, int(facts["next_id"]))
    tracks.first_id = int(facts.get("first_id", 0))  # unknown in files of earlier versions
    if not 0 <= tracks.first_id <= tracks.next_id:
        raise ValueError("the first track of the drive has an impossible id")
    return tracks


def _packed_colors(buffers: Sequence[EvidenceBuffer]) -> dict[str, NDArray[Any]]:
    """Return the colors of all tracks, one track after another; no arrays if there are none."""
    colors = [color for buffer in buffers for color in buffer.colors]
    if not colors:
        return {}
    return {
        "colors": _whole([len(buffer.colors) for buffer in buffers]),
        "color_stamps": np.array([color.stamp for color in colors], np.float64),
        **packed_colors("color_values", [color.rgb for color in colors]),
    }


def _unpacked_colors(arrays: _Arrays, count: int) -> Iterator[tuple[SeenColor, ...]]:
    """Yield the colors of each of `count` tracks; files of earlier versions have none."""
    if "colors" not in arrays:
        yield from [()] * count
        return
    stamps = arrays["color_stamps"].tolist()
    ends = np.cumsum(arrays["colors"]).tolist()
    is_whole = len(ends) == count and (arrays["colors"] >= 0).all()
    if not (is_whole and len(stamps) == (ends[-1] if ends else 0)):
        raise ValueError("the colors do not match the tracks")
    if not np.isfinite(arrays["color_stamps"]).all():
        raise ValueError("the stamps of the colors are no numbers")
    values = unpacked_colors("color_values", arrays, len(stamps))
    found = list(map(SeenColor, stamps, values))
    for begin, end in pairwise([0, *ends]):
        yield tuple(found[begin:end])


def _numbers(ids: Sequence[int], values: Sequence[float | None]) -> dict[int, float]:
    """Return the numbers of those tracks that have one; files of earlier versions have none."""
    pairs = zip(ids, values, strict=False)
    return {number: float(value) for number, value in pairs if value is not None}


def _whole(values: Sequence[Any]) -> NDArray[np.int64]:
    return np.array(values, np.int64)
