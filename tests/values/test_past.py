"""Measured values as of a time are those of the samples by then."""

from __future__ import annotations

import dataclasses
from datetime import datetime, timezone

import numpy as np
import pytest

from hypermap import GridGeometry, Hypermap, HypermapError, OccupancyLayer, SemanticLayer
from hypermap.core.history import MAP_ID, MAP_VERSION
from hypermap.core.value_layer import ValueLayer
from hypermap.history import as_of, at_version, begun, grown
from hypermap.questions.answer import ask
from hypermap.questions.query import Measured, Query
from hypermap.testing import square
from hypermap.values import FieldSettings, Samples, value_layer_of
from hypermap.values.past import values_at, why_undated

MONDAY, TUESDAY = 1_763_971_200.0, 1_764_057_600.0
SETTINGS = FieldSettings(length=1.0, deviation=2.0, noise=0.1)
PLACES = [[0.5, 0.5], [1.5, 0.5], [3.5, 0.5], [4.5, 0.5]]
WALLS = OccupancyLayer("occupancy", "map", GridGeometry(20, 4, 0.25), np.zeros((4, 20), np.int8))


def measured(stamps: list[float]) -> ValueLayer:
    """Return a corridor that was cold on Monday, and warm further on a day later."""
    samples = Samples.of(PLACES, [18.0, 18.0, 30.0, 30.0], stamps=stamps)
    return value_layer_of("warmth", samples, WALLS, unit="degC", settings=SETTINGS)


def with_history(layer: ValueLayer) -> Hypermap:
    """Return a map of two versions, of Monday and Tuesday evening, each with one more cup."""
    hypermap = Hypermap([WALLS, SemanticLayer("semantic", "map"), layer])
    hypermap.metadata |= {MAP_ID: "00ff", MAP_VERSION: 0}
    hypermap.history = begun(hypermap)
    for day in (MONDAY, TUESDAY):
        hypermap.semantic().add([square("cup", 1, 0)])
        hypermap = grown(hypermap, day + 40_000)
    return hypermap


def value(hypermap: Hypermap, x: float) -> float:
    layer = hypermap["warmth"]
    assert isinstance(layer, ValueLayer)
    return float(layer.value_at([[x, 0.5]])[0])


def test_values_are_of_the_samples_by_then() -> None:
    layer = measured([MONDAY, MONDAY + 1, TUESDAY, TUESDAY + 1])
    layer.settings["color"] = "red"
    hypermap = Hypermap([WALLS, layer])
    monday = values_at(hypermap, layer, MONDAY + 9)
    cold = value_layer_of(
        "warmth",
        Samples.of(PLACES[:2], [18.0, 18.0], stamps=[MONDAY, MONDAY + 1]),
        WALLS,
        unit="degC",
        settings=SETTINGS,
    )
    np.testing.assert_array_equal(monday.cells, cold.cells)
    assert (monday.settings, monday.unit) == ({"color": "red"}, "degC")
    assert values_at(hypermap, layer, TUESDAY + 1) is layer
    before = values_at(hypermap, layer, MONDAY - 1)
    assert before.grid == layer.grid
    assert np.isnan(before.value_at(PLACES)).all()


def test_a_map_as_it_was_has_the_values_of_then() -> None:
    hypermap = with_history(measured([MONDAY, MONDAY + 1, TUESDAY, TUESDAY + 1]))
    assert value(hypermap, 4.5) == pytest.approx(30, abs=0.5)
    for past in (at_version(hypermap, 1), as_of(hypermap, MONDAY + 50_000)):
        assert value(past, 0.5) == pytest.approx(18, abs=0.1)
        assert not value(past, 4.5) > 20
    assert value(at_version(hypermap, 2), 4.5) == value(hypermap, 4.5)
    moment = datetime.fromtimestamp(MONDAY + 50_000, timezone.utc)
    warm = Query("places", measured=Measured("warmth", above=25.0))
    assert ask(hypermap, warm).cells
    assert not ask(hypermap, dataclasses.replace(warm, as_of=moment)).cells


def test_values_are_not_made_again_for_questions_about_objects(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delattr("hypermap.values.on_map.made_again")
    hypermap = with_history(measured([MONDAY, MONDAY + 1, TUESDAY, TUESDAY + 1]))
    moment = datetime.fromtimestamp(MONDAY + 50_000, timezone.utc)
    assert ask(hypermap, Query("count", ("cup",), as_of=moment)).count == 1
    with pytest.raises(ImportError):  # as they would be for this one
        ask(hypermap, Query("places", measured=Measured("warmth", above=25.0), as_of=moment))


@pytest.mark.parametrize(
    "kind", ["without stamps", "without samples", "by a clock from 0", "by another program"]
)
def test_values_that_nobody_can_date_are_those_of_now_and_not_asked_as_of_a_time(
    kind: str,
) -> None:
    layer = measured([3.0, 4.0, 5.0, 6.0] if kind == "by a clock from 0" else [np.nan] * 4)
    if kind == "without samples":
        layer = ValueLayer("warmth", "map", layer.grid, layer.cells, "degC")
    if kind == "by another program":
        layer = measured([MONDAY, MONDAY + 1, TUESDAY, TUESDAY + 1])
        layer.made_by = {"method": "kriging"}
    reason = why_undated(layer)
    assert reason is not None
    hypermap = with_history(layer)
    assert at_version(hypermap, 1)["warmth"] is layer
    moment = datetime.fromtimestamp(MONDAY + 50_000, timezone.utc)
    with pytest.raises(HypermapError, match=f"known only as they are now.*{reason}"):
        ask(hypermap, Query("places", measured=Measured("warmth", above=25.0), as_of=moment))
