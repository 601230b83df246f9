"""The launch files for ROS 2, as far as they can be read without it.

`ros2 launch` itself runs in test_ros2_real_life.py, where there is one. Source of the rules:
launch_xml, launch_ros (actions/node.py, utilities/evaluate_parameters.py) and launch
(actions/execute_process.py).
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import yaml

from hypermap.formats import open_map
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.parameters import checked
from hypermap.ros.server.map_server import MapServer

PACKAGE = Path(__file__).parents[2] / "ros" / "hypermap"
FILES = sorted((PACKAGE / "launch").glob("*.launch.xml"))
NODES = {"hypermap_server": MapServer, "semantic_mapper": SemanticMapper}
OF_ROS = {"use_sim_time", "autostart"}
ATTRIBUTES = {
    "launch": set(),
    "arg": {"name", "default", "description", "value"},
    "node": {"pkg", "exec", "name", "output", "args", "if"},
    "param": {"name", "value", "from"},
    "remap": {"from", "to"},
    "group": {"if"},
    "include": {"file"},
    "let": {"name", "value", "if"},
    "executable": {"cmd", "output", "on_exit"},
}

files = pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)


def elements(file: Path) -> list[ElementTree.Element]:
    return list(ElementTree.parse(file).getroot().iter())


def declared(file: Path) -> set[str]:
    root = ElementTree.parse(file).getroot()
    return {item.get("name", "") for kind in ("arg", "let") for item in root.findall(kind)}


def test_the_four_tasks_have_a_file() -> None:
    names = {file.name.removesuffix(".launch.xml") for file in FILES}
    assert names == {"show_map", "record_map", "semantic_mapping", "map_bag"}


@files
def test_tags_and_attributes_are_those_of_launch(file: Path) -> None:
    for element in elements(file):
        assert set(element.attrib) <= ATTRIBUTES[element.tag], element.attrib


@files
def test_variables_are_declared_and_used(file: Path) -> None:
    root = ElementTree.parse(file).getroot()
    values = [value for element in root.iter() for value in element.attrib.values()]
    used = {name for value in values for name in re.findall(r"\$\(var (\w+)\)", value)}
    assert used == declared(file)


@files
def test_programs_take_arguments_without_quotes(file: Path) -> None:
    """Launch splits the text between substitutions by itself, and fails on half a quotation."""
    for element in elements(file):
        assert not set("'\"") & set(element.get("args", "") + element.get("cmd", ""))


@files
def test_parameters_exist_and_have_their_type(file: Path) -> None:
    """A text must be quoted: launch_ros reads values as YAML, and refuses an empty one."""
    arguments = ElementTree.parse(file).getroot().findall("arg")
    defaults = {item.get("name", ""): item.get("default", "") for item in arguments}
    for node in (item for item in elements(file) if item.get("pkg") == "hypermap"):
        known = {item.name: item for item in NODES[node.get("exec", "")].PARAMETERS}
        assert node.get("name") == node.get("exec")
        for parameter in node.findall("param"):
            name, value = parameter.get("name"), parameter.get("value", "")
            if name is None or name in OF_ROS:
                continue
            for argument, default in defaults.items():
                value = value.replace(f"$(var {argument})", default)
            checked(known[name], yaml.safe_load(re.sub(r"\$\([^)]*\)", "", value)))


def test_without_the_map_of_another_node_one_is_made_from_depth() -> None:
    """The mapper is given no topic then; the server listens on /map, as it must somewhere."""
    (file,) = (file for file in FILES if file.name.startswith("semantic_mapping"))
    root = ElementTree.parse(file).getroot()
    defaults = {item.get("name"): item.get("default") for item in root.findall("arg")}
    assert defaults["map_topic"] == ""
    (remap,) = root.iter("remap")
    assert remap.attrib == {"from": "/map", "to": "$(var served_map)"}
    for given, served in (("", "/map"), ("/slam/map", "/slam/map")):
        found = ""
        for item in root.findall("let"):
            condition = item.get("if", "").replace("$(var map_topic)", given)
            if not condition or eval(condition.removeprefix('$(eval "').removesuffix('")')):
                found = item.get("value", "").replace("$(var map_topic)", given)
        assert found == served


@files
def test_what_is_included_takes_the_arguments(file: Path) -> None:
    for include in (item for item in elements(file) if item.tag == "include"):
        path = include.get("file", "")
        if "$(find-pkg-share hypermap)" in path:
            other = Path(path.replace("$(find-pkg-share hypermap)", str(PACKAGE)))
            assert {item.get("name") for item in include.findall("arg")} <= declared(other)


@files
def test_nothing_runs_yet_where_rviz_is_missing(file: Path) -> None:
    """`ros2 launch` ends at a package that it does not find, and leaves running what it started."""
    packages = [item.get("pkg") for item in elements(file) if item.tag == "node"]
    assert "rviz2" not in packages[1:]


@files
def test_files_of_the_package_exist(file: Path) -> None:
    text = file.read_text()
    for name in re.findall(r"\$\(find-pkg-share hypermap\)/([\w./]+)", text):
        assert (PACKAGE / name).is_file(), name


def test_the_maps_that_nodes_fill_open() -> None:
    for file in (PACKAGE / "maps").glob("*.yaml"):
        assert all(layer.settings["subscribe_mode"] for layer in open_map(file))


def test_the_file_of_parameters_shows_the_defaults() -> None:
    text = (PACKAGE / "params" / "map_server.yaml").read_text()
    known = {item.name: item for item in MapServer.PARAMETERS}
    values = yaml.safe_load(text)["/**"]["ros__parameters"]
    for name, value in values.items():
        assert checked(known[name], value) == known[name].default
    hidden = re.findall(r"^ +# (\w+): (.*?)(?:  #.*)?$", text, re.MULTILINE)
    assert hidden
    for name, value in hidden:
        checked(known[name], yaml.safe_load(value))


@pytest.mark.parametrize("name", NODES)
def test_scripts_start_the_nodes(name: str) -> None:
    script = PACKAGE / "scripts" / name
    assert os.access(script, os.X_OK)
    assert script.read_text().startswith("#!/usr/bin/env python3\n")
    done = subprocess.run(
        [sys.executable, script, "a.hmap", "b.hmap"], capture_output=True, text=True, timeout=240
    )
    assert done.returncode == 1
    assert re.match(rf"{name}: .*(one map|does not know)", done.stderr), done.stderr


@pytest.mark.parametrize("name", NODES)
def test_ctrl_c_amid_the_imports_shows_no_traceback(name: str, tmp_path: Path) -> None:
    (tmp_path / "hypermap").mkdir()
    (tmp_path / "hypermap" / "__init__.py").write_text("raise KeyboardInterrupt\n")
    done = subprocess.run(
        [sys.executable, PACKAGE / "scripts" / name],
        env={"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert (done.returncode, done.stderr) == (130, "")


def test_both_systems_build_one_package() -> None:
    root = ElementTree.parse(PACKAGE / "package.xml").getroot()
    builds = {item.get("condition"): item.text for item in root.iter("build_type")}
    assert builds == {"$ROS_VERSION == 1": "catkin", "$ROS_VERSION == 2": "ament_cmake"}
    messages = ElementTree.parse(PACKAGE.parent / "hypermap_msgs" / "package.xml").getroot()
    assert root.findtext("version") == messages.findtext("version")


@pytest.mark.parametrize(
    ("version", "system", "suffix"), [(1, "catkin", ".launch"), (2, "ament_cmake", ".launch.xml")]
)
def test_the_package_builds(tmp_path: Path, version: int, system: str, suffix: str) -> None:
    if shutil.which("cmake") is None or not Path("/usr/share", system).is_dir():
        pytest.skip(f"{system} is not here: on Debian 12, the package of that name (with -) has it")
    python = "/usr/bin/python3"
    command = ["cmake", PACKAGE, f"-DPYTHON_EXECUTABLE={python}", f"-DPython3_EXECUTABLE={python}"]
    command += [f"-DCMAKE_INSTALL_PREFIX={tmp_path / 'out'}", f"-DCATKIN_DEVEL_PREFIX={tmp_path}"]
    build = tmp_path / "build"
    build.mkdir()
    environment = {**os.environ, "ROS_VERSION": str(version)}
    for words in (command, ["cmake", "--build", ".", "--target", "install"]):
        done = subprocess.run(
            words, cwd=build, env=environment, capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, done.stdout + done.stderr
    share = tmp_path / "out" / "share" / "hypermap"
    launch = {path.name.removesuffix(suffix) for path in (share / "launch").iterdir()}
    assert launch == {"show_map", "record_map", "semantic_mapping", "map_bag"}
    assert (share / "maps" / "subscribe.yaml").is_file()
    assert (share / "rviz").is_dir()
    programs = tmp_path / "out" / "lib" / "hypermap"
    assert {path.name for path in programs.iterdir()} == {*NODES, "map_server"}
    assert all(os.access(path, os.X_OK) for path in programs.iterdir())
