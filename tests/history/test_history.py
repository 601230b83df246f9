"""The history of a map: what saving adds to it, and the map as it was."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from shapely import affinity

from hypermap import Hypermap, HypermapError, SemanticLayer, SemanticObject, open_map
from hypermap.core.embeddings import Embeddings
from hypermap.core.evidence import EvidenceTable
from hypermap.core.history import MAP_ID, MAP_VERSION, Change, Mapped, Revision
from hypermap.history import as_of, at_version, begun, grown, in_force, next_expiry
from hypermap.history.policy import HistoryPolicy

MONDAY, TUESDAY, WEDNESDAY = 1.7e9, 1.7e9 + 86_400, 1.7e9 + 2 * 86_400


def box(name: str, x: float, number: int, **attributes: object) -> SemanticObject:
    return SemanticObject(name, shapely.box(x, 0, x + 1, 1), id=number, attributes=attributes)


def office() -> Hypermap:
    """Return a map that keeps its history, and has no revision yet."""
    layer = SemanticLayer("semantic", "map", [box("table", 0, 0), box("chair", 2, 1)])
    hypermap = Hypermap([layer], metadata={MAP_ID: "00ff", MAP_VERSION: 1})
    hypermap.history = begun(hypermap)
    return hypermap


def moved(hypermap: Hypermap, number: int, by: float) -> None:
    item = hypermap.semantic()[number]
    shape = affinity.translate(item.footprint, by)
    hypermap.semantic().update(number, dataclasses.replace(item, footprint=shape))


def revisions(hypermap: Hypermap) -> list[Revision]:
    assert hypermap.history is not None
    return hypermap.history.revisions()


def test_a_map_that_has_not_changed_gets_no_new_version() -> None:
    hypermap = office()
    assert grown(hypermap, MONDAY) is hypermap


def edits() -> dict[str, Callable[[SemanticLayer], object]]:
    wide = shapely.box(2, 0, 5, 1)
    return {
        "renamed": lambda layer: layer.rename(1, "stool"),
        "gone": lambda layer: layer.remove(1),
        "added": lambda layer: layer.add(box("cup", 5, 7)),
        "reshaped": lambda layer: layer.update(1, SemanticObject("chair", wide)),
        "moved": lambda layer: layer.update(1, box("chair", 2.01, 1)),
        "edited": lambda layer: layer.update(1, box("chair", 2, 1, owner="Anna")),
    }


@pytest.mark.parametrize("text", ["yesterday", "", "2026-13-01", "v1"])
def test_a_text_that_is_not_a_time_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=rf"expected a time in ISO 8601, .*, got '{text}'"):
        as_of(office(), text)


def test_who_asks_for_a_version_as_for_a_time_is_told_how() -> None:
    with pytest.raises(ValueError, match=r"'v12'; for a version: .*at_version\(map, 12\)$"):
        as_of(office(), "v12")


@pytest.mark.parametrize("moment", [None, True, b"2026", [1.7e9]])
def test_what_cannot_be_a_time_is_refused(moment: Any) -> None:
    with pytest.raises(TypeError, match="expected a datetime, its ISO 8601 form or seconds"):
        as_of(office(), moment)


def test_a_date_is_its_beginning_here() -> None:
    hypermap, now = office(), datetime.now().astimezone().replace(hour=0, minute=0, second=0)
    for days, by in ((3, 0.5), (1, 1.5)):
        moved(hypermap, 1, by)
        hypermap = grown(hypermap, (now - timedelta(days=days)).timestamp())
    past = hypermap.as_of((now - timedelta(days=2)).date())
    assert past.semantic()[1].footprint.bounds[0] == pytest.approx(2.5)
    with pytest.raises(HypermapError, match="is not known: its history begins"):
        hypermap.as_of((now - timedelta(days=4)).date())


def test_nan_is_not_a_time() -> None:
    with pytest.raises(ValueError, match="the time is NaN"):
        as_of(office(), float("nan"))


@pytest.mark.parametrize("kind", list(edits()))
def test_each_edit_is_a_change_of_the_next_version_and_can_be_undone(kind: str) -> None:
    hypermap = office()
    edits()[kind](hypermap.semantic())
    saved = grown(hypermap, MONDAY)
    (revision,) = revisions(saved)
    assert [change.kind for change in revision.changes] == [kind]
    assert (revision.version, revision.cause, revision.time) == (2, "edit", MONDAY)
    assert saved.metadata[MAP_VERSION] == 2
    assert grown(saved, TUESDAY) is saved
    states = [sorted(vars(item).items(), key=str) for item in saved.semantic()]
    saved.semantic().remove(0)
    both = grown(saved, TUESDAY)
    past = at_version(both, 2).semantic()
    assert [sorted(vars(item).items(), key=str) for item in past] == states
    with pytest.raises(HypermapError, match="its history begins with version 2"):
        at_version(both, 1)
    assert len(at_version(both, 3).semantic()) == len(both.semantic())
    with pytest.raises(HypermapError, match="there is no version 4 of the map; the newest is 3"):
        at_version(both, 4)


def test_a_map_is_known_at_every_time_since_its_history_began(tmp_path: Path) -> None:
    hypermap = office()
    states = []
    for time, by in ((MONDAY, 0.5), (TUESDAY, 1.5), (WEDNESDAY, 2.5)):
        moved(hypermap, 1, by)
        hypermap = grown(hypermap, time)
        states.append(hypermap.semantic()[1].footprint.bounds[0])
    hypermap.save(tmp_path / "office.hmap")
    for opened in (hypermap, open_map(tmp_path / "office.hmap")):
        for time, x in zip((MONDAY, TUESDAY, WEDNESDAY), states, strict=True):
            past = opened.as_of(datetime.fromtimestamp(time + 60, timezone.utc))
            assert past.semantic()[1].footprint.bounds[0] == pytest.approx(x, abs=1e-4)
            assert past.mapper_state is past.history is None
    with pytest.raises(HypermapError, match="its history begins with version 2"):
        as_of(hypermap, MONDAY - 1)


@pytest.mark.parametrize("has_evidence", [True, False])
def test_nothing_of_the_past_was_seen_later(has_evidence: bool) -> None:
    hypermap, days = office(), (MONDAY, TUESDAY, WEDNESDAY)
    shown = dataclasses.replace(hypermap.semantic()[0], first_seen=MONDAY, last_seen=WEDNESDAY)
    hypermap.semantic().update(0, shown)
    if has_evidence:
        shapes = np.array([shown.footprint] * 3)
        hypermap.semantic().kept_evidence = EvidenceTable(
            object_ids=np.zeros(3, np.int64),
            views=np.array([2, 0, 1]),
            scores=np.ones(3),
            footprints=shapes,
            heights=np.zeros((3, 2)),
            stamps=np.array(days),
            poses=np.tile(np.eye(4), (3, 1, 1)),
            areas=shapes,
        )
    for time in days:
        moved(hypermap, 1, 0.5)
        hypermap = grown(hypermap, time)
    for past in (as_of(hypermap, TUESDAY + 60), at_version(hypermap, 3)):
        assert past.semantic()[0].last_seen == (TUESDAY if has_evidence else MONDAY)
        assert past.semantic()[0].first_seen == MONDAY
        assert past.semantic()[1].last_seen is None
    assert as_of(hypermap, WEDNESDAY).semantic()[0].last_seen == WEDNESDAY


class Encoder:
    """Encodes every text as what object 1 looks like."""

    model = "an encoder"

    def texts(self, texts: list[str]) -> NDArray[np.float32]:
        return np.tile(np.float32([0, 1]), (len(texts), 1))


def test_objects_of_the_past_are_found_by_what_they_look_like() -> None:
    hypermap = office()
    looks = np.eye(2, dtype=np.float16), np.ones(2, np.float32)
    hypermap.semantic().kept_embeddings = Embeddings(Encoder.model, np.arange(2), *looks)
    for time, name in ((MONDAY, "stool"), (TUESDAY, "chair")):
        hypermap.semantic().rename(1, name)
        hypermap = grown(hypermap, time)
    (found,) = hypermap.as_of(MONDAY + 60).find_like("a seat", k=1, encoder=Encoder())
    assert found.object is not None
    assert (found.object.id, found.object.name) == (1, "stool")


def test_mapping_logs_what_diff_would_show_and_an_edit_everything() -> None:
    for mapped, kinds in ((Mapped("day2", MONDAY), []), (None, ["moved"])):
        hypermap = office()
        moved(hypermap, 1, 0.1)
        assert hypermap.history is not None
        hypermap.history = dataclasses.replace(hypermap.history, mapped=mapped)
        (revision,) = revisions(grown(hypermap, MONDAY))
        assert [change.kind for change in revision.changes] == kinds
        assert revision.drive == ("" if mapped is None else "day2")


@pytest.mark.parametrize(("by", "kinds"), [(0.24, []), (0.26, ["moved"])])
def test_a_move_of_0_3_m_is_told_though_the_map_shows_somewhat_less(
    by: float, kinds: list[str]
) -> None:
    hypermap = office()
    moved(hypermap, 1, by)
    assert hypermap.history is not None
    hypermap.history = dataclasses.replace(hypermap.history, mapped=Mapped("day2", MONDAY))
    assert [change.kind for change in revisions(grown(hypermap, MONDAY))[0].changes] == kinds


@pytest.mark.parametrize(("says", "kind"), [(True, "moved"), (False, "reshaped")])
def test_what_mapping_has_found_to_be_moved_is_so_though_its_outline_differs(
    says: bool, kind: str
) -> None:
    """As a lamp's, which a drive sees from another side."""
    hypermap = office()
    attributes = {"moved": {"confidence": 0.7}} if says else {}
    thin = SemanticObject("chair", shapely.box(2.6, 1, 2.7, 2), attributes=attributes)
    hypermap.semantic().update(1, thin)
    assert hypermap.history is not None
    hypermap.history = dataclasses.replace(hypermap.history, mapped=Mapped("day2", MONDAY))
    (change,) = revisions(grown(hypermap, MONDAY))[0].changes
    assert change.kind == kind
    assert change.confidence == (0.7 if says else None)


