"""The methods of an experiment: the four of the 2019 thesis, ours, and those of users."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.experiments.installed_methods import InstalledMethod, installed_method
from hypermap.mapping.config import MappingConfig, load_config, profile, to_dict

OURS = "default"

Method: TypeAlias = MappingConfig | InstalledMethod
"""A configuration of our mapping, or the code of another package."""


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
# methods that search in a radius that they are worse nearly everywhere.
PUBLISHED: Mapping[tuple[str, str], Published] = {
    ("best shape, overlap", "lab"): Published(0.41, 0.51),
    ("best shape, overlap", "floor"): Published(0.36, 0.86),
    ("convex hull, overlap", "lab"): Published(0.26, 0.41),
    ("convex hull, overlap", "floor"): Published(0.35, 0.63),
    ("convex hull, radius", "lab"): Published(0.29, 0.26),
}


def methods(exact: bool = False) -> dict[str, MappingConfig]:
    """Return all methods by name, ours last.

    Those of the thesis cut objects out as its profile does: by the fast method, which finds nearly
    the same regions as PCL (docs/perception.md says how nearly).

    Args:
        exact: whether they find exactly the regions of PCL, in fifty times the time.
    """
    thesis = profile("thesis")
    if exact:
        thesis = replace(thesis, perception=replace(thesis.perception, method="unorganised"))
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


def chosen_methods(words: str, added: Sequence[str] = (), exact: bool = False) -> dict[str, Method]:
    """Return the methods that a user asks for, by name.

    >>> list(chosen_methods("best,default"))
    ['best shape, overlap', 'best shape, radius', 'default']

    Args:
        words: beginnings of names of `methods`, with commas between them; "all" for all.
        added: further methods, see `named_method`.
        exact: as for `methods`.

    Raises:
        HypermapError: If a word is the beginning of no name, there is no such method, or two have
            the same name.
    """
    chosen: dict[str, Method] = {**_built_in(words, exact)}
    for word in added:
        name, method = named_method(word)
        if name in chosen or name in methods():
            raise HypermapError(f"--method {word}: there is a method {name!r} already; rename it")
        chosen[name] = method
    return chosen


def named_method(word: str) -> tuple[str, Method]:
    """Return the name of a method, and the method.

    Args:
        word: a YAML file, whose name without its suffix is the method's, with what differs from
            the profile "default", or from the one in its key `profile`; or the name of an installed
            method (`installed_method`).

    Raises:
        FileMissing: If there is no such file.
        FormatError: If the file has an unknown profile or key, or a wrong value.
        HypermapError: If no method of that name is installed.
    """
    path = Path(word)
    if path.suffix.lower() not in (".yaml", ".yml"):
        return word, installed_method(word)
    return path.stem, load_config(path)


def settings_of(method: Method) -> dict[str, Any]:
    """Return all that makes a method, as plain values."""
    return to_dict(method) if isinstance(method, MappingConfig) else asdict(method)


def _built_in(words: str, exact: bool) -> dict[str, MappingConfig]:
    known = methods(exact)
    if words == "all":
        return known
    for word in words.split(","):
        if not word or not any(name.startswith(word) for name in known):
            hint = did_you_mean(word, ["all", *known])
            raise HypermapError(f"there is no method {word!r}; {hint}")
    return {name: known[name] for name in known if name.startswith(tuple(words.split(",")))}
