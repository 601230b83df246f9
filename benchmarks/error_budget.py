"""Which errors limit the profile `default`: an error budget.

Maps the same simulated drives with all errors of a level, and without each kind of them in turn. At
the levels `rough` and `harsh`, kinds of lasting errors are reduced to those of `robot`. Prints
means over the drives: the Jaccard index and the distance of centroids as in the 2019 thesis;
precision, recall and F1 at an IoU of 0.25; and F1 at 0.5. What each part of the profile contributes
is printed by `hypermap experiment ablation`.

    python benchmarks/error_budget.py [--worlds lab,floor] [--seeds 10] [--first-seed 1000]
                                      [--jobs 2] [--errors robot|rough|harsh] [--rate 2]
"""

from __future__ import annotations

import argparse
from dataclasses import replace

from hypermap.experiments.drives import SimulatedDrive, map_drives
from hypermap.experiments.results import WorldResult
from hypermap.mapping.config import profile
from hypermap.simulation import (
    EXACT_DEPTH,
    EXACT_DETECTOR,
    Errors,
    MapNoise,
    PoseNoise,
    built_in_world,
    errors_of_level,
    varied,
)


def budget(level: str) -> dict[str, Errors]:
    """Return the errors of a level, and the same without each kind of them."""
    whole, robot = errors_of_level(level), errors_of_level("robot")
    if level == "robot":
        return {
            "all errors": whole,
            "perfect depth": replace(whole, depth=EXACT_DEPTH),
            "perfect poses": replace(whole, poses=PoseNoise()),
            "perfect detections": replace(whole, detector=EXACT_DETECTOR),
            "perfect detections and poses": Errors(whole.depth, PoseNoise(), EXACT_DETECTOR),
            "no errors": errors_of_level("none"),
        }
    depth, poses, seen = whole.depth, whole.poses, whole.detector
    straight = replace(poses, mounting=0.0, mounting_deg=0.0)
    return {
        "all errors": whole,
        "exact map": replace(whole, map=MapNoise()),
        "map not warped": replace(whole, map=replace(whole.map, bend=0.0)),
        "depth as at robot": replace(whole, depth=robot.depth),
        "no dark surfaces": replace(whole, depth=replace(depth, dark_surfaces=0.0)),
        "no wrong scale": replace(whole, depth=replace(depth, scale=0.0)),
        "no correlated noise": replace(whole, depth=replace(depth, correlated=0.0)),
        "one clock": replace(whole, poses=replace(poses, time_offset=0.0)),
        "exact mounting": replace(whole, poses=straight),
        "perfect poses": replace(whole, poses=PoseNoise()),
        "detections as at robot": replace(whole, detector=robot.detector),
        "no lasting misses": replace(whole, detector=replace(seen, lasting_misses=0.0)),
        "no false places": replace(whole, detector=replace(seen, false_places=0)),
        "no like classes": replace(whole, detector=replace(seen, lasting_confusion=0.0)),
    }


def show(world: str, kind: str, result: WorldResult) -> None:
    """Print one row."""
    iou, distance = result.shape("default")
    quarter, half = result.found("default")["at"]
    figures = iou, distance, *(quarter[key] for key in ("precision", "recall", "f1")), half["f1"]
    columns = " ".join("    -" if value is None else f"{value:5.2f}" for value in figures)
    print(f"{world:8} {kind:30} {columns}", flush=True)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", default="lab,floor")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--rate", type=float, default=2.0, help="frames per second")
    parser.add_argument("--errors", choices=("robot", "rough", "harsh"), default="robot")
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    print("world    errors                           IoU   off     P     R    F1    F1 at 0.5")
    for name in arguments.worlds.split(","):
        world = built_in_world(name)
        for kind, errors in budget(arguments.errors).items():
            drives = [
                SimulatedDrive(varied(world, seed), seed, errors, arguments.rate) for seed in seeds
            ]
            methods = {"default": profile("default")}
            show(name, kind, WorldResult.of(list(map_drives(drives, methods, arguments.jobs))))


if __name__ == "__main__":
    main()
