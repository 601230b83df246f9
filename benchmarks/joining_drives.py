"""How long it takes to join a later drive to what earlier drives knew, each time someone looks.

Two drives a day apart pass rows of made-up objects, of which a tenth was moved in between. The map
of the second one is looked at after each of its last frames, as `live` and the page that watches
do. Prints the processor's time of a frame, of a look, and of joining everything anew.

    python benchmarks/joining_drives.py [--objects 300] [--looks 20] [--seed 1]
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics
import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import shapely

from hypermap.mapping.config import profile
from hypermap.mapping.earlier_drives import EarlierDrives
from hypermap.mapping.evidence import EvidenceMap
from hypermap.perception.observation import Observation, ObservedObject

_APART = 1.5  # m between two objects
_IN_VIEW = 2.5  # m from the camera, along both axes
_FOUND = 0.85  # share of the objects in view
_DAY = 86_400.0  # s
_CLASSES = ("chair", "table", "plant", "lamp", "cup", "box", "sofa", "bed")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objects", type=int, default=300)
    parser.add_argument("--looks", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    config = dataclasses.replace(profile("default").evidence, class_sizes="any")
    evidence, places = EvidenceMap(config), places_of(arguments.objects)
    for frame in drive_past(places, 0.0, rng):
        evidence.update(frame)
    moved = rng.choice(len(places), len(places) // 10, replace=False)
    places[moved] += _APART / 2
    *frames, last = list(drive_past(places, _DAY, rng))
    begin = len(frames) - arguments.looks
    of_frames, of_looks = [], []
    for number, frame in enumerate([*frames, last]):
        of_frames.append(milliseconds_of(partial(evidence.update, frame)))
        if number >= begin:
            of_looks.append(milliseconds_of(evidence.settled))
    tracks = evidence.tracks()
    anew = [milliseconds_of(lambda: EarlierDrives(config).settled(tracks)) for _ in range(5)]
    print(
        f"{len(evidence)} objects, {len(tracks.objects)} tracks: "
        f"{statistics.median(of_frames):.1f} ms for a frame, "
        f"{statistics.median(of_looks[1:]):.1f} ms for a look after each frame, "
        f"{statistics.median(anew):.1f} ms to join everything anew"
    )


def places_of(count: int) -> np.ndarray:
    """Return where objects are [m], shape (N, 2)."""
    side = int(np.ceil(np.sqrt(count)))
    numbers = np.arange(count)
    return _APART * np.column_stack([numbers % side, numbers // side])


def drive_past(places: np.ndarray, begin: float, rng: np.random.Generator) -> Iterator[Observation]:
    """Yield what the frames of a drive show, beginning at a stamp [s]."""
    end = places.max() + _APART
    stamp = begin
    for y in np.arange(0, end, 2 * _APART):
        for x in np.arange(0, end, _APART / 2):
            pose = np.eye(4)
            pose[:2, 3] = x, y
            near = (np.abs(places - (x, y)) < _IN_VIEW).all(axis=1) & (
                rng.random(len(places)) < 0.85
            )
            shown = tuple(_seen(row, places[row], rng) for row in np.flatnonzero(near).tolist())
            yield Observation(stamp, pose, shown, shapely.box(x - 3, y - 3, x + 3, y + 3))
            stamp += 1


def _seen(row: int, place: np.ndarray, rng: np.random.Generator) -> ObservedObject:
    shape = shapely.Point(rng.normal(place, 0.03)).buffer(rng.normal(0.27, 0.02), 8)
    return ObservedObject(_CLASSES[row % len(_CLASSES)], rng.uniform(0.5, 1), shape, 0.1, 0.9)


def milliseconds_of(work: Callable[[], object]) -> float:
    """Return the processor's time that some work takes."""
    begin = time.process_time()
    work()
    return 1e3 * (time.process_time() - begin)


if __name__ == "__main__":
    main()
