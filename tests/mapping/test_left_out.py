from __future__ import annotations

import logging

import pytest

from hypermap.mapping.left_out import LeftOutFrames


def test_each_kind_of_reason_is_warned_of_once_and_the_others_are_counted(
    caplog: pytest.LogCaptureFixture,
) -> None:
    left_out = LeftOutFrames()
    assert left_out.first_reason == ""
    with caplog.at_level(logging.INFO):
        for stamp in range(3):
            left_out.add(float(stamp), f"depth/{stamp}.png: the picture is damaged")
        left_out.add(3.0, "its pose is not finite")
        left_out.log_rest()
    warned = [one.getMessage() for one in caplog.records if one.levelno == logging.WARNING]
    assert warned == [
        "frame 0.000000 left out: depth/0.png: the picture is damaged",
        "frame 3.000000 left out: its pose is not finite",
        "left out for the same reasons: 2 frames more (-v lists them)",
    ]
    assert left_out.first_reason == "depth/0.png: the picture is damaged"


def test_nothing_is_said_of_the_rest_if_there_is_none(caplog: pytest.LogCaptureFixture) -> None:
    left_out = LeftOutFrames()
    left_out.add(0.0, "its pose is not finite")
    caplog.clear()
    left_out.log_rest()
    assert not caplog.records
