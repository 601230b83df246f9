"""A mailbox with one slot between the producers of work and the worker."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Holds the newest item alone; safe to use from several threads.

    >>> box = Mailbox[str]()
    >>> box.put("old"), box.put("new")
    (None, 'old')
    >>> box.take(timeout=0.0)
    'new'
    """

    def __init__(self) -> None:
        self._item: T | None = None
        self._changed = threading.Condition()

    def put(self, item: T) -> T | None:
        """Put an item in the slot and return the one that it replaces, if there was one."""
        with self._changed:
            replaced, self._item = self._item, item
            self._changed.notify()
        return replaced

    def take(self, timeout: float | None = None) -> T | None:
        """Return the item and empty the slot; None if there is none within `timeout` seconds."""
        with self._changed:
            self._changed.wait_for(lambda: self._item is not None, timeout)
            item, self._item = self._item, None
        return item
