from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import HypermapError
from hypermap.core.masks import Zone
from hypermap.ros.server.zones import keepout_filter, speed_filter

names = st.sampled_from(["desk", "potted plant", "room 2", "Tür", "3d printer"])
margins = st.floats(0, 100).map(lambda x: round(x, 3))


@pytest.mark.parametrize(
    ("entry", "zone"),
    [
        ("desk 0.2", Zone("desk", 0.2)),
        ("potted plant 1", Zone("potted plant", 1.0)),
        ("room 2 .5", Zone("room 2", 0.5)),
        ("  desk   0.20 ", Zone("desk", 0.2)),
        ("a, b: [c] 0", Zone("a, b: [c]", 0.0)),
    ],
)
def test_a_keepout_zone_is_a_class_and_a_margin(entry, zone) -> None:
    found = keepout_filter([entry])
    assert found.zones == (zone,)
    assert (found.type, found.outside, found.base, found.multiplier) == (0, -1, 0.0, 1.0)


@pytest.mark.parametrize(
    "entry", ["", "desk", "0.2", "desk -0.2", "desk 0.2m", "desk nan", "desk 1e3", 7, None, True]
)
def test_what_is_no_keepout_zone_is_named(entry) -> None:
    with pytest.raises(HypermapError) as error:
        keepout_filter(["desk 0.2", entry])
    assert str(error.value) == (
        f"keepout: {entry!r} is not a zone; expected a class and a margin in meters, as 'desk 0.2'"
    )


@pytest.mark.parametrize("entry", ["plant 0.5 50%", "plant 0.5 50 %", "plant .5 50.0 %"])
def test_a_limit_in_percent_is_the_cells_value(entry) -> None:
    found = speed_filter([entry])
    assert found.zones == (Zone("plant", 0.5, 50),)
    assert (found.type, found.outside, found.base, found.multiplier) == (1, 0, 0.0, 1.0)


@given(st.lists(st.tuples(names, margins, st.floats(0.01, 5)), min_size=1, max_size=5))
def test_a_limit_in_metres_is_never_exceeded(given_zones) -> None:
    given_zones = [(name, margin, round(limit, 2)) for name, margin, limit in given_zones]
    found = speed_filter([f"{name} {margin} {limit}m/s" for name, margin, limit in given_zones])
    assert (found.type, found.outside, found.base) == (2, 0, 0.0)
    highest = max(limit for _, _, limit in given_zones)
    expected = sorted(given_zones, key=lambda zone: -zone[2])
    for zone, (name, margin, limit) in zip(found.zones, expected, strict=True):
        assert (zone.name, zone.margin) == (name, margin)
        assert 1 <= zone.value <= 100
        driven = zone.value * found.multiplier
        assert driven <= max(limit, highest / 100) + 1e-6
        assert driven > limit - highest / 100 - 1e-6


def test_the_lowest_limit_comes_last() -> None:
    found = speed_filter(["a 0 30%", "b 0 80%", "c 0 10%"])
    assert [zone.name for zone in found.zones] == ["b", "a", "c"]


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        (["plant 0.5"], "speed: 'plant 0.5' is not a zone"),
        (["plant 50%"], "speed: 'plant 50%' is not a zone"),
        (["plant 0.5 50"], "speed: 'plant 0.5 50' is not a zone"),
        (["plant 0.5 0%"], "speed: 'plant 0.5 0%': a limit must be above 0 and at most 100 %"),
        (["plant 0.5 101%"], "'plant 0.5 101%': a limit must be above 0 and at most 100 %"),
        (["plant 0.5 0m/s"], "'plant 0.5 0m/s': a limit must be above 0 m/s"),
        (["a 0 50%", "b 0 1 m/s"], "'b 0 1 m/s' has its limit in m/s, others have it in %"),
        ([3], "speed: 3 is not a zone; expected a class, a margin in meters and a limit"),
    ],
)
def test_what_is_no_speed_limit_is_named(entries, message) -> None:
    with pytest.raises(HypermapError) as error:
        speed_filter(entries)
    assert message in str(error.value)


@pytest.mark.parametrize("margin", ["1000000001", "9" * 400])
def test_a_margin_larger_than_any_map_is_named(margin: str) -> None:
    for read, entry in ((keepout_filter, f"a {margin}"), (speed_filter, f"a {margin} 50%")):
        with pytest.raises(HypermapError, match=f"'{entry}': a margin must be at most 1e"):
            read([entry])


def test_no_entries_are_no_zones() -> None:
    assert keepout_filter([]).zones == ()
    assert speed_filter([]).zones == ()
    assert math.isclose(speed_filter([]).multiplier, 1)
