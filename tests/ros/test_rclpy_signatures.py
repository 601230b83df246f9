"""What the fake of rclpy accepts, rclpy accepts; and the port uses nothing beyond the fake."""

from __future__ import annotations

import inspect
from typing import Any

import pytest

from . import fake_rclpy_node, fake_rclpy_values
from .fake_rclpy import modules
from .fake_rclpy_node import Graph
from .rclpy_signatures import OTHERS, SIGNATURES
from .strict_messages import StrictTypes, jazzy_store


@pytest.fixture(scope="module")
def fake() -> dict[str, Any]:
    return modules(Graph(StrictTypes(jazzy_store())))


def found(fake: dict[str, Any], name: str) -> Any:
    module, rest = name, []
    while module not in fake:
        module, _, last = module.rpartition(".")
        rest.insert(0, last)
    thing = fake[module]
    for part in rest:
        thing = getattr(thing, part)
    return thing


def parameters_of(text: str) -> list[inspect.Parameter]:
    made = eval(f"lambda {text[1:-1]}: None")
    return list(inspect.signature(made).parameters.values())


def assert_accepts_no_more(thing: Any, text: str) -> None:
    """Every call that the fake takes must be one that the real function takes."""
    real = {parameter.name: parameter for parameter in parameters_of(text)}
    ours = list(inspect.signature(thing).parameters.values())
    positional = [p.name for p in real.values() if p.kind == p.POSITIONAL_OR_KEYWORD]
    assert [p.name for p in ours if p.kind == p.POSITIONAL_OR_KEYWORD] == positional[
        : sum(p.kind == p.POSITIONAL_OR_KEYWORD for p in ours)
    ]
    for parameter in ours:
        assert parameter.name in real, f"rclpy has no {parameter.name!r}"
        other = real[parameter.name]
        assert parameter.kind == other.kind
        assert (parameter.default is parameter.empty) == (other.default is other.empty)
        if other.default is not ... and parameter.default is not parameter.empty:
            assert parameter.default == other.default
    missing = real.keys() - {parameter.name for parameter in ours}
    assert all(real[name].default is not inspect.Parameter.empty for name in missing)


@pytest.mark.parametrize("name", SIGNATURES)
def test_a_call_of_the_fake_is_a_call_of_rclpy(fake: dict[str, Any], name: str) -> None:
    assert_accepts_no_more(found(fake, name), SIGNATURES[name][0])


@pytest.mark.parametrize("name", OTHERS)
def test_a_call_of_what_rclpy_returns_is_one_of_rclpy(name: str) -> None:
    owner, _, method = name.partition(".")
    module = fake_rclpy_node if hasattr(fake_rclpy_node, owner) else fake_rclpy_values
    assert_accepts_no_more(getattr(getattr(module, owner), method), OTHERS[name][0])


def test_every_public_function_of_the_fake_is_in_the_table(fake: dict[str, Any]) -> None:
    helpers = {"needs_executor", "resolved", "set_parameter", "change_state"}
    public = []
    for module in ("rclpy", "rclpy.node", "rclpy.lifecycle", "rclpy.executors", "tf2_ros"):
        for name, thing in vars(fake[module]).items():
            if name.startswith("__") or (isinstance(thing, type) and issubclass(thing, Exception)):
                continue
            public.append(f"{module}.{name}")
            base = fake["rclpy.node"].Node if name == "LifecycleNode" else object
            public += [
                f"{module}.{name}.{member}"
                for member in (dir(thing) if isinstance(thing, type) else ())
                if not member.startswith("_")
                and callable(getattr(thing, member))
                and not hasattr(base, member)
            ]
    unknown = {
        name
        for name in public
        if name not in SIGNATURES
        and name.rpartition(".")[2] not in helpers
        and "TransitionCallbackReturn" not in name
    }
    assert unknown == set()


def test_the_strict_check_of_signatures_can_fail(fake: dict[str, Any]) -> None:
    def create_timer(self: Any, period: float, callback: Any) -> None: ...

    with pytest.raises(AssertionError):
        assert_accepts_no_more(create_timer, SIGNATURES["rclpy.node.Node.create_timer"][0])
