"""Parameters that an operator gives, at the start of a node and later."""

from __future__ import annotations

import logging
from typing import Any

import pytest

from hypermap.core.errors import HypermapError
from hypermap.ros.parameters import ParameterSet, checked
from hypermap.ros.port import Parameter

RATE = Parameter("rate", 2.0, "Rate [Hz].", minimum=0.5, maximum=10.0, changes=True)
COUNT = Parameter("count", 3, "Count.", minimum=1)
SHOWN = Parameter("shown", True, "Whether it is shown.", changes=True)
MODE = Parameter("mode", "raw", "Mode.", choices=("raw", "scale"))
NAMES = Parameter("names", [], "Names.")
PARTS = Parameter("parts", ["area"], "Parts.", choices=("area", "label"))


@pytest.mark.parametrize(
    ("parameter", "given", "value"),
    [
        (RATE, 3, 3.0),
        (RATE, 0.5, 0.5),
        (RATE, 10.0, 10.0),
        (COUNT, 1, 1),
        (SHOWN, False, False),
        (MODE, "scale", "scale"),
        (NAMES, ("a", "b"), ["a", "b"]),
        (NAMES, [], []),
        (PARTS, ["label"], ["label"]),
    ],
)
def test_a_value_that_fits_is_taken(parameter: Parameter, given: Any, value: Any) -> None:
    found = checked(parameter, given)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("parameter", "given", "error"),
    [
        (RATE, 0.4, "parameter 'rate' must be at least 0.5, got 0.4"),
        (RATE, 11, "parameter 'rate' must be at most 10.0, got 11.0"),
        (RATE, float("nan"), "parameter 'rate' must be a number, got nan"),
        (RATE, "fast", "parameter 'rate' must be a number, got 'fast'"),
        (RATE, True, "parameter 'rate' must be a number, got True"),
        (COUNT, 2.5, "parameter 'count' must be a whole number, got 2.5"),
        (COUNT, True, "parameter 'count' must be a whole number, got True"),
        (COUNT, 0, "parameter 'count' must be at least 1, got 0"),
        (SHOWN, 1, "parameter 'shown' must be true or false, got 1"),
        (MODE, "scales", "parameter 'mode' cannot be 'scales'; did you mean 'scale'?"),
        (MODE, 3, "parameter 'mode' must be a text, got 3"),
        (
            NAMES,
            "[a]",
            "parameter 'names' must be a list of texts, got '[a]'; <rosparam> makes lists",
        ),
        (NAMES, ["a", 1], r"parameter 'names' must be a list of texts, got ['a', 1]"),
        (PARTS, ["walls"], "parameter 'parts' cannot be 'walls'; known: area, label"),
    ],
)
def test_a_value_that_does_not_fit_is_an_error(
    parameter: Parameter, given: Any, error: str
) -> None:
    with pytest.raises(HypermapError) as caught:
        checked(parameter, given)
    assert str(caught.value) == error


def test_changes_are_reported_once_and_wrong_ones_keep_the_old_value(
    caplog: pytest.LogCaptureFixture,
) -> None:
    reported: list[Any] = []
    parameters = ParameterSet([RATE, SHOWN, MODE], {"rate": 4}, reported.append)
    assert parameters.values == {"rate": 4.0, "shown": True, "mode": "raw"}
    assert parameters.given == {"rate": 4}
    with caplog.at_level(logging.WARNING, "hypermap"):
        for given in (
            {"rate": 4},  # as it was
            {"rate": 4, "shown": True},  # given now, but no other value
            {"rate": 40, "shown": False},  # one is wrong
            {"rate": 40, "shown": False},
            {},  # no longer given
            {"rate": 5, "mode": "scale"},  # one cannot change
        ):
            parameters.update(given)
    assert reported == [{"shown": False}, {"rate": 5.0}]
    assert parameters.values == {"rate": 5.0, "shown": False, "mode": "raw"}
    assert parameters.given == {"rate": 5, "shown": False, "mode": "scale"}
    assert [record.getMessage() for record in caplog.records] == [
        "parameter 'rate' must be at most 10.0, got 40.0; it stays at 4.0",
        "parameter 'mode' takes effect when the node restarts",
    ]


def test_names_that_nobody_heeds_are_a_warning_each(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "hypermap"):
        parameters = ParameterSet([RATE, MODE], {"rates": 4, "other_node": {"rat": 1}})
        for given in ({"rates": 4, "rate": 5}, {"rates": 5, "zzz": 1}, {"zzz": 1}):
            parameters.update(given)
    assert [record.getMessage() for record in caplog.records] == [
        "ignoring the unknown parameter 'rates'; did you mean 'rate'?",
        "ignoring the unknown parameter 'zzz'; known: rate, mode",
    ]


def test_what_holds_for_one_run_does_not_reach_another_roscore() -> None:
    place = Parameter("place", "", "A file.", once=True)
    parameters = ParameterSet([RATE, place], {"rate": 4, "place": "x.hmap"})
    assert parameters.values == {"rate": 4.0, "place": "x.hmap"}
    assert parameters.given == {"rate": 4}
