"""Whether corrected poses fit the depth images better than the given ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.mapping.consistency import Consistency
from hypermap.perception.frame import RgbdFrame

_JUDGED_EVERY = 12  # frames
_SURE_GAIN = 2.0  # standard errors; from such a gain or loss, a verdict is sure


class Agreement:
    """Whether depth images agree less with each other by corrected poses than by the given ones.

    With exact poses, corrections by a distorted map pull images of one place apart. Otherwise,
    corrections bring them together.

    Attributes:
        is_worse: whether they agree less, as far as is known.
    """

    def __init__(self) -> None:
        self.is_worse = False
        self._given = Consistency()
        self._corrected: dict[float, NDArray[np.float64]] = {}
        self._frames = 0

    def add(self, frame: RgbdFrame, corrected: NDArray[np.float64]) -> None:
        """Add a frame with its given pose, and the corrected `map_T_camera`, shape (4, 4)."""
        self._given.add(frame)
        self._corrected[frame.stamp] = corrected
        self._frames += 1
        if self._frames % _JUDGED_EVERY == 0:
            kept = self._given.stamps
            self._corrected = {at: pose for at, pose in self._corrected.items() if at in kept}
            self.is_worse = now_worse(self._given.gain_of(self._corrected), self.is_worse)


def now_worse(gain: float | None, was_worse: bool) -> bool:
    """Return whether depth images agree less by corrected poses.

    A verdict stays until the other is sure: some poses as given and some as corrected, by turns,
    would put things in two places.

    Args:
        gain: of `Consistency.gain_of`; None if it is not known.
        was_worse: the verdict before.
    """
    return gain is not None and gain < (_SURE_GAIN if was_worse else -_SURE_GAIN)
