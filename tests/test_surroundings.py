"""No test sees what another left behind, nor what a fixture that many share did."""

from __future__ import annotations

import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

_CRASHING = """
import os, pytest

@pytest.mark.parametrize("number", range(40))
def test_that_passes(number):
    pass

@pytest.mark.xdist_group("crash")
@pytest.mark.parametrize("number", range(6))
def test_in_a_group(number):
    if number in (2, 4):
        os.abort()

def test_alone():
    os.abort()
"""


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


def test_a_run_in_which_workers_crash_runs_each_other_test_once(
    tmp_path: Path, pytestconfig: pytest.Config
) -> None:
    shutil.copy(pytestconfig.rootpath / "conftest.py", tmp_path)
    (tmp_path / "test_crashing.py").write_text(_CRASHING)
    options = "-n2 --dist=loadgroup --capture=no -p xdist.plugin -p no:faulthandler"
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", *options.split()],
        cwd=tmp_path,
        env=os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert "3 failed, 44 passed" in ran.stdout, ran.stdout + ran.stderr
    assert ran.returncode == pytest.ExitCode.TESTS_FAILED
