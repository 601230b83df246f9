"""Quantities with known values all over a simulated floor, and a robot's samples of them.

Warmth is heat diffusion in steady state: radiators and devices give heat, windows and all surfaces
take it, walls conduct little. Radio is the multi-wall model (COST 231 final report, 1999, section
4.7): free space's path loss, and a loss for each wall between sender and receiver.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import spsolve

from hypermap.core.arrays import BoolArray
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyLayer
from hypermap.core.samples import Samples
from hypermap.simulation.trajectory import planar_poses
from hypermap.simulation.truth import true_occupancy
from hypermap.simulation.world import World

_RESOLUTION = 0.1  # meters, of the true field
_RATE = 1.0  # samples per second
_PASSAGE = 4  # cells of the map; the robot passes gaps that are twice as wide

_OUTSIDE, _SURFACES = 5.0, 20.0  # degrees Celsius
_LOSS = 0.0003  # of a cell to floor and ceiling, as a share of what a link conducts
_WALL = 0.01  # what a wall's cell conducts, as a share of air
_WINDOWS = 0.1  # share of the outer walls
_AREA_PER_SOURCE = 20.0  # square meters
_WARMTH_NOISE = 0.3  # kelvins

_AT_ONE_METER = -35.0  # dBm
_PER_WALL = 6.0  # dB
_RADIO_NOISE = 2.0  # dB


@dataclass(frozen=True, eq=False)
class Field:
    """A quantity that is known everywhere.

    Attributes:
        occupancy: the robot's map, with furniture, at its own resolution.
        samples: what the robot measured on its drive.
        points_xy: places on the floor, shape (N, 2), in the frame of the map.
        values: at these places, without noise, shape (N,).
        measured: new samples at these places, with noise, shape (N,).
    """

    occupancy: OccupancyLayer
    samples: Samples
    points_xy: NDArray[np.float64]
    values: NDArray[np.float64]
    measured: NDArray[np.float64]


def warmth(world: World, seed: int) -> Field:
    """Return the temperature in a world [degC]; sources and windows are drawn at random."""
    rng = np.random.default_rng(seed)
    walls = _walls(world)
    grid = _grid(walls)
    inside, wall, outside = (_cells(walls, state) for state in (FREE, OCCUPIED, UNKNOWN))
    conducts = np.where(inside, 1.0, _WALL)
    # Patches of the outer walls are windows: they conduct as well as half a meter of air.
    outer = wall & ndimage.binary_dilation(outside, iterations=4)
    patches = ndimage.gaussian_filter(rng.normal(size=grid.shape), 0.7 / grid.resolution)
    is_window = outer & (patches > np.quantile(patches[outer], 1 - _WINDOWS))
    conducts[is_window] = 0.2
    heat = np.zeros(grid.shape)
    near_wall = inside & ndimage.binary_dilation(wall, iterations=5)
    places = np.argwhere(near_wall)
    count = max(1, round(np.count_nonzero(inside) * grid.resolution**2 / _AREA_PER_SOURCE))
    for row, col in places[rng.choice(len(places), count)]:
        heat[row, col] = rng.uniform(0.5, 2.0)
    heat = ndimage.gaussian_filter(heat, 0.3 / grid.resolution)
    laplacian = _laplacian(conducts)
    held = np.where(outside, 1e3, _LOSS)
    target = np.where(outside, _OUTSIDE, _SURFACES)
    field = spsolve(
        csr_array(diags_array(held.ravel()) - laplacian).tocsc(),
        (heat + held * target).ravel(),
    ).reshape(grid.shape)
    return _sampled(world, walls, field, _WARMTH_NOISE, rng)


def radio(world: World, seed: int) -> Field:
    """Return the signal strength of a sender in a world [dBm]; its place is drawn at random."""
    rng = np.random.default_rng(seed)
    walls = _walls(world)
    grid = _grid(walls)
    inside = np.argwhere(_cells(walls, FREE))
    sender = grid.centers(*inside[rng.integers(len(inside))].reshape(2, 1))[0]
    field = np.full(grid.shape, np.nan)
    centers = grid.centers(*inside.T)
    distance = np.hypot(*(centers - sender).T)
    crossed = np.zeros(len(centers), dtype=int)
    was_wall = np.zeros(len(centers), dtype=bool)
    for share in np.linspace(0, 1, 2 + int(2 * distance.max() / grid.resolution)):
        is_wall = walls.value_at(sender + share * (centers - sender)) == OCCUPIED
        crossed += is_wall & ~was_wall
        was_wall = is_wall
    level = _AT_ONE_METER - 20 * np.log10(np.maximum(distance, 0.5)) - _PER_WALL * crossed
    field[tuple(inside.T)] = level
    return _sampled(world, walls, field, _RADIO_NOISE, rng)


FIELDS = {"warmth": warmth, "radio": radio}


def _walls(world: World) -> OccupancyLayer:
    """Return the walls alone, without furniture."""
    return true_occupancy(replace(world, objects=()), resolution=_RESOLUTION)


def _cells(layer: OccupancyLayer, state: int) -> BoolArray:
    assert layer.cells is not None
    return np.asarray(layer.cells == state)


def _grid(layer: OccupancyLayer) -> GridGeometry:
    assert layer.grid is not None
    return layer.grid


def _laplacian(conducts: NDArray[np.float64]) -> csr_array:
    """Return the graph Laplacian (negative semidefinite) of cells that conduct in series."""
    numbers = np.arange(conducts.size).reshape(conducts.shape)
    ends, others, weights = [], [], []
    for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        weights.append((2 / (1 / conducts[here] + 1 / conducts[there])).ravel())
        ends.append(numbers[here].ravel())
        others.append(numbers[there].ravel())
    half = coo_array(
        (np.concatenate(weights), (np.concatenate(ends), np.concatenate(others))),
        shape=(conducts.size, conducts.size),
    ).tocsr()
    links = csr_array(half + half.T)
    return csr_array(links - diags_array(links.sum(axis=1)))


def _sampled(
    world: World,
    walls: OccupancyLayer,
    field: NDArray[np.float64],
    noise: float,
    rng: np.random.Generator,
) -> Field:
    """Return a field with samples along the drive, and its values where the robot can go."""
    assert world.drive is not None
    grid = _grid(walls)
    points = planar_poses(world.drive, _RATE)[1][:, :2]
    values = field[tuple(grid.cells_at(points).T)] + rng.normal(0, noise, len(points))
    occupancy = true_occupancy(world)
    free = ndimage.binary_opening(_cells(occupancy, FREE), iterations=_PASSAGE)
    parts, _ = ndimage.label(free)
    labels = parts[tuple(_grid(occupancy).cells_at(points).T)]
    can_go = free & np.isin(parts, labels)
    every = grid.centers(*np.divmod(np.arange(field.size), grid.width))
    cells = np.clip(_grid(occupancy).cells_at(every), 0, np.array(can_go.shape) - 1)
    reached = can_go[tuple(cells.T)].reshape(grid.shape) & _cells(walls, FREE)
    true = field[reached]
    return Field(
        occupancy,
        Samples.of(points, values),
        grid.centers(*np.nonzero(reached)),
        true,
        true + rng.normal(0, noise, len(true)),
    )
