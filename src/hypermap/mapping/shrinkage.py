"""Shrinkage: how much of a correction to apply, judged by earlier corrections.

Corrections are measured with errors. If the given values are exact, corrections are nothing but
these errors, and each one makes the map worse. If corrections are much larger than the errors, they
are nearly right. In between, the best share is in between.

Source: James and Stein (1961) shrink an estimate toward a given value by a sum of squares; here it
is the sum over the newest corrections (Efron and Morris, 1975). Their share rises more slowly. It
is optimal for independent errors, but those of one run are correlated: one room, one map.
"""

from __future__ import annotations

_NEWEST = 15  # corrections; time constant of the decaying sums
_FEW = 0.5  # corrections of the size of errors that are assumed at the start (prior)
_ERRORS = 2.2  # largest mean size of errors over the expected one, as errors are correlated


class Shrinkage:
    """Learns from the sizes of corrections which share of them to apply."""

    def __init__(self) -> None:
        self._size = self._expected = _FEW * 3

    @property
    def learned(self) -> tuple[float, float]:
        """The decaying sums of the sizes of corrections and of their errors, for `go_on_with`."""
        return self._size, self._expected

    def go_on_with(self, learned: tuple[float, float]) -> None:
        """Take over the sums of another one (`learned`)."""
        self._size, self._expected = learned

    def share_of(self, size: float, expected: float) -> float:
        """Add the size of a correction, and return which share of it to apply, 0..1.

        Args:
            size: squared Mahalanobis norm of the correction, chi-squared if it is only error.
            expected: the mean of such sizes if all corrections were measurement errors: the number
                of measured values.
        """
        kept = 1 - 1 / _NEWEST
        self._size = kept * self._size + size
        self._expected = kept * self._expected + expected
        most = _ERRORS * self._expected
        return 1 - (most / self._size) ** 2 if self._size > most else 0.0
