"""Parameters of a ROS 2 node: declared with descriptions and ranges, changed while it runs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.ros.parameters import checked
from hypermap.ros.port import Level, Parameter, Value

_OF_RCLPY = ("use_sim_time", "qos_overrides.", "start_type_description_service")
_INT64 = 2**63 - 1


def declared(node: Any, parameter: Parameter) -> Value:
    """Declare a parameter, if it is not yet, and return its value.

    Raises:
        HypermapError: If the value is of a different type, or not allowed.
    """
    default = parameter.default
    if isinstance(default, Sequence) and not isinstance(default, str):
        default = list(default)
    try:
        if not node.has_parameter(parameter.name):
            node.declare_parameter(parameter.name, default, descriptor(parameter))
        value = node.get_parameter(parameter.name).value
    except ParameterException as error:
        raise HypermapError(f"parameter {parameter.name!r}: {error}") from None
    return checked(parameter, value)


def descriptor(parameter: Parameter) -> Any:
    """Return the `rcl_interfaces/ParameterDescriptor` of a parameter."""
    default = parameter.default
    found = ParameterDescriptor(
        description=parameter.description,
        read_only=not parameter.changes,
        # rclpy takes an empty list for a list of bytes, so the type is left open.
        dynamic_typing=not isinstance(default, (bool, int, float, str)) and len(default) == 0,
    )
    if parameter.choices:
        found.additional_constraints = "one of: " + ", ".join(parameter.choices)
    low, high = parameter.minimum, parameter.maximum
    if isinstance(default, bool) or (low is None and high is None):
        return found
    if isinstance(default, float):
        limit = sys.float_info.max
        found.floating_point_range = [
            FloatingPointRange(
                from_value=-limit if low is None else float(low),
                to_value=limit if high is None else float(high),
            )
        ]
    elif isinstance(default, int):
        found.integer_range = [
            IntegerRange(
                from_value=-_INT64 if low is None else int(low),
                to_value=_INT64 if high is None else int(high),
            )
        ]
    return found


def overrides(node: Any) -> Mapping[str, Any]:
    """Return what its operator has given a node, known or not; rclpy keeps it to itself."""
    given: Mapping[str, Any] = getattr(node, "_parameter_overrides", {})
    return given


def warn_of_others(
    node: Any, parameters: Sequence[Parameter], log: Callable[[Level, str], None]
) -> None:
    """Log the names that were given to a node, but that neither it nor rclpy knows."""
    for name in sorted(overrides(node)):
        is_known = node.has_parameter(name) or name.startswith(_OF_RCLPY)
        if not is_known and name not in {parameter.name for parameter in parameters}:
            hint = did_you_mean(name, [parameter.name for parameter in parameters])
            log("warning", f"ignoring the unknown parameter {name!r}; {hint}")


class Changes:
    """Hands new values of parameters to the node while it runs, if they are allowed.

    Args:
        parameters: the node's; others do not concern it.
        on_change: takes the new values; an error that it raises refuses them.
        log_bug: logs the current exception.
    """

    def __init__(
        self,
        parameters: Sequence[Parameter],
        on_change: Callable[[Mapping[str, Value]], None],
        log_bug: Callable[[str], None],
    ) -> None:
        self._parameters = {parameter.name: parameter for parameter in parameters}
        self._on_change = on_change
        self._log_bug = log_bug

    def __call__(self, news: Sequence[Any]) -> Any:
        """Return the `rcl_interfaces/SetParametersResult`."""
        try:
            values = {
                new.name: checked(self._parameters[new.name], new.value)
                for new in news
                if new.name in self._parameters
            }
            if values:
                self._on_change(values)
        except HypermapError as error:
            return SetParametersResult(successful=False, reason=str(error))
        except Exception as error:
            self._log_bug("a change of parameters")
            return SetParametersResult(successful=False, reason=repr(error))
        return SetParametersResult(successful=True)
