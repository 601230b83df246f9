"""catkin builds the messages, as programs in C++ and workspaces need them."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from .conftest import NEEDS_ROS1, ROS
from .test_ros1_messages import MESSAGES, SERVICES, tool


@pytest.mark.slow
def test_catkin_builds_the_package(needs_ros1: None, tmp_path: Path) -> None:
    needed = ("/usr/bin/cmake", "/usr/bin/catkin_init_workspace", "/usr/bin/g++")
    if any(shutil.which(tool) is None for tool in needed):
        pytest.skip(NEEDS_ROS1)
    source = tmp_path / "hypermap_msgs"  # catkin builds nothing in a folder with brackets
    shutil.copytree(ROS / "hypermap_msgs", source)
    # What is made for C++ and Python is looked at below; other languages take as long again.
    others = "geneus:genlisp:gennodejs"
    environment = {"PATH": "/usr/bin:/bin", "ROS_VERSION": "1", "ROS_LANG_DISABLE": others}
    options = {
        "CMAKE_INSTALL_PREFIX": tmp_path / "install",
        "CATKIN_DEVEL_PREFIX": tmp_path / "devel",
        "CATKIN_ENABLE_TESTING": "OFF",
        "PYTHON_EXECUTABLE": "/usr/bin/python3",
    }
    words = [f"-D{name}={value}" for name, value in options.items()]
    for command in (
        ["cmake", "-S", str(source), "-B", str(tmp_path / "build"), *words],
        ["cmake", "--build", str(tmp_path / "build"), "--target", "install", "-j2"],
    ):
        run = subprocess.run(command, env=environment, capture_output=True, text=True)
        assert run.returncode == 0, run.stdout + run.stderr
    (python,) = (tmp_path / "install/lib").glob("python3/dist-packages")
    built = {
        path.stem[1:]: re.search(r'_md5sum\s*=\s*"(\w+)"', path.read_text())
        for path in python.glob("hypermap_msgs/msg/_[A-Z]*.py")
    }
    assert {name: match and match[1] for name, match in built.items() if name in MESSAGES} == (
        MESSAGES
    )
    header = tmp_path / "install/include/hypermap_msgs/GetStringsByArea.h"
    assert f'return "{SERVICES["GetStringsByArea"]}"' in header.read_text()
    tools = {"ROS_PACKAGE_PATH": str(tmp_path / "install/share"), "PYTHONPATH": str(python)}
    shown = tool({**environment, **tools}, "rosmsg", "md5", "hypermap_msgs/SemanticMap")
    assert shown.strip() == MESSAGES["SemanticMap"]
