"""Checks of the numbers that describe errors."""

from __future__ import annotations

import math
from typing import Any


def check_not_negative(noise: Any, *names: str) -> None:
    """Raise a ValueError unless the named attributes are finite numbers of at least 0."""
    for name in names:
        value = getattr(noise, name)
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be a number of at least 0, got {value}")


def check_shares(noise: Any, *names: str) -> None:
    """Raise a ValueError unless the named attributes are numbers from 0 to 1."""
    for name in names:
        value = getattr(noise, name)
        if not 0 <= value <= 1:  # also false for NaN
            raise ValueError(f"{name} must be a share from 0 to 1, got {value}")
