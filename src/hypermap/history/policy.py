"""How much of its history a map keeps."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hypermap.core.errors import HypermapError

POLICY = "history"
"""Where a map's metadata hold it: `history: {keep: 90d, max_mb: 100}`."""

_SECONDS = {"h": 3600, "d": 86400, "w": 604800}


@dataclass(frozen=True)
class HistoryPolicy:
    """How much of its history a map keeps; what is older is dropped, the oldest first.

    Attributes:
        keep: how long before the newest change: a number with h, d or w.
        max_mb: maximum size in megabytes, as text, before compression.
    """

    keep: str = "90d"
    max_mb: float = 100.0

    def __post_init__(self) -> None:
        _ = self.seconds
        if type(self.max_mb) not in (int, float) or not 0 < self.max_mb <= 500:
            raise HypermapError(f"history: max_mb: expected 0 to 500, got {self.max_mb!r}")

    @property
    def seconds(self) -> float:
        """For how long revisions are kept [s]."""
        found = re.fullmatch(r"(\d{1,6})([hdw])", str(self.keep))
        if found is None:
            raise HypermapError(f"history: keep: expected a time such as 90d, got {self.keep!r}")
        return float(int(found[1]) * _SECONDS[found[2]])

    @classmethod
    def of(cls, metadata: Mapping[str, Any]) -> HistoryPolicy:
        """Return the policy in a map's metadata, with defaults for missing keys.

        Raises:
            HypermapError: If it says something else.
        """
        said = metadata.get(POLICY) or {}
        try:
            if not isinstance(said, Mapping) or not said.keys() <= {"keep", "max_mb"}:
                raise HypermapError(f"history: expected keep and max_mb, got {said!r}")
            return cls(**said)
        except HypermapError as error:
            raise HypermapError(f"{error}; `hypermap history MAP --keep 90d` mends it") from None
