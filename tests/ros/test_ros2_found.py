"""Where the tests look for a real ROS 2."""

from __future__ import annotations

from pathlib import Path

import pytest

from .ros2_real import sourced


def test_the_ros2_of_a_workspace_is_found_by_its_setup(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = tmp_path / "my workspace" / "setup.bash"
    setup.parent.mkdir()
    setup.write_text("export ROS_VERSION=2 AMENT_PREFIX_PATH=/ws/install\n")
    monkeypatch.setenv("HYPERMAP_ROS2", str(setup))
    (found,) = sourced()
    assert found["AMENT_PREFIX_PATH"] == "/ws/install"
