"""Checks the values that an operator gives for a node's parameters, at startup and later."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.ros.port import Parameter, Value

_log = logging.getLogger(__name__)
_KINDS = {"bool": "true or false", "str": "a text", "int": "a whole number", "float": "a number"}


def checked(parameter: Parameter, value: Any) -> Value:
    """Return a value as the parameter's type.

    Raises:
        HypermapError: If it is of a different type, or not allowed.

    >>> checked(Parameter("label_height", 0.5, "Height of labels [m].", minimum=0.0), 1)
    1.0
    """
    default = parameter.default
    if isinstance(default, (list, tuple)):
        if not isinstance(value, (list, tuple)) or not all(isinstance(item, str) for item in value):
            hint = "; <rosparam> makes lists" if isinstance(value, str) else ""
            raise HypermapError(
                f"parameter {parameter.name!r} must be a list of texts, got {value!r}{hint}"
            )
        for item in value:
            _check_choice(parameter, item)
        return list(value)
    if isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not type(default) or (isinstance(value, float) and math.isnan(value)):
        kind = _KINDS[type(default).__name__]
        raise HypermapError(f"parameter {parameter.name!r} must be {kind}, got {value!r}")
    if isinstance(value, str):
        _check_choice(parameter, value)
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        _check_range(parameter, value)
    known: Value = value
    return known


def _check_choice(parameter: Parameter, value: str) -> None:
    if parameter.choices and value not in parameter.choices:
        hint = did_you_mean(value, parameter.choices)
        raise HypermapError(f"parameter {parameter.name!r} cannot be {value!r}; {hint}")


def _check_range(parameter: Parameter, value: float) -> None:
    low, high = parameter.minimum, parameter.maximum
    if low is not None and value < low:
        raise HypermapError(f"parameter {parameter.name!r} must be at least {low}, got {value}")
    if high is not None and value > high:
        raise HypermapError(f"parameter {parameter.name!r} must be at most {high}, got {value}")


def check_names(names: Iterable[str], parameters: Iterable[Parameter]) -> None:
    """Return if a node has parameters of these names.

    Raises:
        HypermapError: If it has not; the error names the nearest.

    >>> check_names(["keepout"], [Parameter("keepout", (), "Zones.")])
    """
    known = [parameter.name for parameter in parameters]
    for name in names:
        if name not in known:
            raise HypermapError(f"there is no parameter {name!r}; {did_you_mean(name, known)}")


class ParameterSet:
    """The parameters of a node with their values, and what its operator has given of them.

    Args:
        parameters: all of the node.
        given: what the operator has given, as the middleware read it; other names are logged, each
            once, and ignored.
        on_change: called with the new values of those that changed while the node runs.

    Attributes:
        values: the value of each parameter.
        given: those that the operator has given, as given, and that hold for more than one run.

    Raises:
        HypermapError: If a value is of a different type, or not allowed.
    """

    def __init__(
        self,
        parameters: Sequence[Parameter],
        given: Mapping[str, Any],
        on_change: Callable[[Mapping[str, Value]], None] | None = None,
    ) -> None:
        self._parameters = {parameter.name: parameter for parameter in parameters}
        self._on_change = on_change
        self._seen = {name: given[name] for name in self._parameters if name in given}
        self.given = {name: self._seen[name] for name in self._seen if not self.is_once(name)}
        self._unknown: set[str] = set()
        self._complain(given)
        self.values = {
            name: checked(parameter, given.get(name, parameter.default))
            for name, parameter in self._parameters.items()
        }

    def is_once(self, name: str) -> bool:
        """Return whether a parameter's value holds for one run alone."""
        return name in self._parameters and self._parameters[name].once

    def update(self, given: Mapping[str, Any]) -> None:
        """Take what is given now; a wrong value is logged and the old one stays.

        A parameter that is no longer given keeps its value.
        """
        self._complain(given)
        changed: dict[str, Value] = {}
        for name, parameter in self._parameters.items():
            if name not in given or (name in self._seen and self._seen[name] == given[name]):
                continue
            self._seen[name] = given[name]
            try:
                value = checked(parameter, given[name])
            except HypermapError as error:
                _log.error("%s; it stays at %r", error, self.values[name])
                continue
            self.given[name] = given[name]
            if value == self.values[name]:
                continue
            if not parameter.changes:
                _log.warning("parameter %r takes effect when the node restarts", name)
                continue
            changed[name] = value
        self.values.update(changed)
        if changed and self._on_change is not None:
            self._on_change(changed)

    def _complain(self, given: Mapping[str, Any]) -> None:
        """Log the names that are not parameters of the node, each once."""
        if not self._parameters:  # they are not declared yet
            return
        for name in sorted(given.keys() - self._parameters.keys() - self._unknown):
            if isinstance(given[name], Mapping):  # a namespace, perhaps of another node
                continue
            self._unknown.add(name)
            _log.warning(
                "ignoring the unknown parameter %r; %s", name, did_you_mean(name, self._parameters)
            )
