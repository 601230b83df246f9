"""Whether the value that an operator has given fits a parameter."""

from __future__ import annotations

from typing import Any

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.ros.port import Parameter, Value


def checked(parameter: Parameter, value: Any) -> Value:
    """Return a value as the parameter's type.

    Raises:
        HypermapError: If it is of another type, or not allowed.

    >>> checked(Parameter("label_height", 0.5, "Height of labels [m].", minimum=0.0), 1)
    1.0
    """
    default = parameter.default
    if isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    is_list = isinstance(default, (list, tuple))
    fits = isinstance(value, (list, tuple)) if is_list else type(value) is type(default)
    if not fits:
        kind = (
            "a list"
            if is_list
            else {"bool": "true or false", "str": "a text"}.get(type(default).__name__, "a number")
        )
        raise HypermapError(f"parameter {parameter.name!r} must be {kind}, got {value!r}")
    if parameter.choices and value not in parameter.choices:
        hint = did_you_mean(str(value), parameter.choices)
        raise HypermapError(f"parameter {parameter.name!r} cannot be {value!r}; {hint}")
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        low, high = parameter.minimum, parameter.maximum
        if not (low is None or value >= low) or not (high is None or value <= high):
            raise HypermapError(
                f"parameter {parameter.name!r} must lie in {low} .. {high}, got {value}"
            )
    return list(value) if is_list else value  # type: ignore[no-any-return]
