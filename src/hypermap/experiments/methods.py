"""The methods of an experiment: the four of the 2019 thesis, and ours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

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
