"""No test sees what another left behind, nor what a fixture that many share did."""

from __future__ import annotations

import logging

import pytest


@pytest.fixture(scope="module")
def level_when_silenced() -> int:
    logging.getLogger("hypermap").setLevel(logging.CRITICAL)
    return logging.getLogger("hypermap").level


def test_a_fixture_of_a_module_silences_no_test(
    level_when_silenced: int, caplog: pytest.LogCaptureFixture
) -> None:
    assert level_when_silenced == logging.CRITICAL
    logging.getLogger("hypermap").warning("heard")
    assert "heard" in caplog.text


def test_the_ros2_that_a_user_names_is_kept(pytestconfig: pytest.Config) -> None:
    plugins = pytestconfig.pluginmanager.get_plugins()
    kept = next(plugin.KEPT for plugin in plugins if hasattr(plugin, "KEPT"))
    assert "HYPERMAP_ROS2" in kept
