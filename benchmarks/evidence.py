"""How many frames per second the evidence map takes in.

A camera looks at a hall with 200 objects of 20 classes; every frame shows five of them and could
have seen a quarter of the hall. Prints frames per second for each profile.

    python benchmarks/evidence.py [--frames 3000]
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import shapely

from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.perception.observation import Observation, ObservedObject

OBJECTS, CLASSES, PER_FRAME, HALL = 200, 20, 5, 20.0


def observations(count: int, rng: np.random.Generator) -> list[Observation]:
    """Return frames of five noisy footprints of some twelve corners each."""
    side = int(np.ceil(np.sqrt(OBJECTS)))
    places = np.array([(i % side, i // side) for i in range(OBJECTS)]) * HALL / side
    frames = []
    for frame in range(count):
        # Every object is shown early, so that all frames after the first forty see 200.
        first = frame * PER_FRAME
        chosen = (
            np.arange(first, first + PER_FRAME)
            if first < 4 * OBJECTS
            else rng.choice(OBJECTS, PER_FRAME, replace=False)
        ) % OBJECTS
        seen = tuple(
            ObservedObject(f"class {i % CLASSES}", rng.uniform(0.3, 1), blob(places[i], rng))
            for i in chosen
        )
        corner = rng.uniform(-1, HALL / 2, 2)
        area = shapely.box(*corner, *(corner + HALL / 2))
        pose = np.eye(4)
        pose[:2, 3] = corner
        frames.append(Observation(frame / 30, pose, seen, area))
    return frames


def blob(place: np.ndarray, rng: np.random.Generator) -> shapely.Polygon:
    """Return a footprint of about half a metre."""
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    radii = rng.uniform(0.2, 0.3, 12)
    corners = place + radii[:, np.newaxis] * np.column_stack([np.cos(angles), np.sin(angles)])
    return shapely.convex_hull(shapely.multipoints(corners + rng.normal(0, 0.03, 2)))


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=3000)
    count = parser.parse_args().frames
    for name in ("default", "thesis"):
        frames = observations(count, np.random.default_rng(1))
        evidence = EvidenceMap(profile(name).evidence)
        for frame in frames[:200]:  # compiles, and fills the map
            evidence.update(frame)
        started = time.perf_counter()
        for frame in frames[200:]:
            evidence.update(frame)
        seconds = time.perf_counter() - started
        print(f"{name}: {(count - 200) / seconds:.0f} frames/s, {len(evidence)} objects published")


if __name__ == "__main__":
    main()
