"""What brings Hypermap to a machine other than by pip: it needs and does the same."""

from __future__ import annotations

import configparser
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import shapely
import yaml

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import save_map

ROOT = Path(__file__).resolve().parents[1]
CONDA_NAMES = {"mapbox-earcut": "mapbox_earcut", "matplotlib": "matplotlib-base"}


def requirements() -> set[str]:
    """Return what the package requires, as conda would write it."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    listed = re.search(r"^dependencies = \[\n(.*?)^\]", text, re.MULTILINE | re.DOTALL)
    assert listed is not None
    found = set()
    for name, version in re.findall(r'"([\w-]+)(>=[\w.]+)"', listed[1]):
        name = name.lower()
        found.add(f"{CONDA_NAMES.get(name, name)} {version}")
    assert "numpy >=1.26" in found
    return found


def test_conda_gets_the_same_requirements_as_pip() -> None:
    environment = yaml.safe_load((ROOT / "packaging/environment.yml").read_text(encoding="utf-8"))
    of_conda_itself = {"python >=3.10", "pip", "setuptools >=77", "nodejs >=20"}
    assert set(environment["dependencies"]) - of_conda_itself == requirements()
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8"))
    assert set(recipe["requirements"]["run"]) - {"python >=3.10"} == requirements()


def test_the_container_of_ros_1_has_debian_packages_that_the_tests_run_with() -> None:
    image = (ROOT / "packaging/Dockerfile").read_text(encoding="utf-8")
    wanted = set(re.findall(r"\bpython3-[\w-]+", image.split("AS ros1")[1].split("AS ros2")[0]))
    tested = set(re.findall(r"\bpython3-[\w-]+", (ROOT / "scripts/ros1.sh").read_text()))
    assert {"python3-rospy"} < wanted <= tested | {"python3-venv"}


def test_the_unit_of_systemd_starts_a_server_and_ends_it_in_order(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    cup = SemanticObject("cup", shapely.box(0, 0, 1, 1))
    save_map(Hypermap([SemanticLayer("objects", "map", [cup])]), tmp_path / "office.hmap")
    unit = configparser.RawConfigParser()
    unit.read(ROOT / "packaging/systemd/hypermap-serve@.service", encoding="utf-8")
    program, *arguments = unit["Service"]["ExecStart"].replace("%i", "office").split()
    assert program == "/opt/hypermap/bin/hypermap"
    assert arguments.pop() == "$HYPERMAP_OPTIONS"
    command = [sys.executable, "-m", "hypermap", *arguments, "--foxglove", "--port", "0"]
    log = tmp_path / "log"
    with log.open("wb") as output:
        server = subprocess.Popen(
            command,
            cwd=tmp_path,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
        )
    end = time.monotonic() + 240
    while "ws://" not in log.read_text():
        assert server.poll() is None, log.read_text()
        assert time.monotonic() < end, log.read_text()
        time.sleep(0.05)
    server.send_signal(signal.Signals[unit["Service"]["KillSignal"]])
    assert server.wait(240) == 0, log.read_text()