@pytest.mark.parametrize(
    ("before", "after", "kind"),
    [
        (None, None, "corrected"),
        (None, {"confidence": 0.7, "since": MONDAY}, "moved"),
        # A correction changes how likely a move is that is known already.
        ({"confidence": 0.8, "since": MONDAY}, {"confidence": 0.7, "since": MONDAY}, "corrected"),
        ({"confidence": 0.8, "since": MONDAY}, {"confidence": 0.7, "since": TUESDAY}, "moved"),
    ],
)
def test_corrected_poses_move_nothing_of_which_mapping_does_not_say_so(
    before: dict[str, float] | None, after: dict[str, float] | None, kind: str
) -> None:
    was, now = (
        box("chair", x, 1, **({} if said is None else {"moved": said}))
        for x, said in ((2, before), (2.6, after))
    )
    first = mapped(office(), MONDAY, was)
    assert first.history is not None
    other = first.with_layer(SemanticLayer("semantic", "map", [now]))
    correction = Mapped("day2", TUESDAY, shifts={})
    other.history = dataclasses.replace(first.history, mapped=correction)
    (change,) = revisions(grown(other, TUESDAY))[-1].changes
    assert (change.kind, change.distance) == (kind, pytest.approx(0.6))
    assert change.confidence == (0.7 if kind == "moved" else None)


