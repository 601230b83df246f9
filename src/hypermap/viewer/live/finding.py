"""Finding objects by what they are called and where they are: near, within, inside, in an area."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import shapely

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.viewer.live.names import names_like, names_of
from hypermap.viewer.live.refusals import Refused
from hypermap.viewer.live.requests import corners_in, number_in, text_in, whole_number_in
from hypermap.viewer.live.spelling import spell_find

MOST_FOUND = 5000
"""How many rows an answer has at most."""
_FOUND = 100  # rows, unless another limit is asked for


@dataclass(frozen=True)
class Wanted:
    """What is looked for; None where nothing is said.

    Attributes:
        name: that objects have.
        near: a name, or a point [m], from which the distance is measured.
        within: the largest distance [m].
        inside: the name of what they stand in.
        corners: of a polygon that they meet [m].
        frame: of point and polygon; None for the base frame.
        limit: how many rows the answer has at most.
    """

    name: str | None = None
    near: str | tuple[float, float] | None = None
    within: float | None = None
    inside: str | None = None
    corners: Sequence[Sequence[float]] | None = None
    frame: str | None = None
    limit: int = _FOUND


def wanted_in(values: Mapping[str, Any], hypermap: Hypermap) -> Wanted:
    """Return what a request looks for.

    Raises:
        Refused: If it says nothing of that, or something wrong.
    """
    limit = whole_number_in(values, "limit") if "limit" in values else _FOUND
    if not 1 <= limit <= MOST_FOUND:
        raise Refused(f"limit: must be from 1 to {MOST_FOUND}, got {limit}")
    near = text_in(values, "near")
    within = number_in(values, "within") if values.get("within") else None
    if within is not None and near is None:
        raise Refused("within: a distance from what? Give near, too")
    if within is not None and within < 0:
        raise Refused(f"within: must not be negative, got {within:g}")
    wanted = Wanted(
        name=text_in(values, "name"),
        near=None if near is None else _place_or_name(near, hypermap),
        within=within,
        inside=text_in(values, "inside"),
        corners=corners_in(values, "polygon") if values.get("polygon") else None,
        frame=text_in(values, "frame"),
        limit=limit,
    )
    is_near = isinstance(wanted.near, str) or within is not None
    if not (wanted.name or is_near or wanted.inside or wanted.corners):
        raise Refused("name: what is to be found?")
    return wanted


def find(hypermap: Hypermap, path: str, wanted: Wanted) -> dict[str, Any]:
    """Return the objects for which all that is wanted is true, as the page shows them.

    They are the nearest first where `near` is given. `name`, `near` and `inside` are as they were
    understood: where no object has exactly such a name, the only other one that it is a part of, or
    is like, is taken. Under `unknown`, all that were not known stand with the names that are like
    them.

    Raises:
        FrameError: If the frame is unknown.
    """
    known = known_names(hypermap)
    unknown: dict[str, list[str]] = {}

    def meant(asked: str | None) -> str | None:
        if asked is None or asked in known:
            return asked
        unknown[asked] = names_like(asked, known)
        return unknown[asked][0] if len(unknown[asked]) == 1 else asked

    near = meant(wanted.near) if isinstance(wanted.near, str) else wanted.near
    understood = replace(wanted, name=meant(wanted.name), near=near, inside=meant(wanted.inside))
    matches = hypermap.matching(
        understood.name,
        near=understood.near,
        within=understood.within,
        inside=understood.inside,
        area=None if wanted.corners is None else shapely.Polygon(wanted.corners),
        frame_id=wanted.frame,
    )
    rows = [
        {
            "layer": found.layer,
            "id": found.object.id,
            "name": found.object.name,
            "x": float(found.point_xy[0]),
            "y": float(found.point_xy[1]),
            "distance": found.distance,
        }
        for found in matches.first(wanted.limit)
    ]
    return {
        "name": understood.name,
        "near": understood.near,
        "inside": understood.inside,
        "rows": rows,
        "total": len(matches),
        "names": [] if wanted.name is None else names_like(wanted.name, known),
        "unknown": unknown,
        **spell_find(
            path,
            understood.name,
            near=understood.near,
            within=wanted.within,
            inside=understood.inside,
            corners=wanted.corners,
            frame=wanted.frame,
        ),
    }


def known_names(hypermap: Hypermap) -> list[str]:
    """Return the names of all objects that have a place, each once, in order."""
    layers = [layer for layer in hypermap.placed_layers() if isinstance(layer, SemanticLayer)]
    return sorted({name for layer in layers for name in names_of(layer.table)})


def _place_or_name(text: str, hypermap: Hypermap) -> str | tuple[float, float]:
    """Return a point "x,y", or the text as it is where it is, or could be, a name."""
    if not re.fullmatch(r"[-+.,\d\seE]*", text) or text in known_names(hypermap):
        return text
    try:
        x, y = (number_in({"near": part}, "near") for part in text.split(","))
    except ValueError:
        raise Refused(f"near: a point x,y is expected, got {text[:60]!r}") from None
    return x, y
