"""Bags of every kind, and a folder of images."""

from __future__ import annotations

from pathlib import Path

import pytest

from .bag_builder import KINDS, BagBuilder
from .shots import SHOTS, write_tum

collect_ignore = ["ros_player.py"]  # a program for ROS's Python, which doctest would import


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def bag(tmp_path: Path, kind: str) -> BagBuilder:
    return BagBuilder(tmp_path, kind)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_tum(tmp_path / "recording", SHOTS)
