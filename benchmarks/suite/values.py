"""How well values between samples are estimated, beside a Gaussian process, and how fast.

The fields are simulated, so that the truth is known all over the floor; a robot took its samples on
the drive of each world. Errors count where `gmrf` gives a value; those of `kernel` and `nearest`
where they give one, too.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap import GridGeometry, OccupancyLayer, ValueLayer
from hypermap.core.samples import Samples
from hypermap.simulation import built_in_world
from hypermap.values import FieldSettings, LiveField, interpolate, value_layer_of
from hypermap.values.growing import GrowingLayer
from hypermap.values.methods import Method
from suite.fields import FIELDS, Field
from suite.race import Figure, Row, Settings, library

METHODS: tuple[Method, ...] = ("gmrf", "kernel", "nearest")
WORLDS = ("lab", "floor", "building")
_ASKED_RATIO = 0.75  # of the Gaussian process' error
_ASKED_WITHIN = 0.92  # share of new samples within two deviations; above 0.98 is too much
_SIDE, _COUNT, _SECONDS = 250.0, 100_000, 10.0  # meters, samples, what is asked for them
_SECONDS_OF_ONE = 0.02  # asked for one more sample


@dataclass(frozen=True)
class _Errors:
    """Root mean square errors of one field by method.

    Attributes:
        gmrf_by_kernel: of `gmrf` where the kernel has a value, which is near samples alone.
        within: share of new samples that are within two predicted deviations of `gmrf`.
        within_of_process: the same of the Gaussian process.
    """

    gmrf: float
    gmrf_by_kernel: float
    kernel: float
    nearest: float
    gaussian_process: float
    within: float
    within_of_process: float


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the errors of simulated fields against those of a Gaussian process, and times."""
    seeds = 1 if settings.quick else 2 * settings.repeat
    for quantity, make in FIELDS.items():
        for name in WORLDS[:1] if settings.quick else WORLDS:
            world = built_in_world(name)
            is_radio = quantity == "radio"
            found = [_errors(make(world, seed), is_radio) for seed in range(seeds)]
            yield from _figures(f"{quantity}, {name}", found, settings.quick)
    for name in WORLDS[:1] if settings.quick else WORLDS:
        yield from _while_driving(name)
    yield _many_samples(settings)
    yield from _one_more_sample(settings)


def _figures(what: str, found: list[_Errors], quick: bool) -> Iterator[Figure]:
    means = {
        name: float(np.sqrt(np.mean([getattr(each, name) ** 2 for each in found])))
        for name in ("gmrf", "gaussian_process", "kernel", "gmrf_by_kernel", "nearest")
    }
    ratio = means["gmrf"] / means["gaussian_process"]
    note = ", ".join(f"{name.replace('_', ' ')} {error:.2f}" for name, error in means.items())
    asked = None if quick else _ASKED_RATIO
    yield Figure(f"error of gmrf, {what}", (ratio,), "x GP", asked, True, f"RMSE: {note}")
    within = tuple(each.within for each in found)
    of_process = float(np.mean([each.within_of_process for each in found]))
    note = f"by seed {', '.join(f'{share:.2f}' for share in within)}; GP {of_process:.2f}"
    asked = None if quick else _ASKED_WITHIN
    mean = (float(np.mean(within)),)
    yield Figure(f"within two deviations, {what}", mean, "share", asked, note=note)


def _errors(field: Field, is_radio: bool) -> _Errors:
    ours: dict[str, _Estimate] = {method: _estimate(field, method, is_radio) for method in METHODS}
    has_value = np.isfinite(ours["gmrf"].values)
    by_kernel = has_value & np.isfinite(ours["kernel"].values)
    process = _gaussian_process(field)
    errors = {
        name: _root_mean_square(found.values - field.values, has_value)
        for name, found in {**ours, "gaussian_process": process}.items()
    }
    gmrf_within, process_within = (
        float(np.mean((np.abs(found.values - field.measured) <= 2 * found.spread)[has_value]))
        for found in (ours["gmrf"], process)
    )
    return _Errors(
        **errors,
        gmrf_by_kernel=_root_mean_square(ours["gmrf"].values - field.values, by_kernel),
        within=gmrf_within,
        within_of_process=process_within,
    )


def _root_mean_square(errors: NDArray[np.float64], here: NDArray[np.bool_]) -> float:
    return float(np.sqrt(np.nanmean(errors[here] ** 2)))


@dataclass(frozen=True)
class _Estimate:
    """Values at a field's places and standard deviations of new samples there; NaN for none."""

    values: NDArray[np.float64]
    spread: NDArray[np.float64]


def _estimate(field: Field, method: Method, is_radio: bool) -> _Estimate:
    found = interpolate(field.samples, field.occupancy, method=method, may_have_source=is_radio)
    cells = found.grid.cells_at(field.points_xy)
    on_grid = found.grid.contains(*cells.T)
    values, spread = np.full((2, len(cells)), np.nan)
    here = tuple(cells[on_grid].T)
    values[on_grid] = found.values[here]
    spread[on_grid] = np.hypot(found.deviations[here], found.noise)
    return _Estimate(values, spread)


