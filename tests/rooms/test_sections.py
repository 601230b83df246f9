"""Lines across a corridor, and those that are none."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap.rooms.sections import across_corridors, gaps_in_walls

from .conftest import SIDE, Plan, along_a_corridor, two_rooms


def is_across(plan: Plan, *ends: tuple[float, float]) -> bool:
    """Return whether a line between two places [m] lies across a corridor."""
    walls = plan.cells != 0
    (found,) = across_corridors(np.array([ends]) / SIDE, walls, SIDE)
    return bool(found)


def test_a_line_between_the_frames_of_two_doors_lies_across_the_corridor():
    assert is_across(along_a_corridor(), (6.5, 5), (6.5, 7))


@pytest.mark.parametrize("shift", [-1.0, 0.5, 1.0])
def test_a_line_may_be_slanted(shift):
    assert is_across(along_a_corridor(), (4.8, 5), (4.8 + shift, 7))


def test_a_door_is_no_line_across_a_corridor():
    assert not is_across(two_rooms(0.9), (4.4, 2.05), (4.4, 2.95))


def test_where_a_cubicle_opens_to_a_corridor_is_no_line_across_it():
    plan = Plan(16, 7).clear(0.5, 0.5, 15.5, 2.5).clear(4, 2.5, 6, 5)
    assert not is_across(plan, (4, 2.5), (6, 2.5))


def test_where_a_corridor_ends_in_a_hall_is_no_line_across_it():
    plan = Plan(16, 9).clear(0.5, 4, 8, 6).clear(8, 1, 15, 8)
    assert not is_across(plan, (8, 4), (8, 6))


def test_a_grid_ends_as_a_wall_does():
    assert is_across(Plan(10, 2).clear(0, 0, 10, 2), (5, 0), (5, 2))


def test_a_door_in_a_wall_is_a_gap_and_a_frame_in_a_corridor_is_none():
    def is_gap(plan: Plan, *ends: tuple[float, float]) -> bool:
        (found,) = gaps_in_walls(np.array([ends]) / SIDE, plan.cells != 0, SIDE)
        return bool(found)

    assert is_gap(two_rooms(0.9), (4.4, 2.05), (4.4, 2.95))
    frame = Plan(10, 3).clear(0.5, 0.5, 9.5, 2).fill(5, 0.5, 5.2, 0.75).fill(5, 1.75, 5.2, 2)
    walls_are_thin = frame.clear(0.5, 0, 9.5, 0.3).clear(0.5, 2.2, 9.5, 3)
    assert not is_gap(walls_are_thin, (5, 0.75), (5, 1.75))
