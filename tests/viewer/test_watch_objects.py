"""The objects of a map that is watched, shape by shape."""

from __future__ import annotations

import shapely

from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.stages import EvidenceConfig
from hypermap.viewer.watch.objects import ObjectsNow

from ..mapping.evidence_tools import DEFAULT, seen, square


def chair_at(objects: ObjectsNow) -> float:
    (chair,) = objects.states.values()
    return shapely.Polygon(chair.polygons[0][0]).centroid.x


def test_what_was_moved_is_at_its_new_place_though_it_was_seen_as_often_before() -> None:
    evidence, objects = EvidenceMap(DEFAULT), ObjectsNow()
    for second in range(60):
        evidence.update(seen(square(-3), stamp=second))
    objects.look(evidence)
    assert chair_at(objects) == -3
    for second in range(60):
        evidence.update(seen(square(3), stamp=86_400 + second))
    objects.look(evidence)
    assert chair_at(objects) == 3
    assert objects.states[0].evidence == 60


def test_the_shapes_of_a_map_made_again_are_its_own() -> None:
    """As after a correction of poses, which moves what the same frames have shown."""
    objects = ObjectsNow()
    for place in (0, 2):
        evidence = EvidenceMap(DEFAULT)
        for second in range(5):
            evidence.update(seen(square(place), stamp=second))
        objects.look(evidence)
        assert chair_at(objects) == place


def test_a_shape_whose_evidence_is_as_before_is_not_made_again() -> None:
    class Counting(EvidenceMap):
        asked = 0

        def objects(self, ids=None):
            self.asked += 1
            return super().objects(ids)

    evidence, objects = Counting(EvidenceConfig()), ObjectsNow()
    for second in range(5):
        evidence.update(seen(square(0), stamp=second))
    for _ in range(3):
        objects.look(evidence)
    assert evidence.asked == 1
