"""How much of a correction to believe, seen in the corrections so far.

What is measured errs by itself. Where given values are exact, corrections are nothing but the
errors of the measurement, and each of them makes things worse. Where corrections are much larger
than such errors, nearly all of them is right. In between, the best share of them lies in between.

Source: the idea is that of James and Stein (1961), shrinking towards the given value by a sum of
squares, here of the newest corrections (Efron and Morris, 1975). Their share rises more slowly; it
is best where errors are independent, but those of one run are alike: of one room, of one map.
"""

from __future__ import annotations

_NEWEST = 15  # corrections whose sizes count, in the mean
_FEW = 0.5  # corrections of the size of errors that are assumed at the beginning
_ERRORS = 2.2  # mean size of mere errors over the expected one, at most: those of a run are alike


class Shrinkage:
    """Learns from the sizes of corrections which share of them to make."""

    def __init__(self) -> None:
        self._size = self._expected = _FEW * 3

    def share_of(self, size: float, expected: float) -> float:
        """Return which share of a correction to make, 0..1, having learnt from its size.

        Args:
            size: square of the correction over its covariance, as chi-squared.
            expected: the mean of such sizes if all corrections were errors of measurement, which is
                the number of values that were measured.
        """
        kept = 1 - 1 / _NEWEST
        self._size = kept * self._size + size
        self._expected = kept * self._expected + expected
        most = _ERRORS * self._expected
        return 1 - (most / self._size) ** 2 if self._size > most else 0.0
