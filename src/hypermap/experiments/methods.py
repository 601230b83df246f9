"""The methods of an experiment: the four of the 2019 thesis, and ours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.mapping.config import MappingConfig, profile

OURS = "default"


@dataclass(frozen=True)
class Published:
    """What the thesis reports for a method: means over all true objects.

    Attributes:
        iou: Jaccard index.
        distance: between centroids [m].
    """

    iou: float
    distance: float


# Source: the thesis' tables of the laboratory and the floor, by method and world. It says of the
# other two methods, which search in a radius, that they are worse nearly everywhere.
PUBLISHED: Mapping[tuple[str, str], Published] = {
    ("best shape, overlap", "lab"): Published(0.41, 0.51),
    ("best shape, overlap", "floor"): Published(0.36, 0.86),
    ("convex hull, overlap", "lab"): Published(0.26, 0.41),
    ("convex hull, overlap", "floor"): Published(0.35, 0.63),
}


def methods() -> dict[str, MappingConfig]:
    """Return all methods by name, ours last.

    Those of the thesis cut objects out as its profile does: by the fast method, which finds nearly
    the same regions as PCL (docs/perception.md says how nearly).
    """
    thesis = profile("thesis")
    shapes: dict[str, Literal["best_shape", "convex_hull"]] = {
        "best shape": "best_shape",
        "convex hull": "convex_hull",
    }
    associations: dict[str, Literal["jaccard", "radius"]] = {
        "overlap": "jaccard",
        "radius": "radius",
    }
    found = {
        f"{shape}, {association}": replace(
            thesis,
            evidence=replace(thesis.evidence, fusion=fusion, association=rule),
        )
        for shape, fusion in shapes.items()
        for association, rule in associations.items()
    }
    return {**found, OURS: profile("default")}


def chosen_methods(words: str) -> dict[str, MappingConfig]:
    """Return the methods whose names begin with one of some words, or all for "all".

    >>> list(chosen_methods("best,default"))
    ['best shape, overlap', 'best shape, radius', 'default']

    Raises:
        HypermapError: If a word is the beginning of no name.
    """
    known = methods()
    if words == "all":
        return known
    for word in words.split(","):
        if not word or not any(name.startswith(word) for name in known):
            hint = did_you_mean(word, ["all", *known])
            raise HypermapError(f"there is no method {word!r}; {hint}")
    return {name: known[name] for name in known if name.startswith(tuple(words.split(",")))}
