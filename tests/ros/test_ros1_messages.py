"""The messages of ROS 1: their md5 sums, and the tools that read them."""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import get_types_from_msg

from hypermap.core.errors import HypermapError
from hypermap.ros.definitions import package_folder

from .conftest import Process

pytestmark = pytest.mark.xdist_group("ros")


def md5(text: str) -> str:
    return hashlib.md5(text.encode()).hexdigest()


# Golden values, by the rule of ROS 1: the md5 sum of the fields, one a line, where the type of a
# field that is itself a message is replaced by that message's md5 sum, without brackets. A service
# is the text of the request followed at once by that of the response.
# Published: the md5 sums of std_msgs and geometry_msgs in ROS Noetic.
HEADER = "2176decaecbce78abc3b96ef049fabed"
POINT = "4a842b65f413084dc2b10fb484ea7f17"
POLYGON = "cd60a26494a087f577976f0329fa120e"
POINT_STAMPED = "c63aecb41bfdfd6b7e1fac37c7cbe7bf"
POLYGON_STAMPED = "c6be8f7dc3bee7fe9e8d296070f53340"

LAYER_META_DATA = md5(
    "string class_name\nstring name\nstring frame_id\nbool subscribe_mode\nbool enable_update\n"
    "bool publish_global_topics"
)
SEMANTIC_OBJECT = md5(
    f"int32 id\n{POLYGON} shape\n{POINT} position\nstring name\nstring[] tags\nfloat64[] confidence"
)
OBJECTS = f"{SEMANTIC_OBJECT} objects"
MESSAGES = {
    "LayerMetaData": LAYER_META_DATA,
    "HypermapMetaData": md5(f"uint32 layer_cnt\nstring node_name\n{LAYER_META_DATA} layers"),
    "SemanticObject": SEMANTIC_OBJECT,
    "SemanticMap": md5(f"{HEADER} header\n{OBJECTS}"),
    "SemanticMapUpdate": md5(
        f"{SEMANTIC_OBJECT} to_add\nuint32[] to_modify\n{SEMANTIC_OBJECT} updates\n"
        "uint32[] to_delete"
    ),
}
SERVICES = {
    "GetStringAtPoint": md5(f"string layer\n{POINT_STAMPED} location" + "string name"),
    "GetIntAtPoint": md5(f"string layer\n{POINT_STAMPED} location" + "int32 value"),
    "GetStringsByArea": md5(
        f"string layer\n{POLYGON_STAMPED} area" + f"string[] names\n{POINT} locations"
    ),
    "GetIntsByArea": md5(
        f"string layer\n{POLYGON_STAMPED} area" + f"int32[] values\n{POINT} locations"
    ),
    "GetLocationsByString": md5(
        f"string layer\nstring name\n{POLYGON_STAMPED} area" + f"{POINT} locations"
    ),
    "GetLocationsByInt": md5(
        f"string layer\nint32 value\n{POLYGON_STAMPED} area" + f"{POINT} locations"
    ),
    "GetSemanticByArea": md5(f"{POLYGON_STAMPED} area" + OBJECTS),
    "GetSemanticByString": md5("string name" + OBJECTS),
    "LoadMap": md5("string filename" + "bool success"),
    "StoreMap": md5("string filename" + "bool success"),
}
# Published: as the packages of ROS Noetic were built.
FOREIGN = {
    "darknet_ros_msgs/BoundingBox": "6b8f03f076d75c692c40b501a56253e0",
    "darknet_ros_msgs/BoundingBoxes": "004f6f4f48a741582d10735997905846",
    "vision_msgs/BoundingBox2D": "9ab41e2a4c8627735e5091a9abd68b02",
    "vision_msgs/ObjectHypothesisWithPose": "fa1ab3bc7146f53921fa142d631d02db",
    "vision_msgs/Detection2D": "9e11092151fa150724a255fbac727f3b",
    "vision_msgs/Detection2DArray": "402071f61477de256df9f1aa45e6e4c8",
    "grid_map_msgs/GridMapInfo": "43ee5430e1c253682111cb6bedac0ef9",
    "grid_map_msgs/GridMap": "95681e052b1f73bf87b7eb984382b401",
    "rtabmap_msgs/MapGraph": "903c2e44ed7e275e08ef323188cb38ee",
    "map_msgs/OccupancyGridUpdate": "b295be292b335c34718bd939deebe1c9",
}


