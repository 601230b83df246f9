"""Two tracks of one object are published once."""

from __future__ import annotations

import pytest

from hypermap.core.semantic import SemanticObject
from hypermap.mapping.doubles import without_doubles

from .evidence_tools import square


def cup(number: int, x: float, name: str = "cup", low: float = 0.7) -> SemanticObject:
    heights = {"z_min": low, "z_max": low + 0.1}
    return SemanticObject(name, square(x, side=0.1), id=number, attributes=heights)


def ids(*objects: SemanticObject, are_two: bool = False, fixed: tuple[int, ...] = ()) -> list[int]:
    kept = without_doubles(objects, lambda _one, _other: not are_two, 0.35, fixed)
    return [item.id for item in kept if item.id is not None]


def test_of_objects_of_one_class_in_one_place_the_oldest_stays() -> None:
    assert ids(cup(3, 0.0), cup(5, 0.05), cup(7, 0.2)) == [3, 7]
    assert ids(cup(3, 0.0), cup(5, 0.05), cup(7, 0.1)) == [3, 7]  # 7 is at the place of 5 alone
    assert ids() == []


@pytest.mark.parametrize(
    "other",
    [cup(5, 0.08), cup(5, 0.05, name="bowl"), cup(5, 0.05, low=0.0)],
    ids=["beside", "another class", "below"],
)
def test_others_stay(other: SemanticObject) -> None:
    assert ids(cup(3, 0.0), other) == [3, 5]


def test_what_frames_have_shown_together_and_what_people_have_edited_stays() -> None:
    assert ids(cup(3, 0.0), cup(5, 0.05), are_two=True) == [3, 5]
    assert ids(cup(3, 0.0), cup(5, 0.05), fixed=(5,)) == [3, 5]
