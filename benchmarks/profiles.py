"""How well a simulated room is mapped by each way to cut objects out, and by each profile's rules.

Prints means over several drives: frames per second of perception, objects in the map, the mean IoU
over the true objects, and F1 at an IoU of 0.25 and of 0.5. "organised" stands for the method of
the thesis, to which it is equal but faster.

    python benchmarks/profiles.py [--seeds 5] [--world FILE]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from hypermap.evaluation.metrics import evaluate
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.perception.config import Method, PerceptionConfig
from hypermap.perception.observation import Observation
from hypermap.perception.observe import observe
from hypermap.simulation import SimulatedRecording, World, demo_world, ground_truth, load_world

METHODS: tuple[Method, ...] = ("organised", "enclosed")


def observations(
    world: World, seed: int, config: PerceptionConfig
) -> tuple[list[Observation], float]:
    """Return what the frames of one drive show, and the seconds that it took to see it."""
    seen, seconds = [], 0.0
    for frame in SimulatedRecording(world, seed=seed).frames():
        if frame.detections is not None:
            start = time.perf_counter()
            seen.append(observe(frame, frame.detections, config))
            seconds += time.perf_counter() - start
    return seen, seconds


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--world", type=Path)
    arguments = parser.parse_args()
    world = load_world(arguments.world) if arguments.world else demo_world()
    truth = ground_truth(world)["semantic"].objects()
    print(f"{world.name}: {len(truth)} objects, {arguments.seeds} drives")
    print("method     rules    frames/s  objects   IoU  F1 at 0.25  F1 at 0.5")
    for method in METHODS:
        config = replace(profile("default").perception, method=method)
        drives = [observations(world, seed, config) for seed in range(arguments.seeds)]
        rate = sum(len(seen) for seen, _ in drives) / sum(seconds for _, seconds in drives)
        for rules in ("thesis", "default"):
            figures = []
            for seen, _ in drives:
                evidence = EvidenceMap(profile(rules).evidence)
                for observation in seen:
                    evidence.update(observation)
                score = evaluate(evidence.objects(), truth).overall
                figures.append((len(evidence), score.iou, *(d.f1 for d in score.detection)))
            objects, iou, quarter, half = np.mean(figures, axis=0)
            print(
                f"{method:10} {rules:8} {rate:8.0f} {objects:8.1f} {iou:5.2f} "
                f"{quarter:11.2f} {half:10.2f}"
            )


if __name__ == "__main__":
    main()
