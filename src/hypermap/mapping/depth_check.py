"""A plausibility check of depth, because a wrong unit would silently give an empty map.

It samples a few hundred pixels of each frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.perception.frame import RgbdFrame
from hypermap.text import counted

_LOOKED_AT = 30  # rows and columns of a frame that are sampled, about
_FARTHEST = 50.0  # meters; the median depth of any real camera is smaller
_SATURATED = 10.0  # meters; beyond it, no real surface fills an image at a single depth
_SAME = 0.95  # share of an image at one depth
_FEW = 0.05  # share of pixels with depth
_NEAR = 0.1  # meters
_SCALE = "are the units of depth per meter right (--depth-scale)?"


def why_implausible(frame: RgbdFrame) -> str | None:
    """Return why the depth of a frame cannot be a measurement; None if it can."""
    depth = _sample(frame)
    if len(depth) == 0:
        return None
    middle = float(np.median(depth))
    if middle > _FARTHEST:
        return f"half of its depth is beyond {middle:.0f} m; {_SCALE}"
    same = float(np.mean(depth == middle))
    if middle > _SATURATED and same >= _SAME:
        return f"its depth is saturated: {same:.0%} of it is {middle:.3f} m"
    return None


class DepthCheck:
    """Counts frames with implausible depth, and names the likely cause if there are many."""

    def __init__(self, max_depth: float) -> None:
        """Prepare a check; depth beyond `max_depth` [m], the limit for objects, is implausible."""
        self._max_depth = max_depth
        self._frames = 0
        self._odd = dict.fromkeys(("few", "near", "far"), 0)

    def add(self, frame: RgbdFrame) -> None:
        """Check a mapped frame."""
        depth = _sample(frame)
        middle = float(np.median(depth)) if len(depth) else np.nan
        self._frames += 1
        self._odd["few"] += len(depth) < _FEW * _sampled(frame.z).size
        self._odd["near"] += middle < _NEAR
        self._odd["far"] += middle > self._max_depth

    def why_odd(self) -> str | None:
        """Return what is implausible about most frames; None if nothing is."""
        if self._frames == 0:
            return None
        causes = {
            "near": f"half of the depth or more is nearer than {_NEAR:g} m; {_SCALE}",
            "far": f"half of the depth or more is farther than the {self._max_depth:g} m up to "
            f"which objects are looked for (max_depth); {_SCALE}",
            "few": f"less than {_FEW:.0%} of the pixels have depth; was the camera covered, or "
            "are these another kind of images?",
        }
        for kind, cause in causes.items():
            if 2 * self._odd[kind] > self._frames:
                return f"in {self._odd[kind]} of {counted(self._frames, 'frame')}, {cause}"
        return None


def _sampled(z: NDArray[np.float32]) -> NDArray[np.float32]:
    rows, columns = (max(1, size // _LOOKED_AT) for size in z.shape)
    return z[::rows, ::columns]


def _sample(frame: RgbdFrame) -> NDArray[np.float32]:
    """Return the depth of some pixels that have one [m], shape (N,)."""
    depth = _sampled(frame.z)
    return depth[(depth > 0) & (depth < np.inf)]
