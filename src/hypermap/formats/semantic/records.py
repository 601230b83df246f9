"""Objects as the keys and values that YAML and GeoJSON share: all but the shape."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, field_validator
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import FormatError
from hypermap.core.objects import MAX_ID, SemanticObject
from hypermap.formats.checked import Checked, Finite, check


class _Record(Checked):
    name: str
    tags: tuple[str, ...] = ()
    confidence: tuple[Finite, ...] = ()
    id: Annotated[int, Field(ge=0, le=MAX_ID)] | None = None
    existence: Finite | None = None
    first_seen: Finite | None = None
    last_seen: Finite | None = None
    attributes: dict[Any, Any] | None = None

    @field_validator("tags", "confidence", mode="before")
    @classmethod
    def _empty_key_is_empty_list(cls, value: Any) -> Any:
        return () if value is None else value

    @field_validator("confidence", mode="before")
    @classmethod
    def _number_is_list_of_one(cls, value: Any) -> Any:  # as other programs write it
        return (value,) if type(value) in (int, float) else value


KNOWN_KEYS = _Record.known_keys() | {"shape"}
"""The keys of an object's entry other than free attributes."""


def object_from_record(record: Any, footprint: BaseGeometry) -> SemanticObject:
    """Return the object that a file's entry describes; keys of others become attributes.

    Raises:
        ValueError: Naming the wrong key, or what is wrong with the shape.
    """
    try:
        checked = check(_Record, record, None)
        others = {key: value for key, value in record.items() if key not in KNOWN_KEYS}
        return SemanticObject(
            name=checked.name,
            footprint=footprint,
            id=checked.id,
            tags=checked.tags,
            confidence=checked.confidence,
            existence=checked.existence,
            first_seen=checked.first_seen,
            last_seen=checked.last_seen,
            attributes={**others, **(checked.attributes or {})},
        )
    except (FormatError, TypeError) as error:
        raise ValueError(str(error)) from None


def record_from_object(item: SemanticObject) -> dict[str, Any]:
    """Return an object's keys and values in the files' order, without its shape and its id.

    Attributes are next to the other keys, where programs expect them. Only those with the name
    of one of our keys are under the key `attributes`.
    """
    record: dict[str, Any] = {"name": item.name}
    if item.tags:
        record["tags"] = list(item.tags)
    if item.confidence:
        record["confidence"] = list(item.confidence)
    for key in ("existence", "first_seen", "last_seen"):
        if (value := getattr(item, key)) is not None:
            record[key] = value
    hidden: Mapping[str, Any] = {k: v for k, v in item.attributes.items() if k in KNOWN_KEYS}
    if hidden:
        record["attributes"] = dict(hidden)
    record.update((k, v) for k, v in item.attributes.items() if k not in KNOWN_KEYS)
    return record


def is_json(plain: Any) -> bool:
    """Return whether plain values, as of attributes, are all of what JSON can hold."""
    if isinstance(plain, dict):
        return all(type(key) is str and is_json(value) for key, value in plain.items())
    if isinstance(plain, list):
        return all(map(is_json, plain))
    if isinstance(plain, float):
        return math.isfinite(plain)
    return plain is None or isinstance(plain, bool | int | str)
