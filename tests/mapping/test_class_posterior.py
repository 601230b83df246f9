"""Which class an object has that the detector calls now this, now that."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.mapping.class_posterior import one_class_per_place
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.perception.observation import Observation, ObservedObject


def thing(
    number: int, name: str, x: float, evidence: int, heights: tuple[float, float] = (0.0, 0.9)
) -> SemanticObject:
    return SemanticObject(
        name,
        shapely.box(x, 0, x + 0.5, 0.5),
        id=number,
        tags=(name,),
        confidence=(0.8,),
        attributes={"evidence": evidence, "z_min": heights[0], "z_max": heights[1]},
    )


def names(objects: list[SemanticObject]) -> list[str]:
    return [item.name for item in objects]


def test_of_two_classes_in_one_place_the_one_that_the_rest_of_the_map_has_is_likelier() -> None:
    others = [thing(n, "chair", 2.0 * n, 20) for n in range(3, 8)]
    places = [thing(0, "bench", 0.05, 12), thing(1, "chair", 0.0, 10), *others]
    found = one_class_per_place(places, 0.4)
    assert [item.id for item in found] == [1, 3, 4, 5, 6, 7]
    assert found[0].tags == ("chair", "bench")
    assert sum(found[0].confidence) == pytest.approx(0.8)
    assert found[0].confidence[0] > 2 * found[0].confidence[1]
    assert found[1] is others[0]
    # Without other chairs, what was seen more often is.
    assert names(one_class_per_place(places[:2], 0.4)) == ["bench"]


def test_a_class_that_nearly_all_frames_say_is_right_whatever_the_rest_of_the_map_has() -> None:
    others = [thing(n, "chair", 2.0 * n, 20) for n in range(3, 8)]
    places = [thing(0, "bench", 0.05, 30), thing(1, "chair", 0.0, 3), *others]
    assert names(one_class_per_place(places, 0.4))[0] == "bench"


def test_things_above_each_other_side_by_side_or_named_by_people_stay() -> None:
    table, cup = thing(0, "table", 0, 9, (0.0, 0.75)), thing(1, "cup", 0, 9, (0.75, 0.9))
    bench = thing(2, "bench", 0.4, 9)  # a ninth of the two together is shared
    assert one_class_per_place([table, cup, bench], 0.4) == [table, cup, bench]
    chair = thing(3, "chair", 0.02, 99)
    assert one_class_per_place([table, chair], 0.4, fixed={0}) == [table, chair]
    assert names(one_class_per_place([table, chair], 0.4)) == ["chair"]
    assert one_class_per_place([], 0.4) == []


def test_a_map_gives_one_object_for_a_thing_that_is_called_two_names_in_turns() -> None:
    evidence = EvidenceMap(profile("default").evidence)
    for stamp in range(8):
        name = "chair" if stamp % 4 < 2 else "bench"
        seen = [ObservedObject(name, 0.9, shapely.box(0, 2, 0.5, 2.5), 0.1, 0.9)]
        seen.append(ObservedObject("chair", 0.9, shapely.box(3, 2, 3.5, 2.5), 0.1, 0.9))
        pose = np.eye(4)
        evidence.update(Observation(float(stamp), pose, tuple(seen), shapely.Point(0, 0).buffer(9)))
    assert names(evidence.objects()) == ["chair", "chair"]


def test_an_object_drawn_over_others_has_no_heights_and_stays() -> None:
    zone = SemanticObject("zone", shapely.box(-1, -1, 2, 2), id=7)
    objects = [zone, thing(0, "bench", 0.05, 12), thing(1, "chair", 0.0, 10)]
    assert names(one_class_per_place(objects, 0.4, {7})) == ["zone", "bench"]