def _gaussian_process(field: Field) -> _Estimate:
    """Return what scikit-learn finds there: Matern 3/2, parameters by likelihood."""
    gaussian_process = library("sklearn.gaussian_process")
    kernels = gaussian_process.kernels
    kernel = kernels.ConstantKernel(1.0) * kernels.Matern(3.0, (0.3, 100.0), nu=1.5)
    process = gaussian_process.GaussianProcessRegressor(
        kernel + kernels.WhiteKernel(0.1, (1e-4, 10.0)),
        normalize_y=True,
        n_restarts_optimizer=1,
        random_state=0,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a parameter at its bound
        process.fit(field.samples.points_xy, field.samples.values)
    return _Estimate(*process.predict(field.points_xy, return_std=True))  # with the white noise


def _while_driving(name: str) -> Iterator[Figure]:
    """Yield what a layer costs that grows on a drive with a sample each second, and its error."""
    field = FIELDS["warmth"](built_in_world(name), 0)
    layer = GrowingLayer("warmth", "map", "warmth", "K")
    adding, solving = [], []
    for row, place in enumerate(field.samples.points_xy):
        sample = Samples.of([place], [field.samples.values[row]], stamps=[float(row)])
        begin = time.thread_time()
        layer.add(sample)
        adding.append(time.thread_time() - begin)
        if layer.is_due:
            begin = time.thread_time()
            layer.solve(field.occupancy)
            solving.append(time.thread_time() - begin)
    grown = layer.layer()
    assert grown is not None
    whole = value_layer_of("warmth", field.samples, field.occupancy)
    note = f"{len(adding)} samples; solved anew {len(solving)} times, {max(solving):.2f} s at most"
    yield Figure(f"live, {name}: a sample", tuple(adding), "s", None, True, note)
    share = 100 * sum(solving) / len(adding)
    yield Figure(f"live, {name}: share of a core to solve anew", (share,), "%", None, True)
    ratio = _error(grown, field) / _error(whole, field)
    yield Figure(f"live, {name}: error over that of all samples at once", (ratio,), "x", None, True)


def _error(layer: ValueLayer, field: Field) -> float:
    """Return the root mean square error of a layer where it has a value."""
    return float(np.sqrt(np.nanmean((layer.value_at(field.points_xy) - field.values) ** 2)))


def _many_samples(settings: Settings) -> Figure:
    """Return how long a large floor with many samples takes: 1000 x 1000 cells of 0.25 m."""
    samples, occupancy = _large_floor(1000 if settings.quick else _COUNT)
    times = []
    for _ in range(1 if settings.quick else min(settings.repeat, 3)):
        begin = time.perf_counter()
        found = interpolate(samples, occupancy)
        times.append(time.perf_counter() - begin)
    height, width = found.grid.shape
    size = f"{width} x {height} cells of {found.grid.resolution:g} m"
    asked = None if settings.quick else _SECONDS
    note = f"{_SIDE:g} x {_SIDE:g} m; asked for 1000 x 1000 cells, which are too many for the field"
    what = f"{len(samples):,} samples on {size}"
    return Figure(what, tuple(times), "s", asked, True, note)


def _one_more_sample(settings: Settings) -> Iterator[Figure]:
    """Yield how long one more sample takes, and a full solution in comparison."""
    samples, occupancy = _large_floor(1000 if settings.quick else _COUNT)
    known = FieldSettings(length=20.0, deviation=1.0, noise=0.1)
    resolution = 2.0 if settings.quick else _SIDE / 1000
    begin = time.perf_counter()
    field = LiveField(samples, occupancy, settings=known, resolution=resolution)
    whole = time.perf_counter() - begin
    rng = np.random.default_rng(1)
    times = []
    for x, y in rng.uniform(5, _SIDE - 5, (5 if settings.quick else 60, 2)).tolist():
        begin = time.perf_counter()
        field.add((x, y), 0.0)
        times.append(time.perf_counter() - begin)
    height, width = field.interpolation().grid.shape
    asked = None if settings.quick else _SECONDS_OF_ONE
    note = f"beside {len(samples):,} others; every hundredth sample solves all anew"
    yield Figure(
        f"one more sample on {width} x {height} cells", tuple(times), "s", asked, True, note
    )
    ratio = whole / float(np.median(times))
    note = f"{whole:.2f} s with settings that are given, tables for cells included"
    yield Figure("all samples at once, over one more", (ratio,), "x", None, note=note)


def _large_floor(count: int) -> tuple[Samples, OccupancyLayer]:
    """Return samples of a smooth field on a floor of 8 x 8 rooms."""
    rng = np.random.default_rng(0)
    points = rng.uniform(0, _SIDE, (count, 2))
    values = np.sin(points[:, 0] / 9) + np.cos(points[:, 1] / 7) + rng.normal(0, 0.1, count)
    side = round(_SIDE / 0.25)
    cells = np.zeros((side, side), dtype=np.int8)
    cells[:: side // 8] = cells[:, :: side // 8] = 100
    occupancy = OccupancyLayer("occupancy", "map", GridGeometry(side, side, 0.25), cells)
    return Samples.of(points, values), occupancy
