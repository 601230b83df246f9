"""What is too small or too large for its class is no evidence of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.mapping.class_sizes import CLASS_SIZES
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.stages import EvidenceConfig
from hypermap.perception.observation import Observation, ObservedObject


def mapped(
    name: str,
    side: float,
    height: float,
    config: EvidenceConfig,
    x: float = 0.0,
    low: float = 0.7,
) -> EvidenceMap:
    """Return the map of three frames that show a thing of a size."""
    evidence = EvidenceMap(config)
    footprint = shapely.box(x, 0, x + side, side / 2)
    thing = ObservedObject(name, 0.9, footprint, z_min=low, z_max=low + height)
    for stamp in range(3):
        area = shapely.box(x - 9, -9, x + 9, 9)
        evidence.update(Observation(float(stamp), np.eye(4), (thing,), area))
    return evidence


@pytest.mark.parametrize(
    ("name", "side", "height", "is_mapped"),
    [
        ("mouse", 0.1, 0.03, True),
        ("mouse", 0.6, 0.03, False),  # the piece of table around it
        ("cell phone", 0.14, 0.01, True),
        ("cell phone", 0.8, 0.01, False),
        ("Laptop", 1.2, 0.2, False),  # the desk
        ("person", 0.1, 0.15, False),
        ("person", 0.1, 1.7, True),  # upright
        ("gadget", 7.0, 3.0, True),  # of which nobody knows how large they are
    ],
)
def test_what_has_not_the_size_of_its_class_is_left_out(
    name: str, side: float, height: float, is_mapped: bool
) -> None:
    default = profile("default").evidence
    assert len(mapped(name, side, height, default)) == is_mapped
    assert len(mapped(name, side, height, replace(default, class_sizes="any"))) == 1
    assert len(mapped(name, side, height, profile("thesis").evidence)) == 1


@pytest.mark.parametrize(
    ("name", "low", "is_mapped"),
    [
        ("bin", 1.5, False),  # a shadow on the wall
        ("bin", 0.5, True),  # half hidden by a table
        ("dining table", 1.6, False),
        ("person", 1.1, True),  # the head of somebody behind a screen
        ("cup", 1.6, True),  # on a shelf
        ("chair", 3.2, True),  # the floor of this map is not at z = 0
    ],
)
def test_what_stands_on_the_floor_or_on_a_table_does_not_hang_on_the_wall(
    name: str, low: float, is_mapped: bool
) -> None:
    side = sum(CLASS_SIZES[name.replace(" ", "")]) / 3
    default = profile("default").evidence
    assert len(mapped(name, side, 0.1, default, low=low)) == is_mapped
    assert len(mapped(name, side, 0.1, replace(default, class_sizes="any"), low=low)) == 1


@given(st.sampled_from(sorted(CLASS_SIZES)), st.floats(0.01, 0.99), st.floats(-50, 50))
def test_what_has_it_is_mapped_wherever_it_is(name: str, share: float, x: float) -> None:
    least, most = CLASS_SIZES[name]
    side = least + share * (most - least)
    assert len(mapped(name, side, 0.01, profile("default").evidence, x)) == 1
