"""A robot that chooses its own way by frontiers and unsure objects, beside a scripted drive.

Prints, for each way through a simulated world, how much of the floor is known and how many objects
are found after so many meters: means over seeds. Both map from depth alone, with exact poses and
the errors of camera and detector of level `fair`.

    python benchmarks/exploration.py [--worlds floor] [--seeds 2] [--every 10] [--most-meters 200]
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from hypermap.experiments.exploring import Milestone, Robot, explore, milestones
from hypermap.mapping.config import profile
from hypermap.simulation import World, built_in_world

RADIUS = 0.2
FRONTIERS, OBJECTS = "frontiers", "frontiers and unsure objects"


def ways(world: World, seed: int, most_meters: float) -> Iterator[tuple[str, World]]:
    """Yield the world with each way through it."""
    yield "scripted", world
    for name in (FRONTIERS, OBJECTS):
        robot = Robot.of_radius(RADIUS, most_meters=most_meters, looks_at_objects=name == OBJECTS)
        yield name, replace(world, drive=explore(world, robot, profile("default"), seed=seed))


def report(world: str, results: dict[str, list[Sequence[Milestone]]]) -> None:
    """Print a table: a row for each way and each part of it, means over its drives."""
    print(f"\n{world}\n\n| way | m | s | floor known | objects found | precision |")
    print("| --- | --- | --- | --- | --- | --- |")
    for way, drives in results.items():
        for i in range(max(map(len, drives))):
            # A drive that has ended stays as it was.
            reached = [each[min(i, len(each) - 1)] for each in drives]
            meters, seconds, *shares = np.mean(
                [(m.meters, m.seconds, m.area, m.objects, m.precision) for m in reached], axis=0
            )
            shown = " | ".join(f"{share:.2f}" for share in shares)
            print(f"| {way} | {meters:.0f} | {seconds:.0f} | {shown} |", flush=True)


def main() -> None:
    """Run what the arguments say."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", nargs="+", default=["floor"])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--every", type=float, default=10.0, help="meters between two rows")
    parser.add_argument("--most-meters", type=float, default=200.0)
    options = parser.parse_args()
    for name in options.worlds:
        world, began = built_in_world(name), time.perf_counter()
        results: dict[str, list[Sequence[Milestone]]] = defaultdict(list)
        for seed in range(options.seeds):
            for way, through in ways(world, seed, options.most_meters):
                found = milestones(
                    through, profile("default"), every=options.every, radius=RADIUS, seed=seed
                )
                results[way].append(list(found))
        report(name, results)
        print(f"\n{time.perf_counter() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main()
