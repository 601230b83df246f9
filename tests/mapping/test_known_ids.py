"""A map that is made again keeps the ids of its objects, in the middle of a later drive, too."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.config import profile
from hypermap.mapping.correcting import map_again
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.frame_log import FrameLog, LoggedFrame, MapBefore, packed_frame
from hypermap.mapping.known_ids import with_known_ids

from .evidence_tools import DEFAULT, ROOM, only, seen, square

DAY = 86_400.0
CONFIG = dataclasses.replace(profile("default"), evidence=DEFAULT)
ALL = slice(None)


class Drives:
    """A map, and the log of its frames."""

    def __init__(self) -> None:
        self.evidence = EvidenceMap(DEFAULT)
        self.log = FrameLog()
        self._scores = np.random.default_rng(1)

    def add(self, day: int, seconds: range, *places: float, area: shapely.Polygon = ROOM) -> None:
        """Show chairs at some places."""
        for second in seconds:
            if self.log.is_full:
                self.log.begin_part(MapBefore.of(self.evidence.tracks(), np.zeros(2, int), None))
            view = seen(*(square(x, side=0.6) for x in places), stamp=day * DAY + second, area=area)
            scores = self._scores.uniform(0.5, 1, len(view.objects))
            objects = zip(view.objects, scores.tolist(), strict=True)
            rated = tuple(dataclasses.replace(one, score=score) for one, score in objects)
            view = dataclasses.replace(view, objects=rated)
            self.evidence.update(view)
            self.log.add(view.stamp, packed_frame(LoggedFrame(view, None)), view.map_T_camera)

    def edit(self, edits: dict[int, HandEdit]) -> None:
        self.evidence.go_on_with(self.evidence.tracks(), edits)

    def again(self) -> EvidenceMap:
        return map_again(self.log, self.log.poses, self.evidence, CONFIG, None).evidence


def known(evidence: EvidenceMap) -> dict[int, tuple[str, float]]:
    """The names and places of the objects, by their ids."""
    return {o.id: (o.name, round(o.footprint.centroid.x, 1)) for o in evidence.objects()}


@pytest.mark.parametrize("parts", [1, 2], ids=["from the first drive on", "from the second on"])
def test_what_was_edited_in_the_middle_of_a_later_drive_is_one_object(parts: int) -> None:
    drives = Drives()
    drives.add(0, range(6), -3.0, 3.0)
    if parts == 2:
        drives.log.end_drive()
    drives.add(1, range(10), -3.0, 3.0)
    drives.edit({0: HandEdit(name="Anna's chair")})
    drives.add(1, range(10, 16), -3.0, 3.0)
    before = known(drives.evidence)
    assert before == {0: ("Anna's chair", -3.0), 1: ("chair", 3.0)}
    assert known(drives.again()) == before


def test_objects_of_one_frame_with_equal_scores_are_not_mixed_up() -> None:
    """As of a detector that scores nothing; the map made again finds them in another order."""
    known_map, again = EvidenceMap(DEFAULT), EvidenceMap(DEFAULT)
    for second in range(6):
        left, right = square(-3.0, side=0.6), square(3.0, side=0.6)
        known_map.update(seen(left, right, stamp=second))
        again.update(seen(right, left, stamp=second))
    tracks = with_known_ids(again.tracks(), known_map.tracks(), frozenset(), DEFAULT)
    made = EvidenceMap(DEFAULT)
    made.go_on_with(tracks, {})
    assert known(made) == known(known_map) == {0: ("chair", -3.0), 1: ("chair", 3.0)}


def test_what_was_moved_and_then_edited_keeps_its_id_at_its_new_place() -> None:
    drives = Drives()
    drives.add(0, range(6), -3.0)
    drives.add(1, range(10), 3.0)
    drives.edit({0: HandEdit(name="Anna's chair")})
    drives.add(1, range(10, 14), 3.0)
    assert known(drives.evidence) == {0: ("Anna's chair", 3.0)}
    assert known(drives.again()) == {0: ("Anna's chair", 3.0)}


def test_what_a_drive_shows_stays_apart_from_what_earlier_ones_knew() -> None:
    """What comes later may still tell that the new chair is the one that was moved."""
    drives = Drives()
    drives.add(0, range(6), -3.0)
    drives.log.end_drive()
    away = shapely.box(1, -10, 10, 10)
    drives.add(1, range(6), 3.0, area=away)
    drives.evidence = drives.again()
    tracks = drives.evidence.tracks()
    assert [track.id < tracks.first_id for track in tracks.objects] == [True, False]
    drives.add(1, range(6, 40), 3.0)
    assert only(drives.evidence).id == 0


def test_what_was_drawn_in_the_middle_of_a_drive_stays() -> None:
    drives = Drives()
    drives.add(0, range(6), -3.0)
    drives.add(1, range(6), -3.0)
    number = drives.evidence.tracks().next_id
    drawn = SemanticObject("chair", square(0.0, side=0.6), id=number)
    drives.edit({number: HandEdit(drawn=drawn)})
    drives.add(1, range(6, 12), -3.0, 0.0)
    before = known(drives.evidence)
    assert known(drives.again()) == before == {0: ("chair", -3.0), number: ("chair", 0.0)}
