"""Parameters of a node of ROS 2."""

from __future__ import annotations

from typing import Any

import pytest

from hypermap.core.errors import HypermapError
from hypermap.ros.port import Parameter

from .fake_rclpy_node import Graph
from .ros2_fixtures import graph, make_port, port

__all__ = ["graph", "make_port", "port"]

PARAMETERS = (
    Parameter("file", "", "The map."),
    Parameter("height", 0.5, "Height of labels [m].", minimum=0.0, maximum=2.0, changes=True),
    Parameter("opacity", 0.5, "One end is open.", minimum=0.0, changes=True),
    Parameter("count", 3, "How many.", minimum=1, maximum=9, changes=True),
    Parameter("kind", "a", "Which.", choices=("a", "b"), changes=True),
    Parameter("shown", True, "Whether.", changes=True),
    Parameter("classes", (), "Which classes.", changes=True),
    Parameter("tags", ("x",), "Which tags.", changes=True),
)


def test_parameters_are_declared_with_what_they_mean(graph: Graph, port: Any) -> None:
    values = port.parameters(PARAMETERS)
    assert values == {
        "file": "",
        "height": 0.5,
        "opacity": 0.5,
        "count": 3,
        "kind": "a",
        "shown": True,
        "classes": [],
        "tags": ["x"],
    }
    described = graph.node("/hypermap_server")._descriptors
    assert all(described[p.name].description == p.description for p in PARAMETERS)
    assert [p.name for p in PARAMETERS if described[p.name].read_only] == ["file"]
    (height,) = described["height"].floating_point_range
    (count,) = described["count"].integer_range
    assert (height.from_value, height.to_value) == (0.0, 2.0)
    assert (count.from_value, count.to_value) == (1, 9)
    assert described["opacity"].floating_point_range[0].to_value > 1e300
    assert described["kind"].additional_constraints == "one of: a, b"
    assert not described["shown"].integer_range


def test_parameters_come_from_the_command_line(graph: Graph, make_port: Any) -> None:
    given = ("height:=1.5", 'classes:=["desk", "chair"]', "file:=lab.hmap", "kind:=b")
    words = [word for value in given for word in ("-p", value)]
    port = make_port("hypermap_server", "--ros-args", *words)
    values = port.parameters(PARAMETERS)
    assert (values["height"], values["classes"]) == (1.5, ["desk", "chair"])
    assert (values["file"], values["kind"]) == ("lab.hmap", "b")


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("height:=high", "height"),
        ("height:=3.0", "height"),
        ("kind:=c", "kind"),
        ("count:=0", "count"),
    ],
)
def test_wrong_parameters_are_errors(make_port: Any, given: str, name: str) -> None:
    port = make_port("hypermap_server", "--ros-args", "-p", given)
    with pytest.raises(HypermapError, match=f"parameter '{name}'"):
        port.parameters(PARAMETERS)


def test_parameters_change_while_the_node_runs(graph: Graph, port: Any) -> None:
    changes: list[Any] = []
    port.parameters(PARAMETERS, changes.append)
    ours = graph.node("/hypermap_server")
    assert ours.set_parameter("height", 1.0) == ""
    assert ours.set_parameter("classes", ["desk"]) == ""
    assert changes == [{"height": 1.0}, {"classes": ["desk"]}]
    assert "out of range" in ours.set_parameter("height", 3.0)
    assert "Wrong parameter type" in ours.set_parameter("height", "high")
    assert "cannot be 'c'" in ours.set_parameter("kind", "c")
    assert "read-only" in ours.set_parameter("file", "x")
    assert len(changes) == 2


@pytest.mark.parametrize("error", [HypermapError("no such class"), ValueError("a bug")])
def test_the_node_may_refuse_a_change(graph: Graph, port: Any, error: Exception) -> None:
    def refuse(_: Any) -> None:
        raise error

    port.parameters(PARAMETERS, refuse)
    ours = graph.node("/hypermap_server")
    assert str(error) in ours.set_parameter("height", 1.0)
    assert ours.get_parameter("height").value == 0.5


def test_a_node_that_is_configured_again_reads_parameters_again(graph: Graph, port: Any) -> None:
    first: list[Any] = []
    second: list[Any] = []
    port.parameters(PARAMETERS, first.append)
    graph.node("/hypermap_server").set_parameter("height", 1.0)
    assert port.parameters(PARAMETERS, second.append)["height"] == 1.0
    graph.node("/hypermap_server").set_parameter("height", 2.0)
    assert (len(first), len(second)) == (1, 1)


def test_a_misspelled_parameter_is_a_warning(graph: Graph, make_port: Any) -> None:
    given = ("hieght:=1.5", "count:=4", "use_sim_time:=false", "qos_overrides./map.depth:=3")
    words = [word for value in (*given, "autostart:=true") for word in ("-p", value)]
    port = make_port("hypermap_server", "--ros-args", *words)
    assert port.parameters(PARAMETERS)["count"] == 4
    warned = [text for level, text in graph.logged if level == "warning"]
    assert warned == ["ignoring the unknown parameter 'hieght'; did you mean 'height'?"]
    assert port.origins()["count"] == "as an argument or in a file of parameters"
