"""How well free space is cut into rooms, beside what other programs reached, and how fast.

The buildings, their true rooms and the figures of the others are those of the folder `rooms` of the
real data, whose README tells the metric and how the others were run. The simulator's worlds know
their rooms.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from hypermap import GridGeometry, OccupancyLayer
from hypermap.core.occupancy import FREE, OCCUPIED
from hypermap.mapping import map_recording, profile
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.rooms import find_rooms
from hypermap.simulation.levels import errors_of_level
from hypermap.simulation.recording import SimulatedRecording
from hypermap.simulation.truth import true_objects, true_occupancy, true_rooms
from hypermap.simulation.world import World, built_in_world
from suite.race import Figure, Row, Settings

SIDE = 0.05  # [m] of a cell
_SMALL = 100  # cells: smaller rooms and segments do not count
# Means over the eight buildings, PQ and mIoU.
_OTHERS = {
    "furnished": "DuDe 0.743 / 0.799, IPA Voronoi 0.638 / 0.840, IPA morphological 0.557 / 0.639",
    "empty": "MAORIS 0.854 / 0.871, DuDe 0.697 / 0.766, IPA Voronoi 0.698 / 0.865",
}
_WORLDS = ("demo", "lab", "office", "floor", "apartment", "building")
_DRIVEN = ("apartment", "office", "building")
_DRIVE = 14  # the seed of errors
_ASKED = (0.92, 0.93)
_SPEED = {1000: 1.0, 4000: 15.0}  # cells a side: seconds asked


def rows(settings: Settings) -> Iterator[Row]:
    """Yield PQ and mIoU of each building, their means, and the time for large grids."""
    folder = settings.folder("rooms")
    buildings = sorted(path.parent for path in folder.glob("*/rooms.png"))
    for variant, others in _OTHERS.items():
        figures = []
        for building in buildings[:2] if settings.quick else buildings:
            figures.append(_measured(building, variant))
            pq, miou, found, true = figures[-1]
            note = f"mIoU {miou:.3f}; {found} rooms found of {true}"
            yield Figure(f"{building.name}, {variant}", (pq,), "PQ", note=note)
        for place, unit in enumerate(("PQ", "mIoU")):
            mean = statistics.fmean(figure[place] for figure in figures)
            asked = None if settings.quick else _ASKED[place]
            note = f"PQ / mIoU of others: {others}"
            yield Figure(f"mean of {len(figures)}, {variant}", (mean,), unit, asked, note=note)
    for name in _WORLDS[:2] if settings.quick else _WORLDS:
        pq, miou, found, true = _of_world(name)
        note = f"mIoU {miou:.3f}; {found} rooms found of {true}"
        yield Figure(f"simulated world {name}, furnished", (pq,), "PQ", note=note)
    for name in _DRIVEN[:1] if settings.quick else _DRIVEN:
        pq, miou, found, true = _of_drive(name)
        note = f"mIoU {miou:.3f}; {found} rooms found of {true}; no occupancy map is given"
        yield Figure(f"simulated world {name}, mapped by a drive", (pq,), "PQ", note=note)
    cells = _cells(folder / "office_b" / "furnished.png")
    for side, asked in _SPEED.items():
        if settings.quick and side > 1000:
            continue
        large = np.tile(cells, (side // cells.shape[0] + 1, side // cells.shape[1] + 1))
        layer = _layer(np.ascontiguousarray(large[:side, :side]))
        find_rooms(_layer(cells[:200, :200]))  # compiles
        times = []
        for _ in range(settings.repeat):
            begin = time.perf_counter()
            rooms = find_rooms(layer)
            times.append(time.perf_counter() - begin)
        note = f"{len(rooms)} rooms: office_b, furnished, side by side"
        yield Figure(f"rooms of {side} x {side} cells", tuple(times), "s", asked, True, note)


def _measured(building: Path, variant: str) -> tuple[float, float, int, int]:
    cells = _cells(building / f"{variant}.png")
    rooms = find_rooms(_layer(cells))
    assert rooms.cells is not None
    with Image.open(building / "rooms.png") as image:
        truth = np.asarray(image).astype(np.int64)[::-1]
    return score(truth, rooms.cells + 1, cells == 0)


def _of_world(name: str) -> tuple[float, float, int, int]:
    """Return the score on the true map of a simulated world, with its furniture."""
    world = built_in_world(name)
    layer = true_occupancy(world)
    rooms = find_rooms(layer, objects=true_objects(world))
    assert layer.cells is not None
    assert rooms.cells is not None
    return score(_true_labels(world, layer), rooms.cells + 1, layer.cells == FREE)


def _of_drive(name: str) -> tuple[float, float, int, int]:
    """Return the score on the map that a drive through a simulated world makes of its images."""
    world = built_in_world(name)
    drive = SimulatedRecording.with_errors(
        world, errors_of_level("robot"), rate=1, seed=_DRIVE, has_occupancy=False
    )
    made = map_recording(drive, detections_from_recording(), profile("default"))
    layer = made["occupancy"]
    assert isinstance(layer, OccupancyLayer)
    assert layer.cells is not None
    rooms = find_rooms(layer, objects=made.semantic().objects())
    assert rooms.cells is not None
    is_free: NDArray[np.bool_] = (layer.cells >= FREE) & (layer.cells < OCCUPIED / 2)
    return score(_true_labels(world, layer), rooms.cells + 1, is_free)


def _true_labels(world: World, layer: OccupancyLayer) -> NDArray[np.int64]:
    """Return the true rooms of a world as labels of the cells of a layer, from 1."""
    assert layer.grid is not None
    truth = np.zeros(layer.grid.shape, dtype=np.int64)
    for label, room in enumerate(true_rooms(world), start=1):
        truth[layer.grid.cells_in(room)] = label
    return truth


def score(
    truth: NDArray[np.int64], found: NDArray[np.int32], free: NDArray[np.bool_]
) -> tuple[float, float, int, int]:
    """Return panoptic quality, mean intersection over union, and the counts of rooms.

    Args:
        truth: labels from 1, shape (height, width); what is 0 is not looked at.
        found: labels from 1; 0 where there is no room.
        free: what is not free is not looked at.

    Returns:
        Of all true rooms the mean of the best IoU is the second; counts are of found and true ones.

    Source: Kirillov et al., "Panoptic segmentation", CVPR 2019, equation 1.
    """
    inside = free & (truth > 0)
    rooms, count = _compact(truth[inside])
    segments, found_count = _compact(found[inside][rooms > 0].astype(np.int64))
    rooms = rooms[rooms > 0] - 1
    shape = (count, found_count + 1)
    both = np.bincount(rooms * shape[1] + segments, minlength=count * shape[1]).reshape(shape)
    shared = both[:, 1:]
    iou = shared / (both.sum(axis=1)[:, np.newaxis] + shared.sum(axis=0) - shared)
    matched = iou[iou > 0.5]
    pq = 2 * float(matched.sum()) / (count + found_count)
    return pq, float(iou.max(axis=1, initial=0).mean()), found_count, count


def _compact(labels: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Return labels from 1 without gaps, those of few cells as 0, and how many there are."""
    values, inverse, counts = np.unique(labels, return_inverse=True, return_counts=True)
    kept = (values != 0) & (counts >= _SMALL)
    return np.where(kept, np.cumsum(kept), 0)[inverse], int(kept.sum())


def _cells(file: Path) -> NDArray[np.int8]:
    """Return a picture as cells; its first row is the top."""
    with Image.open(file) as image:
        gray = np.asarray(image)[::-1]
    return np.where(gray >= 250, 0, np.where(gray < 100, 100, -1)).astype(np.int8)


def _layer(cells: NDArray[np.int8]) -> OccupancyLayer:
    height, width = cells.shape
    return OccupancyLayer("occupancy", "map", GridGeometry(width, height, SIDE), cells)
