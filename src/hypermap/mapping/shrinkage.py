"""Shrinkage: how much of a correction to apply, judged by the corrections so far.

Measurements have errors of their own. Where the given values are exact, corrections consist of
those errors alone, and each one makes objects worse. Where corrections are much larger than such
errors, nearly all of a correction is right. In between, so is the best share.

Source: James and Stein (1961) shrink an estimate toward a given value by a sum of squares; here it
is that of the newest corrections (Efron and Morris, 1975). Their share rises more slowly. It is
best where errors are independent, but those of one run are correlated: one room, one map.
"""

from __future__ import annotations

_NEWEST = 15  # corrections whose sizes count, in the mean
_FEW = 0.5  # corrections of the size of errors that are assumed at the beginning
_ERRORS = 2.2  # most mean size of errors over the expected one, as errors correlate


class Shrinkage:
    """Learns from the sizes of corrections which share of them to apply."""

    def __init__(self) -> None:
        self._size = self._expected = _FEW * 3

    @property
    def learned(self) -> tuple[float, float]:
        """The mean sizes of corrections and of their errors so far."""
        return self._size, self._expected

    def go_on_with(self, learned: tuple[float, float]) -> None:
        """Take over what another one has learned."""
        self._size, self._expected = learned

    def share_of(self, size: float, expected: float) -> float:
        """Learn from the size of a correction and return which share of it to apply, 0..1.

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