@pytest.mark.parametrize(
    ("shift", "kind", "distance"),
    [
        ((1.0, 0.0), "moved", 0.4),  # the poses shifted it by 1 m, and somebody moved it back
        ((0.0, 0.8), "moved", 1.0),
        ((0.6, 0.0), "corrected", 0.6),  # nothing but the correction
    ],
)
def test_the_distance_of_a_move_is_without_the_shift_by_corrected_poses(
    shift: tuple[float, float], kind: str, distance: float
) -> None:
    first = mapped(office(), MONDAY, box("chair", 2, 1))
    assert first.history is not None
    said = {"confidence": 0.7, "since": MONDAY}
    now = box("chair", 2.6, 1, moved=said)
    other = first.with_layer(SemanticLayer("semantic", "map", [now]))
    correction = Mapped("day2", TUESDAY, shifts={1: shift})
    other.history = dataclasses.replace(first.history, mapped=correction)
    (change,) = revisions(grown(other, TUESDAY))[-1].changes
    assert (change.kind, change.distance) == (kind, pytest.approx(distance))


@pytest.mark.parametrize(("end", "kinds"), [(3.7, []), (2.6, ["moved"])])
def test_what_still_fills_its_place_has_not_moved(end: float, kinds: list[str]) -> None:
    """As a shelf of which another drive sees more; one of the same size beside it has moved."""
    hypermap = office()
    start = 2.0 if end > 3 else end - 1
    longer = SemanticObject("chair", shapely.box(start, 0, end, 1))
    hypermap.semantic().update(1, longer)
    assert hypermap.history is not None
    hypermap.history = dataclasses.replace(hypermap.history, mapped=Mapped("day2", MONDAY))
    assert [change.kind for change in revisions(grown(hypermap, MONDAY))[0].changes] == kinds


