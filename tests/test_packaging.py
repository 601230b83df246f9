"""What brings Hypermap to a machine other than by pip: it needs and does the same."""

from __future__ import annotations

import configparser
import os
import re
import shutil
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
needs_git = pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
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


def build_requirements() -> set[str]:
    """Return what building the package requires, as conda would write it."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    listed = re.search(r"^requires = \[(.+)\]$", text, re.MULTILINE)
    assert listed is not None
    return {f"{name} {version}" for name, version in re.findall(r'"([\w-]+)(>=[\w.]+)"', listed[1])}


def test_conda_gets_the_same_requirements_as_pip() -> None:
    environment = yaml.safe_load((ROOT / "packaging/environment.yml").read_text(encoding="utf-8"))
    of_conda_itself = {"python >=3.10", "pip", *build_requirements(), "nodejs >=20"}
    assert set(environment["dependencies"]) - of_conda_itself == requirements()
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8"))
    assert set(recipe["requirements"]["run"]) - {"python >=3.10"} == requirements()
    assert set(recipe["requirements"]["host"]) - {"python >=3.10", "pip"} == build_requirements()


def test_conda_starts_the_command_as_pip_does() -> None:
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8"))
    (of_conda,) = recipe["build"]["python"]["entry_points"]
    name, function = of_conda.split(" = ")
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert f'[project.scripts]\n{name} = "{function}"\n' in text


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A git repository of one commit, with our build settings and no tag."""
    folder = tmp_path / "checkout"
    folder.mkdir()
    shutil.copy(ROOT / "pyproject.toml", folder)
    git(folder, "init", "--quiet")
    commit(folder, "A first commit")
    return folder


def fallback() -> str:
    """Return the version whose development builds have no tag."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    stated = re.search(r'^fallback_version = "(\d+\.\d+\.\d+)\.dev0"$', text, re.MULTILINE)
    assert stated is not None
    return stated[1]


def git(folder: Path, *arguments: str) -> None:
    subprocess.run(["git", "-C", str(folder), *arguments], check=True, capture_output=True)


def commit(folder: Path, message: str) -> None:
    git(folder, "add", ".")
    settings = ("user.name=test", "user.email=test@example.com", "commit.gpgsign=false")
    given = [word for setting in settings for word in ("-c", setting)]
    git(folder, *given, "commit", "--quiet", "--allow-empty", "--message", message)


def version_of(folder: Path, **environment: str) -> str:
    """Return the version that a build in this folder would have."""
    done = subprocess.run(
        [sys.executable, "-m", "setuptools_scm"],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


@needs_git
def test_the_version_is_that_of_the_tag_and_counts_the_commits_after_it(checkout: Path) -> None:
    assert version_of(checkout) == f"{fallback()}.dev1"
    git(checkout, "tag", "v1.2.3")
    assert version_of(checkout) == "1.2.3"
    commit(checkout, "A second commit")
    assert version_of(checkout) == "1.2.4.dev1"


@needs_git
def test_a_copy_without_a_history_has_a_version(checkout: Path, tmp_path: Path) -> None:
    git(checkout, "tag", "v1.2.3")
    commit(checkout, "A second commit")
    shallow = tmp_path / "shallow"
    git(tmp_path, "clone", "--quiet", "--depth", "1", checkout.as_uri(), str(shallow))
    assert version_of(shallow) == f"{fallback()}.dev1"
    shutil.rmtree(shallow / ".git")
    assert version_of(shallow) == f"{fallback()}.dev0"
    assert version_of(checkout, PATH=str(tmp_path)) == f"{fallback()}.dev0"  # where git is missing


def test_a_copy_that_was_never_installed_says_that_its_version_is_unknown(tmp_path: Path) -> None:
    shutil.copytree(
        ROOT / "src" / "hypermap",
        tmp_path / "hypermap",
        ignore=shutil.ignore_patterns("__pycache__", "_built_version.py", "viewer", "simulation"),
    )
    asked = "import sys; sys.path.append(sys.argv[1]); import hypermap; print(hypermap.__version__)"
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", asked, str(tmp_path)],  # without installed packages
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("0+unknown\n", "")


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
    if unit["Service"].getboolean("PrivateTmp"):  # which goes with the service
        assert "TMPDIR=/run/hypermap" in unit["Service"]["Environment"].split()
        assert unit["Service"]["RuntimeDirectory"] == "hypermap"
        assert unit["Service"].getboolean("RuntimeDirectoryPreserve")
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
    server.send_signal(signal.Signals[unit["Service"].get("KillSignal", "SIGTERM")])
    assert server.wait(240) == 0, log.read_text()
