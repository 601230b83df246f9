"""What each idea of the profile `default` contributes, and which errors limit it.

Maps the same simulated drives with the profile, and without each of its ideas in turn. Then
drives without each kind of error in turn: an error budget. At the levels `rough` and
`harsh`, kinds of lasting errors are reduced to those of `robot`. Prints means over the drives: the
Jaccard index and the distance of centroids as in the 2019 thesis; precision, recall and F1 at an
IoU of 0.25; and F1 at 0.5. `--ideas` compares some of the ideas alone, without the error budget.

    python benchmarks/ablation.py [--worlds lab,floor] [--seeds 10] [--first-seed 1000] [--jobs 2]
                                  [--errors robot|rough|harsh] [--no-ideas] [--rate 2]
                                  [--ideas "default,without landmarks"]
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
    MapNoise,
    PoseNoise,
    built_in_world,
    errors_of_level,
    varied,
)


def variants() -> dict[str, MappingConfig]:
    """Return the profile, and the profile without each of its ideas."""
    whole = profile("default")
    rules = whole.evidence
    without: Mapping[str, EvidenceConfig] = {
        "without rays": replace(rules, sight="area"),
        "without see-throughs": replace(rules, gone_loss=rules.loss),
        "without conflicts": replace(rules, contested=0.0),
        "without misclassifications": replace(rules, slip=1.0),
        "without tolerance": replace(rules, slack=0.0),
        "without co-occurrence": replace(rules, exclusive=False),
        "without walls in the vote": replace(rules, abstain="outside"),
        "without near views weighted": replace(rules, half_weight=math.inf),
        "without aligning": replace(rules, align=0.0),
        "best shape, no votes": replace(rules, fusion="best_shape"),
        "without class sizes": replace(rules, class_sizes="any"),
        "without landmarks": replace(rules, landmarks=False),
        "without completion": replace(rules, completion="none"),
    }
    named = {name: replace(whole, evidence=changed) for name, changed in without.items()}
    seen = whole.perception
    named["without cutting at the box"] = replace(whole, perception=replace(seen, max_cut=0.0))
    named["without smoothing"] = replace(whole, perception=replace(seen, smoothing=0))
    named["with pieces of the floor"] = replace(whole, perception=replace(seen, min_top=0.0))
    as_given = replace(whole.alignment, enabled=False)
    named["without correcting poses"] = replace(whole, alignment=as_given)
    return {"default": whole, **named}


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


def show(world: str, name: str, result: WorldResult, method: str) -> None:
    """Print one row."""
    iou, distance = result.shape(method)
    quarter, half = result.found(method)["at"]
    figures = iou, distance, *(quarter[key] for key in ("precision", "recall", "f1")), half["f1"]
    columns = " ".join("    -" if value is None else f"{value:5.2f}" for value in figures)
    print(f"{world:8} {name:30} {columns}", flush=True)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", default="lab,floor")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--rate", type=float, default=2.0, help="frames per second")
    parser.add_argument("--errors", choices=("robot", "rough", "harsh"), default="robot")
    parser.add_argument("--no-ideas", action="store_true", help="only the error budget")
    parser.add_argument("--ideas", help="only these rows, with commas between them, and no budget")
    arguments = parser.parse_args()
    ideas = variants()
    if arguments.ideas:
        ideas = {name: ideas[name] for name in arguments.ideas.split(",")}
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    print("world    what                             IoU   off     P     R    F1    F1 at 0.5")
    for name in arguments.worlds.split(","):
        world = built_in_world(name)
        for kind, errors in budget(arguments.errors).items():
            if arguments.ideas and kind != "all errors":
                continue
            is_whole = kind == "all errors" and not arguments.no_ideas
            methods = ideas if is_whole else {"default": profile("default")}
            drives = [
                SimulatedDrive(varied(world, seed), seed, errors, arguments.rate) for seed in seeds
            ]
            result = WorldResult.of(list(map_drives(drives, methods, arguments.jobs)))
            for method in methods:
                show(name, method if is_whole else kind, result, method)


if __name__ == "__main__":
    main()
