"""What becomes of true objects, by what they are and how a drive shows them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hypermap.experiments.results import WorldResult
from hypermap.simulation.truth import true_objects


@dataclass(frozen=True)
class ObjectResult:
    """What became of a true object on one drive.

    Attributes:
        number: of the object, in the world.
        name: its class.
        size: area of its footprint [m^2].
        nearest: distance from which it was seen best [m]; inf if it never was.
        views: frames that show it.
        detections: frames in which it was detected by its class.
        iou: with the mapped object that it is matched with; 0 without one.
        found: whether that is at least 0.25.
        found_half: whether that is at least 0.5.
        distance: to the centroid of the nearest mapped object of its class [m]; None if the map has
            none.
    """

    number: int
    name: str
    size: float
    nearest: float
    views: int
    detections: int
    iou: float
    found: bool
    found_half: bool
    distance: float | None


def objects_of(result: WorldResult, method: str) -> list[ObjectResult]:
    """Return what became of each true object on each drive, drive by drive."""
    found: list[ObjectResult] = []
    for mapped, evaluation in zip(result.mapped, result.evaluations[method], strict=True):
        quarter, half = ({m.ground_truth for m in at.matches} for at in evaluation.finds)
        distances = {c.ground_truth: c.distance for c in evaluation.closest}
        seen = mapped.sightings
        found += [
            ObjectResult(
                number,
                thing.name,
                float(thing.footprint.area),
                float(seen.nearest[number]),
                int(seen.visible[number]),
                int(seen.detected[number]),
                evaluation.object_iou[number],
                number in quarter,
                number in half,
                distances.get(number),
            )
            for number, thing in enumerate(true_objects(mapped.drive.world).objects())
        ]
    return found


@dataclass(frozen=True)
class Kind:
    """A way to group objects by a number.

    Attributes:
        title: of that number.
        of: returns it.
        edges: of the groups, rising: from each to below the next.
        words: what the groups are called.
    """

    title: str
    of: Callable[[ObjectResult], float]
    edges: tuple[float, ...]
    words: tuple[str, ...]

    def group(self, one: ObjectResult) -> int:
        """Return the place of an object's group."""
        return int(np.searchsorted(self.edges, self.of(one), side="right")) - 1


KINDS: Mapping[str, Kind] = {
    "size": Kind(
        "area [m²]",
        lambda one: one.size,
        (0, 0.02, 0.1, 0.3, 1),
        ("below 0.02", "0.02 to 0.1", "0.1 to 0.3", "0.3 to 1", "1 and more"),
    ),
    "distance": Kind(
        "nearest view [m]",
        lambda one: one.nearest,
        (0, 1, 1.5, 2, 3, math.inf),
        ("below 1", "1 to 1.5", "1.5 to 2", "2 to 3", "3 and more", "not seen"),
    ),
    "views": Kind(
        "frames with a detection",
        lambda one: one.detections,
        (0, 1, 3, 6, 11, 21),
        ("0", "1 to 2", "3 to 5", "6 to 10", "11 to 20", "21 and more"),
    ),
}


@dataclass(frozen=True)
class Group:
    """Means over objects of all drives.

    Attributes:
        words: what the group is called.
        objects: how many there are, those of each drive counted.
        iou: mean, 0 for objects without a match.
        distance: mean, over those whose class the map has [m]; None for none.
        recall: share of them that were found at an IoU of 0.25.
        recall_half: and at 0.5.
    """

    words: str
    objects: int
    iou: float
    distance: float | None
    recall: float
    recall_half: float

    @classmethod
    def of(cls, words: str, objects: Sequence[ObjectResult]) -> Group:
        """Return the group of at least one object."""
        distances = [one.distance for one in objects if one.distance is not None]
        return cls(
            words,
            len(objects),
            float(np.mean([one.iou for one in objects])),
            float(np.mean(distances)) if distances else None,
            float(np.mean([one.found for one in objects])),
            float(np.mean([one.found_half for one in objects])),
        )


def grouped(objects: Sequence[ObjectResult], kind: Kind) -> list[Group]:
    """Return the groups that have objects, in order."""
    members: dict[int, list[ObjectResult]] = {}
    for one in objects:
        members.setdefault(kind.group(one), []).append(one)
    return [Group.of(kind.words[place], members[place]) for place in sorted(members)]


def by_class(objects: Sequence[ObjectResult]) -> list[Group]:
    """Return a group for each class, in alphabetical order."""
    names = sorted({one.name for one in objects})
    return [Group.of(name, [one for one in objects if one.name == name]) for name in names]


def by_object(objects: Sequence[ObjectResult]) -> list[Group]:
    """Return a group for each object of the world: its drives; "3 chair" is object 3 from 0 on."""
    numbers = sorted({one.number for one in objects})
    members = [[one for one in objects if one.number == number] for number in numbers]
    return [Group.of(f"{some[0].number} {some[0].name}", some) for some in members]


def recall_of(objects: Sequence[ObjectResult], at_least: int, by: str) -> float | None:
    """Return the recall (IoU of 0.25) of the objects that a drive shows; None for none.

    Args:
        objects: of all drives.
        at_least: in how many frames.
        by: "views" for frames that show them, "detections" for those in which they were detected.
    """
    found = [one.found for one in objects if getattr(one, by) >= at_least]
    return float(np.mean(found)) if found else None
