"""Attributes that are computed on first access."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar, overload

T = TypeVar("T")


class OnDemand(Generic[T]):
    """A field of a dataclass, given as a value or as a function that returns it.

    The function is called when the field is first read; the field then keeps the result.
    A field that is not given is None.

    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Page:
    ...     text: OnDemand[str | None] = OnDemand()
    >>> Page("at once").text, Page(lambda: "when read").text, Page().text
    ('at once', 'when read', None)
    """

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> None: ...

    @overload
    def __get__(self, instance: object, owner: type) -> T: ...

    def __get__(self, instance: object | None, owner: type) -> T | None:
        if instance is None:
            return None  # the default, for a dataclass
        value: T | Callable[[], T] = vars(instance)[self._name]
        if callable(value):
            value = vars(instance)[self._name] = value()
        return value

    def __set__(self, instance: object, value: T | Callable[[], T]) -> None:
        vars(instance)[self._name] = value
