"""How well the rules of each profile map the simulated room, from the same observations.

Prints the mean IoU over the true objects, and precision and recall at an IoU of 0.5.

    python benchmarks/profiles.py [--seeds 5]
"""

from __future__ import annotations

import argparse

from hypermap.evaluation.metrics import evaluate
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.perception.observation import Observation
from hypermap.perception.observe import observe
from hypermap.simulation import SimulatedRecording, demo_world, ground_truth


def observations(seed: int) -> list[Observation]:
    """Return what the frames of one drive show, by the default perception."""
    config = profile("default").perception
    return [
        observe(frame, frame.detections, config)
        for frame in SimulatedRecording(demo_world(), seed=seed).frames()
        if frame.detections is not None
    ]


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    truth = ground_truth(demo_world())["semantic"].objects()
    for seed in range(parser.parse_args().seeds):
        seen = observations(seed)
        for name in ("thesis", "default"):
            evidence = EvidenceMap(profile(name).evidence)
            for observation in seen:
                evidence.update(observation)
            score = evaluate(evidence.objects(), truth).overall
            (at_half,) = (found for found in score.detection if found.min_iou == 0.5)
            print(
                f"seed {seed}, {name}: {len(evidence)} objects for {len(truth)}, "
                f"IoU {score.iou:.2f}, "
                f"precision {at_half.precision:.2f}, recall {at_half.recall:.2f}"
            )


if __name__ == "__main__":
    main()
