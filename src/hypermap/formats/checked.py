"""Validates the contents of files with pydantic: a valid model, or one clear error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from hypermap.core.errors import FormatError
from hypermap.formats.limits import MAX_PLACE

Text = Annotated[str, Field(min_length=1)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
_Placed = Annotated[Finite, Field(ge=-MAX_PLACE, le=MAX_PLACE)]
Pose = tuple[_Placed, _Placed, Finite]
"""x, y, yaw [m, m, rad]."""


class Checked(BaseModel):
    """A part of a file; keys that it does not name are left to the caller."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    @classmethod
    def known_keys(cls) -> frozenset[str]:
        """Return the keys that the file's format defines for this part."""
        return frozenset(field.alias or name for name, field in cls.model_fields.items())


Model = TypeVar("Model", bound=Checked)


def check(model: type[Model], raw: Any, path: str | None, place: str = "") -> Model:
    """Return a part of a file as its model.

    Args:
        model: what the part must hold.
        raw: the part, as parsed.
        path: how messages name the file.
        place: where in the file the part lies, as "layers[1]".

    Raises:
        FormatError: Naming the place of the first wrong or missing value.
    """
    if not isinstance(raw, Mapping):
        raise FormatError(
            f"expected keys and values, found {found(raw)}", path=path, key=place or None
        )
    try:
        return model.model_validate({k: v for k, v in raw.items() if isinstance(k, str)})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = place_of((place, *first["loc"]) if place else first["loc"])
        raise FormatError(_explain(dict(first)), path=path, key=key or None) from None


def place_of(keys: tuple[int | str, ...]) -> str:
    """Return a place within a file as text.

    >>> place_of(("layers", 1, "frame_id"))
    'layers[1].frame_id'
    """
    text = ""
    for key in keys:
        text += f"[{key}]" if isinstance(key, int) else f".{key}" if text else key
    return text


def found(value: Any) -> str:
    """Describe an unexpected value for a message.

    >>> found([1, 2]), found(None), found("x" * 100)
    ('a list', 'nothing', "'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...")
    """
    if value is None:
        return "nothing"
    for kind, name in ((dict, "keys and values"), (list, "a list")):
        if isinstance(value, kind):
            return name
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:38]}..."


def _explain(error: dict[str, Any]) -> str:
    if error["type"] == "missing":
        return "is required, but missing"
    if error["type"] == "value_error":
        return str(error["ctx"]["error"])
    if error["type"] == "too_long":
        most, actual = error["ctx"]["max_length"], error["ctx"]["actual_length"]
        return f"at most {most} values are expected, found {actual or 'more'}"
    message = str(error["msg"]).replace("valid tuple", "list")  # files have no tuples
    return f"{message[0].lower()}{message[1:]}, found {found(error['input'])}"
