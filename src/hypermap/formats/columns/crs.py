"""Coordinate reference systems in GIS files; the map needs meters in one of its frames.

Our files have an engineering system, with no position on the globe, named after the frame. For
files of other programs, a system of another kind (degrees, or meters of a projection)
is refused; if a file has none, the user must give the frame of its meters.

Source: OGC 18-010r7, section 11 (engineering coordinate reference systems).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hypermap.core.errors import FormatError

_ENGINEERING = re.compile(r'\s*(?:ENGCRS|ENGINEERINGCRS|LOCAL_CS)\s*\[\s*"((?:[^"]|"")+)"', re.I)


@dataclass(frozen=True)
class System:
    """A coordinate reference system that a file names.

    Attributes:
        name: as a person knows it.
        frame_id: the frame in which coordinates are meters; None for all other systems.
    """

    name: str
    frame_id: str | None = None

    @classmethod
    def of_name(cls, name: str) -> System:
        """Return the system of a name or of well-known text, as in GeoJSON."""
        engineering = _ENGINEERING.match(name)
        if engineering:
            frame = engineering[1].replace('""', '"')
            return cls(frame, frame)
        return cls(name.split("[", 1)[-1].split('"')[1] if '["' in name else name)

    @classmethod
    def of_projjson(cls, crs: Mapping[str, Any]) -> System:
        """Return the system that a mapping describes, as in GeoParquet."""
        name = str(crs.get("name") or "an unknown system")
        return cls(name, name if crs.get("type") == "EngineeringCRS" else None)


def check_meters(system: System | None, path: str | None, key: str) -> None:
    """Raise a FormatError if coordinates are not meters in a frame; None means unspecified."""
    if system is not None and system.frame_id is None:
        raise FormatError(
            f"coordinates are in {system.name}, not in meters in a frame of the map; move them "
            "there first (a file of such coordinates names no crs)",
            path=path,
            key=key,
        )


def frame_of(system: System | None, given: str | None, path: str | None, key: str) -> str:
    """Return the frame of a file's coordinates, which are meters.

    Args:
        system: that the file names; None if it names none.
        given: the frame from the user, which takes precedence.
        path: the file's name in messages.
        key: the key of the system in the file.

    Raises:
        FormatError: If the system is of a different kind, or there is no frame.
    """
    check_meters(system, path, key)
    frame = given or (system.frame_id if system else None)
    if frame is None:
        raise FormatError(
            "is missing, because GIS programs omit it; if coordinates are meters in a frame of the "
            'map, name it: --frame map of `hypermap convert`, or frame_id="map" in Python',
            path=path,
            key=key,
        )
    return frame


def engineering_wkt(frame_id: str) -> str:
    """Return a system of meters in a frame, as well-known text."""
    name = frame_id.replace('"', '""')
    axes = 'AXIS["x",unspecified],AXIS["y",unspecified]'
    return f'ENGCRS["{name}",EDATUM["{name}"],CS[Cartesian,2],{axes},LENGTHUNIT["metre",1]]'


def engineering_projjson(frame_id: str) -> dict[str, Any]:
    """Return a system of meters in a frame, as PROJJSON."""
    axes = [
        {"name": axis, "abbreviation": axis, "direction": "unspecified", "unit": "metre"}
        for axis in "xy"
    ]
    return {
        "$schema": "https://proj.org/schemas/v0.7/projjson.schema.json",
        "type": "EngineeringCRS",
        "name": frame_id,
        "datum": {"name": frame_id},
        "coordinate_system": {"subtype": "Cartesian", "axis": axes},
    }