@pytest.mark.parametrize("name", MESSAGES)
def test_a_message_has_the_checksum_that_old_clients_compare(needs_ros1: None, name: str) -> None:
    from hypermap.ros.ros1.messages import message_class

    assert message_class(f"hypermap_msgs/{name}")._md5sum == MESSAGES[name]


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_has_the_checksum_that_old_clients_compare(needs_ros1: None, name: str) -> None:
    from hypermap.ros.ros1.messages import service_class

    assert service_class(f"hypermap_msgs/{name}")._md5sum == SERVICES[name]


@pytest.mark.parametrize("name", FOREIGN)
def test_a_foreign_message_has_the_checksum_of_its_package(needs_ros1: None, name: str) -> None:
    from hypermap.ros.ros1.messages import message_class

    assert message_class(name)._md5sum == FOREIGN[name]


def test_what_we_know_of_a_foreign_package_is_what_that_package_says(
    needs_ros1: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Generated and installed map_msgs agree; Debian has no others to compare."""
    from hypermap.ros.ros1.generation import generate
    from hypermap.ros.ros1.messages import message_class

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    text = (generate("map_msgs") / "python/map_msgs/msg/_OccupancyGridUpdate.py").read_text()
    installed = message_class("map_msgs/OccupancyGridUpdate")
    assert "/.cache/" not in str(sys.modules[installed.__module__].__file__)
    assert f'_md5sum = "{installed._md5sum}"' in text


def test_a_type_that_nobody_knows_is_an_error(needs_ros1: None) -> None:
    from hypermap.ros.ros1.messages import message_class, service_class

    with pytest.raises(HypermapError, match=r"my_msgs/Thing is missing.*python3-my-msgs"):
        message_class("my_msgs/Thing")
    with pytest.raises(HypermapError, match="hypermap_msgs/GetNothing is missing"):
        service_class("hypermap_msgs/GetNothing")


def test_a_cache_that_cannot_be_written_is_an_error(
    needs_ros1: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from hypermap.ros.ros1.generation import generate

    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(HypermapError, match=r"cannot be generated.*XDG_CACHE_HOME"):
        generate("hypermap_msgs")


def test_a_node_needs_no_cache(
    needs_ros1: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import hypermap.ros.ros1.libraries  # noqa: F401 - which finds genpy
    from hypermap.ros.ros1.generation import generate_for_now

    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))  # as in a read-only home
    folder = generate_for_now("hypermap_msgs")
    text = (folder / "python/hypermap_msgs/msg/_SemanticMap.py").read_text("utf-8")
    assert MESSAGES["SemanticMap"] in text
    shutil.rmtree(folder)


def test_two_nodes_may_generate_at_once(needs_ros1: None, tmp_path: Path) -> None:
    code = "from hypermap.ros.ros1.messages import message_class as m; import hypermap.ros.{}"
    code = code.format("ros1.libraries; print(m('hypermap_msgs/SemanticMap')._md5sum)")
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    nodes = [
        subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE)
        for _ in range(2)
    ]
    answers = {node.communicate(timeout=240)[0].decode().strip() for node in nodes}
    assert answers == {MESSAGES["SemanticMap"]}
    assert len(list((tmp_path / "hypermap/ros1").iterdir())) == 1


def test_an_old_installed_package_is_used_and_completed(needs_ros1: None, tmp_path: Path) -> None:
    """A workspace from before has hypermap_msgs without the types that are new."""
    from hypermap.ros.ros1.generation import generate

    shutil.copytree(generate("hypermap_msgs") / "python", tmp_path / "old")
    for kind, kept in (("msg", {*MESSAGES}), ("srv", {*SERVICES})):
        folder = tmp_path / "old/hypermap_msgs" / kind
        for file in folder.glob("_[A-Z]*.py"):
            if file.stem[1:] not in kept:
                file.unlink()
        lines = [f"from ._{name} import *\n" for name in sorted(kept)]
        (folder / "__init__.py").write_text("".join(lines))
    code = """
import io, hypermap.ros.ros1.libraries
from hypermap.ros.ros1.messages import environment, message_class, service_class
kind = message_class("hypermap_msgs/ObjectState")
message = kind(object=message_class("hypermap_msgs/SemanticObject")(name="chair"))
message.parts = [message_class("hypermap_msgs/PolygonWithHoles")()]
buffer = io.BytesIO()
message.serialize(buffer)
print(kind().deserialize(buffer.getvalue()).object.name, service_class("hypermap_msgs/LoadMap"))
import hypermap_msgs, hypermap_msgs.msg
print(hypermap_msgs.__file__)
print(len(environment()))
"""
    run = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(tmp_path / "old")},
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert run.returncode == 0, run.stderr
    assert "chair" in run.stdout
    assert str(tmp_path / "old") in run.stdout
    assert run.stdout.splitlines()[-1] == "2"


# The tools of ROS 1, with what `hypermap ros1-env` prints.


@pytest.fixture(scope="module")
def tools_environment(needs_ros1: None) -> dict[str, str]:
    """The environment after `eval "$(hypermap ros1-env)"`."""
    script = f'eval "$({shlex.quote(sys.executable)} -m hypermap ros1-env)" && env -0'
    clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "ROS_PACKAGE_PATH")}
    run = subprocess.run(["sh", "-c", script], env=clean, capture_output=True, check=True)
    pairs = (pair.split("=", 1) for pair in run.stdout.decode().split("\0") if "=" in pair)
    return dict(pairs)  # type: ignore[arg-type]


def tool(environment: dict[str, str], *words: str) -> str:
    run = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=240)
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_rosmsg_and_rossrv_know_our_types(tools_environment: dict[str, str]) -> None:
    shown = tool(tools_environment, "rosmsg", "show", "hypermap_msgs/SemanticMap")
    assert "hypermap_msgs/SemanticObject[] objects\n  int32 id" in shown
    listed = tool(tools_environment, "rosmsg", "package", "hypermap_msgs").split()
    files = sorted(file.stem for file in package_folder().glob("msg/*.msg"))
    assert sorted(listed) == [f"hypermap_msgs/{name}" for name in files]
    shown = tool(tools_environment, "rossrv", "show", "hypermap_msgs/LoadMap")
    assert shown.split() == ["string", "filename", "---", "bool", "success"]
    found = tool(tools_environment, "rossrv", "md5", "hypermap_msgs/GetStringsByArea")
    assert SERVICES["GetStringsByArea"] in found


def test_rosservice_and_rostopic_speak_our_types(
    roscore: str, port: Any, tools_environment: dict[str, str], start: Callable[..., Process]
) -> None:
    environment = {**tools_environment, "ROS_MASTER_URI": roscore}
    answer = port.response("hypermap_msgs/GetStringAtPoint")
    service = port.service(
        "get_string",
        "hypermap_msgs/GetStringAtPoint",
        lambda request: answer(name=f"{request.layer} at {request.location.point.x}"),
        lambda text: answer(name=text),
    )
    arguments = "{layer: rooms, location: {point: {x: 2.5}}}"
    name = f"{port.node_name}/get_string"
    assert tool(environment, "rosservice", "call", name, arguments).strip() == (
        'name: "rooms at 2.5"'
    )
    service.close()
    kind = port.message("hypermap_msgs/SemanticMap")
    publisher = port.publisher("semmap", "hypermap_msgs/SemanticMap", latched=True)
    chair = port.message("hypermap_msgs/SemanticObject")(id=3, name="chair")
    publisher.publish(kind(objects=[chair]))
    echo = start("rostopic", "echo", "-n1", f"{port.node_name}/semmap", env=environment)
    echo.expect('name: "chair"')
    publisher.close()


# The same definitions for ROS 2.


def test_the_definitions_are_those_of_ros_2_as_well() -> None:
    """rosbags reads them by the rules of ROS 2; names and order of the fields are as written."""
    for file in sorted(package_folder().glob("*/*.*")):
        halves = re.split(r"^---$", file.read_text(), flags=re.MULTILINE)
        assert len(halves) == (2 if file.suffix == ".srv" else 1)
        for half in halves:
            name = f"hypermap_msgs/msg/{file.stem}"
            _, fields = get_types_from_msg(half, name)[name]
            lines = [line.split("#")[0].split() for line in half.splitlines()]
            assert [field for field, _ in fields] == [words[1] for words in lines if words]
