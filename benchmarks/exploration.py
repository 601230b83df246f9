"""A robot that chooses its own way by frontiers and unsure objects, beside a scripted drive.

Prints, for each way through a simulated world, how much of the floor is known and how many objects
are found after so many meters: means over seeds. Both map from depth alone, with exact poses and
the errors of camera and detector of level `fair`.

    python benchmarks/exploration.py [--worlds floor] [--seeds 1] [--every 10] [--most-meters 150]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from hypermap.experiments.exploring import Milestone, Robot, explore, milestones
from hypermap.mapping.config import profile
from hypermap.simulation import World, built_in_world

RADIUS = 0.2
CONFIG = profile("default")
SCRIPTED, FRONTIERS, OBJECTS = "scripted", "frontiers", "frontiers and unsure objects"


def drive(way: str, world: World, seed: int, every: float, most_meters: float) -> list[Milestone]:
    """Return what is known on a way through a world."""
    if way == SCRIPTED:
        return list(milestones(world, CONFIG, every=every, radius=RADIUS, seed=seed))
    robot = Robot(RADIUS, most_meters=most_meters, looks_at_objects=way == OBJECTS)
    return list(explore(world, robot, CONFIG, every=every, seed=seed).milestones)


def report(way: str, drives: Sequence[Sequence[Milestone]]) -> None:
    """Print a row for each part of a way, means over its drives."""
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
    parser.add_argument("--ways", nargs="+", default=[SCRIPTED, FRONTIERS, OBJECTS])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--every", type=float, default=10.0, help="meters between two rows")
    parser.add_argument("--most-meters", type=float, default=150.0)
    options = parser.parse_args()
    for name in options.worlds:
        world = built_in_world(name)
        print(f"\n{name}\n\n| way | m | s | floor known | objects found | precision |")
        print("| --- | --- | --- | --- | --- | --- |", flush=True)
        for way in options.ways:
            seeds = range(options.seeds)
            report(
                way,
                [drive(way, world, seed, options.every, options.most_meters) for seed in seeds],
            )


if __name__ == "__main__":
    main()
