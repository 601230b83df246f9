"""A value layer that grows while a robot drives: samples come, and walls appear."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.samples import Samples
from hypermap.core.value_layer import ValueLayer
from hypermap.values.fitting import LEAST_SAMPLES
from hypermap.values.interpolation import Interpolation, interpolate
from hypermap.values.layers import layer_of, on_map, unknown_layer_of
from hypermap.values.live_field import LiveField
from hypermap.values.methods import Method
from hypermap.values.on_map import new_among
from hypermap.values.random_field import FieldSettings
from hypermap.values.units import is_signal

_NO_SAMPLES = Samples.of(np.empty((0, 2)), [])
_GROWN = 2  # times as many samples as the settings were estimated from: they are estimated again


class GrowingLayer:
    """A value layer that takes in samples in milliseconds each, by a `LiveField`.

    `solve` starts the field, and later computes it from scratch, which takes longer. One thread
    adds samples and solves; others may get the layer, move the samples or forget them meanwhile.

    Args:
        name: of the layer.
        frame_id: of all samples.
        quantity: what is measured.
        unit: of all values.
        kept: samples of an earlier layer of that name.
        method: as `interpolate` takes it, like the next; each sample of another method than "gmrf",
            or with a half-life, waits for `solve`.
        half_life: as there.

    Attributes:
        revision: grows with every change.
    """

    def __init__(
        self,
        name: str,
        frame_id: str,
        quantity: str,
        unit: str,
        kept: Samples = _NO_SAMPLES,
        *,
        method: Method = "gmrf",
        half_life: float | None = None,
    ) -> None:
        self.name = name
        self.revision = 0
        self._frame_id, self._quantity, self._unit = frame_id, quantity, unit
        self._samples, self._before = kept, len(kept)
        self._method, self._half_life = method, half_life
        self._field: LiveField | Interpolation | None = None  # the latter does not take samples in
        self._walls: OccupancyLayer | None = None  # of the field
        self._fitted = 0  # samples that its settings were estimated from
        self._is_due = len(kept) >= LEAST_SAMPLES
        self._lock = threading.Lock()

    def __len__(self) -> int:
        """Return how many samples there are, those of the earlier layer among them."""
        return len(self._samples)

    @property
    def is_due(self) -> bool:
        """Whether something has come that only `solve` brings into the layer."""
        return self._is_due

    @property
    def is_new(self) -> bool:
        """Whether there are samples that the earlier layer does not have."""
        return len(self._samples) > self._before

    def add(self, samples: Samples) -> None:
        """Take in samples; one with a stamp that is known is there already and counts once."""
        for row in range(len(samples)):
            sample = samples.chosen(np.arange(len(samples)) == row)
            with self._lock:
                if len(new_among(sample, self._samples)):
                    self._samples = self._samples.joined(sample)
                    self._update(sample)
                    self.revision += 1

    def solve(self, occupancy: OccupancyLayer | None) -> None:
        """Make the field from scratch from all samples.

        Args:
            occupancy: walls, and where the floor is.

        Raises:
            HypermapError: If no field can be made of them; the layer then is unchanged.
        """
        with self._lock:
            samples, field = self._samples, self._field
            self._is_due = False
        is_fitted = isinstance(field, LiveField) and len(samples) < _GROWN * self._fitted
        settings = field.settings if isinstance(field, LiveField) and is_fitted else None
        made = self._made(on_map(samples, occupancy), occupancy, settings)
        with self._lock:
            if self._samples is samples:  # nobody has moved or forgotten them meanwhile
                self._field, self._walls = made, occupancy
                self._fitted = self._fitted if is_fitted else len(samples)
                self.revision += 1

    def _made(
        self, samples: Samples, occupancy: OccupancyLayer | None, settings: FieldSettings | None
    ) -> LiveField | Interpolation:
        signal = is_signal(self._unit)
        if self._method == "gmrf" and self._half_life is None:
            return LiveField(samples, occupancy, settings=settings, may_have_source=signal)
        return interpolate(
            samples,
            occupancy,
            method=self._method,
            half_life=self._half_life,
            may_have_source=signal,
        )

    def layer(self) -> ValueLayer | None:
        """Return the present layer; None while it equals the earlier one."""
        with self._lock:
            samples, walls = self._samples, self._walls
            field = self._field
            found = field.interpolation() if isinstance(field, LiveField) else field
        texts = {"quantity": self._quantity, "unit": self._unit}
        if found is None and not self.is_new:
            return None
        if found is None:
            return unknown_layer_of(self.name, samples, self._frame_id, **texts)
        grid = found.grid
        inside = samples.chosen(grid.contains(*grid.cells_at(samples.points_xy).T))
        layer = layer_of(found, self.name, inside, walls, self._frame_id, **texts)
        layer.samples = samples  # those that wait for `solve`, too
        return layer

    def move(self, moved: Callable[[Samples], Samples]) -> None:
        """Move the samples to where they were really taken; their field waits for `solve`."""
        with self._lock:
            self._samples = moved(self._samples)
            self._is_due |= self._field is not None
            self.revision += 1

    def clear(self) -> None:
        """Forget all samples, those of the earlier layer, too."""
        with self._lock:
            self._samples, self._before = _NO_SAMPLES, 0
            self._field, self._is_due = None, False
            self.revision += 1

    def _update(self, sample: Samples) -> None:
        """Bring a sample into the field, or note that `solve` has to."""
        field = self._field
        if field is None:
            self._is_due = int(np.count_nonzero(~self._samples.is_below)) >= LEAST_SAMPLES
        elif isinstance(field, Interpolation) or not field.covers(sample.points_xy[0]):
            self._is_due = True
        else:
            (x, y), value = sample.points_xy[0].tolist(), float(sample.values[0])
            stamp = float(sample.stamps[0])
            field.add((x, y), value, is_below=bool(sample.is_below[0]), stamp=stamp)
            self._is_due |= len(self._samples) >= _GROWN * self._fitted
