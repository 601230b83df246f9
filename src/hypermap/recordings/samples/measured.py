"""Numbers over time become samples at places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray
from hypermap.core.errors import HypermapError
from hypermap.core.moving_frames import Motion
from hypermap.core.samples import Samples
from hypermap.text import counted
from hypermap.values.units import converted, unit_named

NO_NUMBER = "without a number"
NO_POSE = "without a pose at their time"


@dataclass(frozen=True, eq=False)
class Measured:
    """The samples of a sensor, with their unit and quantity.

    Attributes:
        samples: in the requested frame.
        unit: unit of the message type; empty if it has none.
        quantity: quantity of the message type; empty if it has none.
        left_out: number of rejected samples, by reason.
    """

    samples: Samples
    unit: str = ""
    quantity: str = ""
    left_out: dict[str, int] = field(default_factory=dict)

    def without(self, reason: str, wrong: BoolArray) -> Measured:
        """Return the same without some samples, (N,), which are counted."""
        if not wrong.any():
            return self
        count = self.left_out.get(reason, 0) + int(wrong.sum())
        left_out = {**self.left_out, reason: count}
        return replace(self, samples=self.samples.chosen(~wrong), left_out=left_out)

    def in_unit(self, wanted: str | None, of_samples: str | None = None) -> Measured:
        """Return the same in another unit; None for that of the samples.

        Args:
            wanted: the unit to convert to.
            of_samples: the unit of the samples, where the kind of message does not say.

        Raises:
            HypermapError: If the kind of message says another unit, or one cannot be converted to
                the other.
        """
        if of_samples is not None and self.unit not in ("", unit_named(of_samples)):
            raise HypermapError(
                f"sample-unit {of_samples}: these samples are in {self.unit}; give the unit of the "
                "layer as unit"
            )
        unit = unit_named(of_samples or self.unit or wanted or "")
        target = unit_named(wanted or unit)
        values = converted(self.samples.values, unit, target)
        return replace(self, samples=replace(self.samples, values=values), unit=target)


def checked(
    points_xy: NDArray[np.float64],
    values: NDArray[np.float64],
    stamps: NDArray[np.float64],
    *,
    censored_below: float | None = None,
    unit: str = "",
    quantity: str = "",
) -> Measured:
    """Return numbers as samples, without those that have no pose or are not numbers.

    Args:
        points_xy: shape (N, 2) [m]; NaN for a sample without a pose.
        values: shape (N,); where nothing was heard, NaN.
        stamps: shape (N,) [s].
        censored_below: the limit below which nothing is heard; None where NaN says nothing.
        unit: of the values.
        quantity: what they are.
    """
    samples = Samples(points_xy, values, np.zeros(len(values), dtype=bool), stamps)
    if censored_below is not None:
        heard = np.where(np.isnan(values), -np.inf, values)
        samples = replace(samples, values=heard).censored(censored_below)
    has_pose = np.asarray(np.isfinite(points_xy).all(axis=1))
    measured = Measured(samples, unit, quantity).without(NO_POSE, ~has_pose)
    is_number = np.asarray(np.isfinite(measured.samples.values))
    return measured.without(NO_NUMBER, ~is_number)


def sensor_positions(motion: Motion, stamps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where a sensor was at stamps, shape (N, 2); NaN if unknown.

    Args:
        motion: of the sensor in the map.
        stamps: shape (N,) [s].

    Raises:
        HypermapError: If it is known at none of them.
    """
    points = np.full((len(stamps), 2), np.nan)
    known = np.isfinite(stamps)
    known[known] = motion.covers(stamps[known])
    if len(stamps) and not known.any():
        raise HypermapError(
            f"no sample has a pose at its time: the samples reach from {np.nanmin(stamps):.3f} to "
            f"{np.nanmax(stamps):.3f} s; are their clock and that of the poses the same?"
        )
    points[known] = motion.at(stamps[known])[:, :2, 3]
    return points


def reasons(left_out: Mapping[str, int]) -> str:
    """Return in words how many samples were left out, and why.

    >>> reasons({NO_POSE: 1, NO_NUMBER: 2})
    '1 sample without a pose at their time, 2 samples without a number'
    """
    return ", ".join(f"{counted(count, 'sample')} {why}" for why, count in left_out.items())
