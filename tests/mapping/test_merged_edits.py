"""What people have edited or deleted in one of two maps stays so when they are merged."""

from __future__ import annotations

from pathlib import Path

import pytest
import shapely

from hypermap import (
    Hypermap,
    SemanticObject,
)
from hypermap.mapping.merging import merge_maps

from .merging_tools import (
    ALL,
    DAY,
    HERE,
    MOVED,
    OTHER_FRAME,
    changed,
    first_day,
    frames,
    mapped,
    objects_of,
    second_day,
)

pytestmark = pytest.mark.xdist_group("merging")  # they share what takes long to make


def test_edits_of_both_maps_stay_and_the_first_one_wins(tmp_path: Path) -> None:
    first = changed(first_day(), tmp_path / "first.hmap")
    layer = first.semantic()
    plant = objects_of(first)["plant"]
    layer.rename(plant.id, "ficus")
    chair = objects_of(first)["chair"]
    layer.remove(chair.id)
    second = changed(second_day(*ALL), tmp_path / "second.hmap")
    layer = second.semantic()
    layer.rename(objects_of(second)["plant"].id, "fern")
    layer.rename(objects_of(second)["table"].id, "desk")
    layer.rename(objects_of(second)["chair"].id, "stool")
    sketch = shapely.box(0.2, 0.2, 0.5, 0.5)
    layer.add([SemanticObject("charger", OTHER_FRAME.inverse().apply_geometry(sketch))])
    merged = merge_maps(
        changed(first, tmp_path / "a.hmap"), changed(second, tmp_path / "b.hmap"), OTHER_FRAME
    )
    found = objects_of(merged.hypermap)
    assert found.keys() == {"ficus", "desk", "charger"}
    assert merged.conflicts == (plant.id,)
    assert merged.deleted == {chair.id: "stool"}
    assert (merged.gone, merged.left_out) == (0, 0)
    assert found["charger"].footprint.equals_exact(sketch, 1e-6)
    on = changed(merged.hypermap, tmp_path / "merged.hmap")
    shots = frames(*ALL)
    assert objects_of(mapped(shots, later=2 * DAY, onto=on)).keys() == found.keys()


def test_edits_of_a_later_map_stay_when_it_is_the_first_one(tmp_path: Path) -> None:
    later = changed(second_day(*MOVED), tmp_path / "later.hmap")
    layer, ids = later.semantic(), {n: item.id for n, item in objects_of(later).items()}
    layer.remove(ids["chair"])
    layer.rename(ids["plant"], "ficus")
    sketch = shapely.box(0.2, 0.2, 0.5, 0.5)
    layer.add([SemanticObject("charger", sketch)])
    merged = merge_maps(changed(later, tmp_path / "a.hmap"), first_day(), OTHER_FRAME.inverse())
    found = objects_of(merged.hypermap)
    assert found.keys() == {"table", "ficus", "charger"}
    assert found["ficus"].id == ids["plant"]
    assert found["charger"].footprint.equals(sketch)
    assert merged.conflicts == ()


def test_what_people_have_drawn_and_deleted_later_stays_deleted(tmp_path: Path) -> None:
    week = changed(first_day(), tmp_path / "monday.hmap")
    week.semantic().add([SemanticObject("charger", shapely.box(0.2, 0.2, 0.5, 0.5))])
    week = changed(week, tmp_path / "drawn.hmap")
    week = changed(mapped(frames(*ALL), later=2 * DAY, onto=week), tmp_path / "week.hmap")
    week.semantic().remove(objects_of(week)["charger"].id)
    week = changed(week, tmp_path / "deleted.hmap")
    between = mapped(frames(*ALL), later=DAY)
    for first, second in ((week, between), (between, week)):
        merged = merge_maps(first, second, HERE)
        assert objects_of(merged.hypermap).keys() == set(ALL)


def test_ids_and_edits_stay_where_later_frames_replace_all_evidence(tmp_path: Path) -> None:
    monday, shots, few = 19_000 * DAY, frames(*ALL), {"max_evidence": 4}
    first = mapped(shots, later=monday, evidence=few)
    second = mapped(shots[12:], later=monday + 5.2, evidence=few)  # while the first one drives
    ids = [{name: item.id for name, item in objects_of(m).items()} for m in (first, second)]
    assert ids[0] != ids[1]
    first = changed(first, tmp_path / "first.hmap")
    first.semantic().remove(ids[0]["chair"])
    first.semantic().rename(ids[0]["plant"], "ficus")
    first = changed(first, tmp_path / "edited.hmap")
    for own, maps in zip(ids, ((first, second), (second, first)), strict=True):
        merged = merge_maps(*maps, HERE)
        found = {name: item.id for name, item in objects_of(merged.hypermap).items()}
        assert found == {"table": own["table"], "ficus": own["plant"]}
        assert (merged.both, merged.first, merged.second) == (2, 0, 0)


@pytest.mark.parametrize("is_first_later", [False, True])
def test_a_deletion_in_one_map_and_another_edit_in_the_other_are_told(
    tmp_path: Path, is_first_later: bool
) -> None:
    def edited(hypermap: Hypermap, name: str | None) -> Hypermap:
        other = changed(hypermap, tmp_path / "other.hmap")
        chair = objects_of(other)["chair"]
        if name is None:
            other.semantic().remove(chair.id)
        else:
            other.semantic().rename(chair.id, name)
        return changed(other, tmp_path / "edited.hmap")

    maps, first_T_second = [first_day(), second_day(*ALL)], OTHER_FRAME
    if is_first_later:
        maps, first_T_second = maps[::-1], OTHER_FRAME.inverse()
    chair = objects_of(maps[0])["chair"].id

    merged = merge_maps(edited(maps[0], None), edited(maps[1], "stool"), first_T_second)
    assert objects_of(merged.hypermap).keys() == {"table", "plant"}
    assert (merged.deleted, merged.conflicts) == ({chair: "stool"}, ())

    merged = merge_maps(edited(maps[0], "stool"), edited(maps[1], None), first_T_second)
    assert objects_of(merged.hypermap).keys() == {"table", "plant", "stool"}
    assert objects_of(merged.hypermap)["stool"].id == chair
    assert (merged.deleted, merged.conflicts) == ({}, (chair,))

    merged = merge_maps(maps[0], edited(maps[1], None), first_T_second)
    assert objects_of(merged.hypermap).keys() == {"table", "plant"}
    assert (merged.deleted, merged.gone) == ({chair: "chair"}, 0)


def test_what_people_have_deleted_from_the_second_map_is_no_object(tmp_path: Path) -> None:
    other = changed(second_day(*ALL), tmp_path / "other.hmap")
    other.semantic().remove(objects_of(other)["plant"].id)
    merged = merge_maps(first_day(), other, OTHER_FRAME)
    assert objects_of(merged.hypermap).keys() == {"table", "chair"}
    assert merged.deleted == {objects_of(first_day())["plant"].id: "plant"}
    assert (merged.both, merged.gone, merged.conflicts) == (2, 0, ())