def mapped(
    hypermap: Hypermap,
    stamp: float,
    *objects: SemanticObject,
    doubt: Callable[[Change], float] | None = None,
) -> Hypermap:
    """Return a map whose layer a drive has replaced by some objects."""
    assert hypermap.history is not None
    other = hypermap.with_layer(SemanticLayer("semantic", "map", objects))
    other.history = dataclasses.replace(hypermap.history, mapped=Mapped("day", stamp, doubt))
    return grown(other, stamp)


def seen(number: int, first: float, last: float) -> SemanticObject:
    cup = box("cup", 10 * number, number)
    return dataclasses.replace(cup, first_seen=first, last_seen=last)


def told(hypermap: Hypermap) -> list[tuple[str, int | None]]:
    return [(change.kind, change.object.id) for change in revisions(hypermap)[-1].changes]


def test_what_an_earlier_drive_has_detected_already_was_not_added() -> None:
    monday = mapped(office(), MONDAY, seen(2, MONDAY - 9, MONDAY))
    both = (seen(2, MONDAY - 9, TUESDAY), seen(3, MONDAY - 5, TUESDAY))
    tuesday = mapped(monday, TUESDAY, *both, seen(4, TUESDAY - 5, TUESDAY))
    assert told(tuesday) == [("first seen", 3), ("added", 4)]
    without = mapped(tuesday, WEDNESDAY, *both)
    assert told(without) == [("gone", 4)]
    back = mapped(without, WEDNESDAY + 9, *both, seen(4, TUESDAY - 5, WEDNESDAY + 9))
    assert told(back) == [("added", 4)]


def test_what_was_part_of_another_one_that_stays_was_not_added() -> None:
    def bench(number: int, begin: float, end: float, name: str = "bench") -> SemanticObject:
        return SemanticObject(name, shapely.box(begin, 0, end, 0.5), id=number)

    monday = mapped(office(), MONDAY, bench(2, 0, 3.8))
    cases: list[tuple[SemanticObject, SemanticObject, list[tuple[str, int]]]] = [
        (bench(2, 1.9, 3.8), bench(3, 0, 1.8), [("reshaped", 2), ("first seen", 3)]),
        (bench(2, 0.1, 3.9), bench(3, 2, 2.4, "cup"), [("added", 3)]),  # of another class
        (bench(2, 1.9, 3.8), bench(3, -1.4, 0.4), [("reshaped", 2), ("added", 3)]),  # beside it
        (bench(2, 8, 11.8), bench(3, 0, 1.8), [("moved", 2), ("added", 3)]),  # in its place
    ]
    for rest, other, changes in cases:
        assert told(mapped(monday, TUESDAY, rest, other)) == changes
    assert told(mapped(monday, TUESDAY, bench(3, 0, 1.8))) == [("gone", 2), ("added", 3)]


