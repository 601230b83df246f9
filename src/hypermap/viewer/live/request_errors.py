"""Requests that the server refuses."""

from __future__ import annotations

from typing import Any

from hypermap.core.errors import HypermapError


class Refused(HypermapError):
    """A request that the server refuses.

    Attributes:
        status: the HTTP status of the response.
        reason: a word for the page, such as "behind", "disk" or "exists"; may be empty.
        others: further values for the page.
    """

    def __init__(self, message: str, status: int = 400, reason: str = "", **others: Any) -> None:
        super().__init__(message)
        self.status = status
        self.reason = reason
        self.others = others
