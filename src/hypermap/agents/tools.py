"""A tool: a function with a name, a description and a JSON Schema of its arguments."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias

from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic_core import ArgsKwargs, PydanticCustomError

from hypermap.core.errors import HypermapError, did_you_mean

MOST_BYTES = 24_000
"""The largest answer, as JSON."""

_LONGEST_TEXT = 500  # characters of a text in an answer
_MOST_PROBLEMS = 5  # with arguments, that an error lists
_MESSAGES = {
    "missing_keyword_only_argument": "is required, but missing",
    "unexpected_keyword_argument": "there is no such argument; ",
}
"""What is clearer than pydantic's own words, by its types of errors."""


@dataclass(frozen=True)
class Picture:
    """A picture as an answer.

    Attributes:
        content: the file.
        caption: what it shows.
        media_type: of the file.
    """

    content: bytes
    caption: str
    media_type: Literal["image/png", "image/jpeg"] = "image/png"


ToolFunction: TypeAlias = Callable[..., dict[str, Any] | Picture]


@dataclass(frozen=True)
class Tool:
    """A function that an agent may call.

    Attributes:
        function: with keyword arguments alone, whose docstring describes it.
        is_edit: whether it changes the map.
    """

    function: ToolFunction
    is_edit: bool = False

    @property
    def name(self) -> str:
        """What it is called."""
        return self.function.__name__

    @property
    def description(self) -> str:
        """What it does."""
        return inspect.cleandoc(self.function.__doc__ or "")

    @cached_property
    def parameters(self) -> dict[str, Any]:
        """The JSON Schema of its arguments: an object."""
        return self._adapter.json_schema()

    def __call__(self, arguments: Mapping[str, Any] | None = None) -> dict[str, Any] | Picture:
        """Return its answer: JSON values of at most `MOST_BYTES`, or a picture.

        Args:
            arguments: by name; checked against the schema.

        Raises:
            HypermapError: If an argument is wrong, or the map has no answer.
        """
        given = {str(name): value for name, value in (arguments or {}).items()}
        try:
            answer = self._adapter.validate_python(ArgsKwargs((), given))
        except ValidationError as error:
            problems = _problems(error, self.parameters["properties"])
            raise HypermapError(f"{self.name}: {problems}") from None
        return answer if isinstance(answer, Picture) else bounded(answer)

    @cached_property
    def _adapter(self) -> TypeAdapter[Any]:
        function: Any = self.function
        return TypeAdapter(function, config=ConfigDict(extra="forbid"))


def as_point(value: Any, check: Callable[[Any], tuple[float, float]]) -> tuple[float, float]:
    """Return x and y, as pydantic checks them; what is wrong is told with a right one."""
    try:
        return check(value)
    except ValidationError:
        raise PydanticCustomError(
            "point", "expected a point [x, y] of two finite numbers, such as [1.5, -2.0]"
        ) from None


def bounded(answer: dict[str, Any], most_bytes: int = MOST_BYTES) -> dict[str, Any]:
    """Return an answer with texts cut, and its longest lists shortened until it is small enough.

    What was left out is counted under "left_out", by the name of the list.

    >>> bounded({"names": ["cup"] * 1000}, most_bytes=400)["left_out"]
    {'names': 969}
    """
    answer = {key: _cut(value) for key, value in answer.items()}
    left_out: dict[str, int] = {}
    while len(json.dumps(answer | {"left_out": left_out})) > most_bytes:
        lists = {key: value for key, value in answer.items() if isinstance(value, list)}
        longest = max(lists, key=lambda key: len(json.dumps(lists[key])), default=None)
        if longest is None or not lists[longest]:
            raise HypermapError("the answer is too large; ask for fewer results")
        kept = len(lists[longest]) // 2
        left_out[longest] = left_out.get(longest, 0) + len(lists[longest]) - kept
        answer[longest] = lists[longest][:kept]
    return answer | ({"left_out": left_out} if left_out else {})


def _cut(value: Any) -> Any:
    if isinstance(value, str):
        return value if len(value) <= _LONGEST_TEXT else value[: _LONGEST_TEXT - 3] + "..."
    if isinstance(value, dict):
        return {_cut(key): _cut(one) for key, one in value.items()}
    return [_cut(one) for one in value] if isinstance(value, list | tuple) else value


def _problems(error: ValidationError, arguments: Iterable[str]) -> str:
    """Return what is wrong with a call, in a line that lets a model mend it."""
    found = error.errors(include_url=False, include_input=False, include_context=False)
    shown = []
    for one in found[:_MOST_PROBLEMS]:
        place = ".".join(map(str, one["loc"])) or "arguments"
        message = _MESSAGES.get(one["type"], one["msg"])
        if one["type"] == "unexpected_keyword_argument":
            message += did_you_mean(place, arguments)
        shown.append(f"{place}: {message}"[:200])
    more = len(found) - len(shown)
    return "; ".join(shown) + (f"; and {more} more" if more else "")
