"""Any number of copies of a layer, each changed on its own, and what was seen of them before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from hypermap.core.semantic import SemanticLayer
from hypermap.core.store import ObjectStore, object_log
from hypermap.testing import assert_same_objects, square

AREAS = [
    shapely.box(-3.2, -3.2, 3.2, 3.2),
    shapely.Polygon([(0, -9), (9, 0), (0, 9), (-9, 0)]),
    shapely.Point(1, 1),
]
numbers = st.integers(-4, 4)
things = st.tuples(st.sampled_from("abc"), numbers, numbers, st.sampled_from([0.5, 1.5, 20]))
POINTS = np.array([(x, y) for x in range(-4, 5, 2) for y in range(-4, 5, 2)], dtype=float)

Model = dict[int, tuple[str, int, int, float]]


def assert_holds(store: ObjectStore, model: Model) -> None:
    """Assert that all answers are those of a layer that was made of the objects just now."""
    objects = [square(*item, id=number) for number, item in model.items()]
    fresh = SemanticLayer("s", "map", objects)
    other = fresh.snapshot
    assert len(store) == len(model)
    assert_same_objects([store.object(row) for row in store.rows.tolist()], objects)
    assert_same_objects([store.table.object(row) for row in range(len(model))], objects)
    assert_ids(store, store.at_each(POINTS), other, other.at_each(POINTS))
    for point in POINTS[::5]:
        assert_ids(store, store.at_each(point[np.newaxis]), other, other.at_each(point[np.newaxis]))
    for area in AREAS:
        assert_ids(store, store.in_area(area), other, other.in_area(area))
        for what in ("a", "z", 3, 3.5):
            mine = store.named(what, area)
            assert_ids(store, mine, other, other.named(what, area))
    for what in ("a", "b", 0, 7):
        assert_ids(store, store.named(what), other, other.named(what))
        (mine, far), (rows, distances) = (
            each.nearest(what, np.array([1.0, 0.5]), 3) for each in (store, other)
        )
        assert_ids(store, mine, other, rows)
        np.testing.assert_array_equal(far, distances)


def assert_ids(
    mine: ObjectStore, rows: np.ndarray, other: ObjectStore, expected: np.ndarray
) -> None:
    assert (rows < 0).tolist() == (expected < 0).tolist()
    there = mine.column("ids", rows[rows >= 0])
    assert there.tolist() == other.column("ids", expected[expected >= 0]).tolist()


@dataclass
class Branch:
    layer: SemanticLayer
    model: Model


@settings(max_examples=60)
@given(st.data())
def test_copies_and_what_was_seen_before_keep_apart(data: st.DataObject) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(object_log, "_FEWEST", data.draw(st.sampled_from([0, 5, 40])))
        branches = [Branch(SemanticLayer("s", "map"), {})]
        seen: list[tuple[ObjectStore, Model]] = []
        for _ in range(data.draw(st.integers(1, 12))):
            branch = data.draw(st.sampled_from(branches))
            change(branch, data)
            if data.draw(st.booleans()):
                seen.append((branch.layer.snapshot, dict(branch.model)))
            if data.draw(st.booleans()):
                branches.append(Branch(branch.layer.copy(), dict(branch.model)))
        for store, model in seen:
            assert_holds(store, model)
        for branch in branches:
            assert_holds(branch.layer.snapshot, branch.model)


def change(branch: Branch, data: st.DataObject) -> None:
    layer, model = branch.layer, branch.model
    kind = data.draw(st.sampled_from(["add", "remove", "update"]))
    if kind == "add":
        new = data.draw(st.lists(things, max_size=12))
        ids = layer.add([square(*item) for item in new])
        model.update(zip(ids, new, strict=True))
        return
    chosen = data.draw(st.sets(st.sampled_from([*model]), max_size=4)) if model else set()
    if kind == "remove":
        layer.remove(chosen)
        for number in chosen:
            del model[number]
        return
    updates = {number: data.draw(things) for number in chosen}
    layer.update_many({number: square(*item) for number, item in updates.items()})
    model.update(updates)


def test_changes_of_a_large_layer_write_behind_its_table_and_copy_nothing() -> None:
    layer = SemanticLayer("s", "map", [square("a", 3 * i, 0) for i in range(4000)])
    log = layer.snapshot.log
    before = layer.snapshot
    for i in range(100):
        (number,) = layer.add([square("b", 3 * i, 9)])
        layer.update(number, square("c", 3 * i, 12))
        layer.remove([i])
        assert layer.label_at([[3 * i, 12], [3 * i, 0], [3 * i, 9]]).tolist() == [
            "c",
            "Empty",
            "Empty",
        ]
    assert layer.snapshot.log is log
    assert len(layer) == 4000
    assert before.named("a").tolist() == list(range(4000))
    layer.add([square("d", 3 * i, 30) for i in range(700)])
    assert layer.snapshot.log is not log
    assert layer.names.tolist() == ["a"] * 3900 + ["c"] * 100 + ["d"] * 700


def test_an_object_that_is_updated_again_and_again_stays_in_its_place() -> None:
    layer = SemanticLayer("s", "map", [square("a", 3 * i, 0) for i in range(4000)])
    for number in (7, 9):
        for name in "bcd":
            layer.update(number, square(name, 3 * number, 5))
            assert layer.ids.tolist() == list(range(4000))
            assert layer.names[number] == name
            assert layer.find("a").shape == (3999 if number == 7 else 3998, 2)


def test_the_nearest_are_the_same_as_by_measuring_all() -> None:
    rng = np.random.default_rng(3)
    sizes = rng.choice([0.3, 1, 12], 600)
    objects = [
        square("a", x, y, size)
        for (x, y), size in zip(rng.uniform(0, 60, (600, 2)), sizes, strict=True)
    ]
    layer = SemanticLayer("s", "map", objects)
    for point in rng.uniform(-10, 70, (40, 2)):
        distances = np.sort([item.footprint.distance(shapely.Point(point)) for item in objects])
        for k in (1, 7, 600):
            np.testing.assert_array_equal(layer.nearest("a", point, k)[1], distances[:k])


def test_a_large_change_makes_no_room_in_the_log_that_it_leaves() -> None:
    """Another layer with the same log may be making it, for what it writes."""
    layer = SemanticLayer("s", "map", [square("a", 3 * i, 0) for i in range(2000)])
    other = layer.copy()
    other.add([square("b", 3 * i, 9) for i in range(2000)])
    assert "written" not in vars(layer.snapshot.log)
    assert other.names.tolist() == ["a"] * 2000 + ["b"] * 2000


def test_a_change_of_nothing_changes_nothing() -> None:
    layer = SemanticLayer("s", "map", [square("a", 3 * i, 0) for i in range(2000)])
    before = layer.snapshot
    layer.update_many({})
    layer.remove([])
    assert layer.add([]) == []
    assert layer.snapshot is before