def test_what_frames_of_the_other_drive_show_was_not_added_and_may_not_be_gone() -> None:
    chances = {2: 0.9, 3: 0.9, 4: 0.1}  # that it did not come or go

    def doubt(change: Change) -> float:
        return chances[change.object.id or 0]

    def sure(number: int) -> SemanticObject:
        return dataclasses.replace(box("cup", 10 * number, number), confidence=(0.8,))

    monday = mapped(office(), MONDAY, sure(2))
    tuesday = mapped(monday, TUESDAY, sure(3), sure(4), doubt=doubt)
    assert told(tuesday) == [("gone", 2), ("first seen", 3), ("added", 4)]
    sureness = [change.confidence for change in revisions(tuesday)[-1].changes]
    assert sureness == [pytest.approx(0.08), 0.8, 0.8]


def test_what_was_detected_elsewhere_before_was_added() -> None:
    monday = mapped(office(), MONDAY, seen(2, MONDAY - 9, MONDAY))
    for since, kind in ((TUESDAY - 5, "added"), (MONDAY - 4, "first seen")):
        cup = seen(3, MONDAY - 5, TUESDAY)
        cup = dataclasses.replace(cup, attributes={"moved": {"confidence": 0.9, "since": since}})
        assert told(mapped(monday, TUESDAY, seen(2, MONDAY - 9, TUESDAY), cup)) == [(kind, 3)]


def test_stamps_of_a_clock_that_is_not_set_do_not_tell_what_was_there_before() -> None:
    monday = mapped(office(), MONDAY, seen(2, MONDAY - 9, MONDAY))
    tuesday = mapped(monday, TUESDAY, seen(2, MONDAY - 9, MONDAY), seen(3, 5.0, 9.0))
    assert told(tuesday) == [("added", 3)]


def test_a_drive_that_is_mapped_late_does_not_turn_time_back() -> None:
    hypermap = office()
    for time, by in ((TUESDAY, 1.0), (MONDAY, 1.0)):
        moved(hypermap, 1, by)
        assert hypermap.history is not None
        hypermap.history = dataclasses.replace(hypermap.history, mapped=Mapped("day", time))
        hypermap = grown(hypermap, WEDNESDAY)
    assert as_of(hypermap, TUESDAY).semantic()[1].footprint.bounds[0] == 4


def test_an_edit_of_another_layer_delays_no_drive_that_is_mapped_after_it() -> None:
    """As of `hypermap rooms`, before recordings of the days before are mapped."""
    hypermap = office()
    for time, mapping in ((MONDAY, True), (WEDNESDAY, False), (TUESDAY, True)):
        if mapping:
            moved(hypermap, 1, 1.0)
        else:
            hypermap.add(SemanticLayer("rooms", "map", [box("kitchen", 0, 0)]))
        assert hypermap.history is not None
        drive = Mapped("day", time) if mapping else None
        hypermap.history = dataclasses.replace(hypermap.history, mapped=drive)
        hypermap = grown(hypermap, time)
    for time, x, rooms in ((MONDAY, 3, 0), (TUESDAY, 4, 0), (WEDNESDAY, 4, 1)):
        past = as_of(hypermap, time)
        assert past.semantic("semantic")[1].footprint.bounds[0] == x
        assert len(past.semantic("rooms")) == rooms
    assert [len(at_version(hypermap, n).semantic("rooms")) for n in (2, 3, 4)] == [0, 1, 1]


