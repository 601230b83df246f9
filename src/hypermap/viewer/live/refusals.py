"""What the server refuses, and how it says so."""

from __future__ import annotations

from typing import Any

from hypermap.core.errors import HypermapError


class Refused(HypermapError):
    """A request that is not carried out.

    Attributes:
        status: of the answer in HTTP.
        reason: a word for the page, such as "behind", "disk" or "exists"; may be empty.
        others: what else the page is told.
    """

    def __init__(self, message: str, status: int = 400, reason: str = "", **others: Any) -> None:
        super().__init__(message)
        self.status = status
        self.reason = reason
        self.others = others
