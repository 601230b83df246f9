"""What each idea of the profile `default` brings, and which errors limit it.

Maps the same simulated drives with the profile, and with one idea after the other left out. Then
drives with one kind of error left out after the other: an error budget. Prints means over the
drives: the Jaccard index and the distance of centroids as in the 2019 thesis, and precision,
recall and F1 at an IoU of 0.25.

    python benchmarks/ablation.py [--worlds lab,floor] [--seeds 10] [--first-seed 1000] [--jobs 2]
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from dataclasses import replace

from hypermap.experiments.drives import SimulatedDrive, map_drives
from hypermap.experiments.results import WorldResult
from hypermap.mapping.config import MappingConfig, profile
from hypermap.mapping.stages import EvidenceConfig
from hypermap.simulation import (
    EXACT_DEPTH,
    EXACT_DETECTOR,
    Errors,
    PoseNoise,
    built_in_world,
    errors_of_level,
)

RATE = 2.0  # frames per second


def variants() -> dict[str, MappingConfig]:
    """Return the profile, and the profile without each of its ideas."""
    whole = profile("default")
    rules = whole.evidence
    without: Mapping[str, EvidenceConfig] = {
        "without rays": replace(rules, sight="area"),
        "without a gone object's loss": replace(rules, gone_loss=rules.loss),
        "without rival classes": replace(rules, contested=0.0),
        "without slips left out": replace(rules, slip=1.0),
        "without slack": replace(rules, slack=0.0),
        "without side by side": replace(rules, exclusive=False),
        "without walls in the vote": replace(rules, abstain="outside"),
        "without near views first": replace(rules, half_weight=math.inf),
        "without aligning": replace(rules, align=0.0),
        "best shape, no votes": replace(rules, fusion="best_shape"),
    }
    named = {name: replace(whole, evidence=changed) for name, changed in without.items()}
    seen = whole.perception
    named["without cutting at the box"] = replace(whole, perception=replace(seen, max_cut=0.0))
    named["without smoothing"] = replace(whole, perception=replace(seen, smoothing=0))
    as_given = replace(whole.alignment, enabled=False)
    named["without correcting poses"] = replace(whole, alignment=as_given)
    return {"default": whole, **named}


def budget() -> dict[str, Errors]:
    """Return the errors of a robot, without each kind of them, and without any."""
    robot = errors_of_level("robot")
    return {
        "all errors": robot,
        "perfect depth": replace(robot, depth=EXACT_DEPTH),
        "perfect poses": replace(robot, poses=PoseNoise()),
        "perfect detections": replace(robot, detector=EXACT_DETECTOR),
        "perfect detections and poses": Errors(robot.depth, PoseNoise(), EXACT_DETECTOR),
        "no errors": errors_of_level("none"),
    }


def show(world: str, name: str, result: WorldResult, method: str) -> None:
    """Print one row."""
    iou, distance = result.shape(method)
    quarter = result.found(method)["at"][0]
    figures = (iou, distance, quarter["precision"], quarter["recall"], quarter["f1"])
    columns = " ".join("    -" if value is None else f"{value:5.2f}" for value in figures)
    print(f"{world:8} {name:30} {columns}", flush=True)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", default="lab,floor")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    print("world    what                             IoU   off     P     R    F1")
    for name in arguments.worlds.split(","):
        world = built_in_world(name)
        for kind, errors in budget().items():
            methods = variants() if kind == "all errors" else {"default": profile("default")}
            drives = [SimulatedDrive(world, seed, errors, RATE) for seed in seeds]
            result = WorldResult.of(list(map_drives(drives, methods, arguments.jobs)))
            for method in methods:
                show(name, method if kind == "all errors" else kind, result, method)


if __name__ == "__main__":
    main()