def test_an_edit_under_a_clock_years_ahead_hides_nothing(tmp_path: Path) -> None:
    hypermap = office()
    for time, by in ((MONDAY, 1.0), (MONDAY + 1e10, 1.0), (TUESDAY, 1.0)):
        moved(hypermap, 1, by)
        hypermap = grown(hypermap, time)
    hypermap.save(tmp_path / "office.hmap")
    opened = open_map(tmp_path / "office.hmap")
    assert [one.time for one in revisions(opened)] == [MONDAY, MONDAY + 1e10, TUESDAY]
    for time, x in ((MONDAY, 4), (TUESDAY, 5)):
        assert as_of(opened, time).semantic()[1].footprint.bounds[0] == x


def test_a_robot_whose_clock_is_not_set_knows_the_past(monkeypatch: pytest.MonkeyPatch) -> None:
    hypermap = office()
    for time in (MONDAY, TUESDAY):
        moved(hypermap, 1, 1.0)
        hypermap = grown(hypermap, time)
    monkeypatch.setattr("time.time", lambda: 60.0)
    assert as_of(hypermap, MONDAY).semantic()[1].footprint.bounds[0] == 3


def test_saving_adds_what_changed_and_saving_again_gives_the_same_bytes(tmp_path: Path) -> None:
    hypermap = office()
    hypermap.semantic().rename(0, "desk")
    for name in ("a", "b"):
        hypermap.save(tmp_path / f"{name}.hmap")
    assert (tmp_path / "a.hmap").read_bytes() == (tmp_path / "b.hmap").read_bytes()
    assert hypermap.metadata[MAP_VERSION] == 2
    opened = open_map(tmp_path / "a.hmap")
    opened.save(tmp_path / "b.hmap")
    assert (tmp_path / "a.hmap").read_bytes() == (tmp_path / "b.hmap").read_bytes()


def test_a_map_without_an_identity_keeps_no_history(tmp_path: Path) -> None:
    hypermap = Hypermap([SemanticLayer("semantic", "map", [box("table", 0, 0)])])
    hypermap.save(tmp_path / "a.hmap")
    opened = open_map(tmp_path / "a.hmap")
    assert opened.history is None
    with pytest.raises(HypermapError, match="keeps no history"):
        opened.as_of(MONDAY)


def test_what_has_expired_is_not_in_force_and_is_logged_when_it_is_removed() -> None:
    hypermap = office()
    until = datetime.fromtimestamp(TUESDAY, timezone.utc).isoformat()
    hypermap.semantic().add([box("wet floor", 5, 5, expires=until), box("zone", 7, 6, expires="?")])
    hypermap = grown(hypermap, MONDAY)
    assert next_expiry(hypermap) == TUESDAY
    assert in_force(hypermap, TUESDAY - 1) is hypermap
    left = in_force(hypermap, TUESDAY)
    assert left.semantic().names.tolist() == ["table", "chair", "zone"]
    assert [change.kind for change in revisions(grown(left, TUESDAY))[-1].changes] == ["expired"]


@pytest.mark.parametrize("said", ["?", math.nan, 10**400, True, [TUESDAY]])
def test_what_expires_at_no_time_never_does_and_others_do(
    said: object, caplog: pytest.LogCaptureFixture
) -> None:
    hypermap = office()
    hypermap.semantic().add([box("zone", 7, 6, expires=said), box("floor", 5, 5, expires=TUESDAY)])
    assert next_expiry(hypermap) == TUESDAY
    assert "is no time, so it never expires" in caplog.text
    left = in_force(hypermap, TUESDAY)
    assert left.semantic().names.tolist() == ["table", "chair", "zone"]


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"keep": "90"}, "keep: expected a time such as 90d, got '90'"),
        ({"max_mb": 0}, "max_mb: expected 0 to 500, got 0"),
        ({"keeps": "9d"}, "expected keep and max_mb"),
        ("9d", "expected keep and max_mb"),
    ],
)
def test_a_wrong_policy_is_refused(said: object, message: str) -> None:
    with pytest.raises(HypermapError, match=message):
        HistoryPolicy.of({"history": said})
