"""Statistics of pose corrections: how many, by how much, and why the others were not made."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from hypermap.text import counted

NO_MAP = "the map has no border of free space near the camera"
FEW_POINTS = "too few upright surfaces are visible"
NO_BETTER = "corrections so far are no larger than their own errors, as with exact poses"
LESS_AGREEMENT = "depth images agree less with each other after correction, as with a distorted map"
NO_MATCHES = "no frames could be matched: they are too few, or show too few upright surfaces"
NO_BETTER_MATCHES = "frames match about as well by the recorded poses, as where these are exact"
WORSE_BY_MATCHES = "depth images agree less with each other after correction"
UNCHANGED = "the pose fits as it is"

_LEAST = 1e-6  # meters or radians; anything less is not a correction


class Corrections:
    """Counts corrected poses, and the others by reason."""

    def __init__(self) -> None:
        self._sizes: list[tuple[float, float]] = []  # meters and radians
        self._left: Counter[str] = Counter()

    def add(self, distance: float, turn: float) -> None:
        """Count a corrected pose.

        Args:
            distance: by which it was moved over the floor [m].
            turn: by which it was rotated [rad].
        """
        if max(distance, abs(turn)) < _LEAST:
            self.leave(UNCHANGED)
        else:
            self._sizes.append((distance, abs(turn)))

    def leave(self, reason: str) -> None:
        """Count a pose that stayed as recorded, by the reason."""
        self._left[reason] += 1

    def summary(self) -> dict[str, Any]:
        """Return the counts, for a map's metadata.

        `corrected`: number of frames, moved by `median_m` and `median_deg`, at most by `most_m` and
        `most_deg`; `as_recorded`: numbers of unchanged frames by reason.
        """
        found: dict[str, Any] = {"corrected": len(self._sizes)}
        if self._sizes:
            sizes = np.array(self._sizes)
            sizes[:, 1] = np.degrees(sizes[:, 1])
            for name, values in (("median", np.median(sizes, axis=0)), ("most", sizes.max(axis=0))):
                found[f"{name}_m"], found[f"{name}_deg"] = values.round(4).tolist()
        return found | {"as_recorded": dict(self._left.most_common())}


def sentence(summary: dict[str, Any]) -> str:
    """Return a summary as a sentence.

    >>> sentence({"corrected": 0, "as_recorded": {"too few upright surfaces are visible": 3}})
    'poses: 0 of 3 corrected by the map; 3 as recorded: too few upright surfaces are visible'
    """
    corrected, left = summary["corrected"], summary["as_recorded"]
    by = summary.get("by", "the map")
    text = f"poses: {corrected} of {corrected + sum(left.values())} corrected by {by}"
    if loops := summary.get("loops"):
        text += f" with {counted(loops, 'match', 'matches')} to places seen earlier"
    if corrected:
        text += (
            f", by {100 * summary['median_m']:.1f} cm and {summary['median_deg']:.1f} degrees in "
            f"the median, at most {100 * summary['most_m']:.1f} cm and "
            f"{summary['most_deg']:.1f} degrees"
        )
    return "; ".join([text, *(f"{count} as recorded: {reason}" for reason, count in left.items())])
