"""Depth in a wrong unit, or of a covered camera, is reported."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hypermap.mapping.depth_check import DepthCheck, why_implausible
from hypermap.perception.frame import Camera, RgbdFrame

CAMERA = Camera.from_intrinsics(fx=120, fy=120, cx=79.5, cy=59.5, width=160, height=120)
ROOM = np.linspace(0.8, 4.0, 120 * 160).reshape(120, 160)
EMPTY = np.full((120, 160), np.nan)
ALMOST_EMPTY = np.where(np.arange(160) < 4, 2.0, np.nan) * np.ones((120, 1))


def frame(depth: Any) -> RgbdFrame:
    return RgbdFrame(0.0, np.asarray(depth, np.float32), CAMERA, np.eye(4))


@pytest.mark.parametrize(
    ("depth", "reason"),
    [
        (ROOM, None),
        (np.full((120, 160), 2.0), None),  # a wall
        (ROOM * 5, None),  # a hall
        (EMPTY, None),  # which is another reason
        (np.where(np.arange(160) < 40, 65.535, ROOM), None),  # some of it
        (ROOM * 1000, "half of its depth is beyond 2360 m; are the units"),
        (np.full((120, 160), np.inf), None),
        (np.full((120, 160), 65.535), "half of its depth is beyond 66 m"),
        (np.where(np.arange(160) < 2, 1.0, 13.107) * np.ones((120, 1)), "its depth is saturated"),
    ],
)
def test_what_no_camera_measures_is_distinguished_from_what_one_may(
    depth: Any, reason: str | None
) -> None:
    why = why_implausible(frame(depth))
    assert (why is None) == (reason is None)
    assert why is None or why.startswith(str(reason))


@pytest.mark.parametrize(
    ("depth", "words"),
    [
        (ROOM / 1000, "in 3 of 5 frames, half of the depth or more is nearer than 0.1 m"),
        (ROOM * 5, "in 3 of 5 frames, half of the depth or more is farther than the 5 m"),
        (ALMOST_EMPTY, "in 3 of 5 frames, less than 5% of the pixels have depth"),
    ],
)
def test_what_is_odd_about_most_frames_is_reported(depth: Any, words: str) -> None:
    check = DepthCheck(max_depth=5.0)
    for i in range(5):
        check.add(frame(depth if i < 3 else ROOM))
    assert str(check.why_odd()).startswith(words)


def test_of_usual_frames_and_of_a_few_odd_ones_nothing_is_said() -> None:
    check = DepthCheck(max_depth=5.0)
    assert check.why_odd() is None
    for depth in [ROOM] * 5 + [ROOM * 5, ROOM / 1000, ALMOST_EMPTY]:
        check.add(frame(depth))
    assert check.why_odd() is None
