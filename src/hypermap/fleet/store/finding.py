"""Where objects are at many sites: in a store, or in a folder of maps."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import HypermapError, MissingExtra
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.questions.times import are_calendar

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

    from hypermap.fleet.store.database import Database

IN_ITS_WALL = 0.5
"""How far from a room something may be that is in it [m], as in its wall."""

# The columns are those of a `Sighting`. A room is looked up only where the site has some.
_QUESTION = """
SELECT sites.name, layers.name, objects.id, objects.name, objects.x, objects.y,
    ST_Distance(shape, ST_SetSRID(ST_MakePoint(%(x)s, %(y)s), 990001)),
    CASE WHEN plan.id IS NULL THEN '' ELSE coalesce((
        SELECT rooms.name FROM objects AS rooms
        WHERE rooms.layer_id = plan.id AND rooms.valid_to IS NULL
            AND ST_DWithin(rooms.shape, middle.point, %(wall)s)
        ORDER BY rooms.shape <-> middle.point LIMIT 1
    ), '') END, last_seen, ST_AsBinary(shape)
FROM objects
CROSS JOIN LATERAL (
    SELECT ST_SetSRID(ST_MakePoint(objects.x, objects.y), 990001) AS point
) AS middle
JOIN layers ON layers.id = objects.layer_id
JOIN sites ON sites.id = layers.site_id
LEFT JOIN layers AS plan ON plan.site_id = sites.id AND plan.name = 'rooms'
    AND plan.frame_id = layers.frame_id
WHERE valid_to IS NULL AND objects.name = ANY (%(names)s) AND layers.name <> 'rooms'
    AND (last_seen < %(before)s::float8 OR %(before)s::float8 IS NULL)
"""


class Sighting(NamedTuple):
    """An object that was found at a site.

    Attributes:
        site: the name of the site, or of the file.
        layer: the name of its layer.
        id: its id in the layer.
        name: its name.
        x, y: its centroid [m].
        distance: from the point in question to its shape, in the frame of its site [m].
        room: the room that it is in; empty if in none.
        last_seen: stamp [s]; None if not known.
        wkb: its outline, as well-known binary.
    """

    site: str
    layer: str
    id: int
    name: str
    x: float
    y: float
    distance: float
    room: str
    last_seen: float | None
    wkb: bytes

    @property
    def shape(self) -> BaseGeometry:
        """Its outline in the frame of its site."""
        return shapely.from_wkb(self.wkb)


@dataclass(frozen=True)
class AtSite:
    """What was found at one site.

    Attributes:
        site: its name.
        nearest: the one nearest to the point in question.
        rooms: how many are in each room, the most first; "" stands for no room.
        count: how many there are.
    """

    site: str
    nearest: Sighting
    rooms: dict[str, int]
    count: int


def find_in_store(
    database: Database,
    names: Sequence[str],
    point_xy: tuple[float, float] = (0.0, 0.0),
    last_seen_before: float | None = None,
) -> list[Sighting]:
    """Return the objects with one of some names at all sites of a store.

    Args:
        database: the store.
        names: exact names.
        point_xy: from where to measure, in each site's own frame [m].
        last_seen_before: only those that were not seen since then [s]; None for all.

    Returns:
        Site by site, the nearest first.
    """
    rows = database.rows(
        _QUESTION,
        x=point_xy[0],
        y=point_xy[1],
        names=list(names),
        before=last_seen_before,
        wall=IN_ITS_WALL,
    )
    found = sorted(map(Sighting._make, rows), key=attrgetter("site", "distance", "id"))
    if last_seen_before is None:
        return found
    return [each for each in found if _is_unseen(each, last_seen_before)]


def find_in_folder(
    folder: Path,
    names: Sequence[str],
    point_xy: tuple[float, float] = (0.0, 0.0),
    last_seen_before: float | None = None,
    on_map: Callable[[], None] = lambda: None,
) -> tuple[list[Sighting], list[HypermapError]]:
    """Return the objects with one of some names in all maps of a folder and those within.

    A map that cannot be read is left out.

    Args:
        folder: of `.hmap` files.
        names: exact names.
        point_xy: from where to measure, in each map's base frame [m].
        last_seen_before: only those that were not seen since then [s]; None for all.
        on_map: called after each map.

    Returns:
        File by file, the nearest first; and what was wrong with maps that are left out.

    Raises:
        HypermapError: If there is no map.
    """
    from hypermap.formats import open_map

    paths = maps_in(folder)
    found: list[Sighting] = []
    wrong = []
    for path in paths:
        try:
            here = _in_map(open_map(path), str(path.relative_to(folder)), names, point_xy)
        except HypermapError as error:
            wrong.append(error)
        else:
            found += [each for each in here if _is_unseen(each, last_seen_before)]
        on_map()
    return found, wrong


def maps_in(folder: Path) -> list[Path]:
    """Return the maps of a folder and those within, by name.

    Raises:
        HypermapError: If there is no such folder, or no map in it.
    """
    if not folder.is_dir():
        raise HypermapError(f"{folder}: there is no such folder")
    paths = sorted(folder.rglob("*.hmap"))
    if not paths:
        raise HypermapError(f"{folder}: there is no .hmap file in this folder")
    return paths


def by_site(found: Iterable[Sighting]) -> list[AtSite]:
    """Return what was found at each site, in the order of the sites."""
    sites: dict[str, list[Sighting]] = {}
    for each in found:
        sites.setdefault(each.site, []).append(each)
    return [
        AtSite(
            site,
            min(here, key=lambda each: each.distance),
            dict(Counter(each.room for each in here).most_common()),
            len(here),
        )
        for site, here in sites.items()
    ]


def seen_in_future(found: Iterable[Sighting], now: float | None = None) -> list[str]:
    """Return the sites where something was seen later than now, by a clock that is off."""
    moment = time.time() if now is None else now
    late = (each.site for each in found if each.last_seen is not None and each.last_seen > moment)
    return list(dict.fromkeys(late))


def as_geodataframe(found: Sequence[Sighting]) -> GeoDataFrame:
    """Return one row per object, with its outline in the frame of its site.

    Raises:
        MissingExtra: If geopandas is not installed.
    """
    try:
        import geopandas
    except ImportError:
        raise MissingExtra("a GeoDataFrame", "geo") from None
    keys = ("site", "layer", "id", "name", "x", "y", "distance", "room", "last_seen")
    columns: dict[str, Any] = {key: [getattr(each, key) for each in found] for key in keys}
    return geopandas.GeoDataFrame(columns, geometry=shapely.from_wkb([each.wkb for each in found]))


def _in_map(
    hypermap: Hypermap, site: str, names: Sequence[str], point_xy: tuple[float, float]
) -> list[Sighting]:
    from hypermap.rooms.questions import room_of

    has_rooms = ROOMS in hypermap and isinstance(hypermap[ROOMS], SemanticLayer)
    here = []
    for found in hypermap.objects(list(names), near=point_xy):
        if found.layer == ROOMS:
            continue
        room = room_of(hypermap, found) if has_rooms else None
        x, y = found.point_xy.tolist()
        here.append(
            Sighting(
                site,
                found.layer,
                found.object.id or 0,
                found.object.name,
                x,
                y,
                float(found.distance or 0.0),
                "" if room is None else room.name,
                found.object.last_seen,
                shapely.to_wkb(found.object.footprint),
            )
        )
    return here


def _is_unseen(found: Sighting, since: float | None) -> bool:
    """Return whether it was not seen since then; if clocks do not say, it may have been."""
    stamp = found.last_seen
    return since is None or (stamp is not None and are_calendar([stamp]) and stamp < since)
