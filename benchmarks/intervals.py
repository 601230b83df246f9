"""How often intervals of 95 % hold the true mean of few differences, by how they are computed.

Draws many samples from known distributions: normal, skewed (exponential), and in steps, as the
recall of 28 objects is. Prints the share of the intervals that hold the mean.

    python benchmarks/intervals.py [--samples 4000]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from hypermap.evaluation import effect_of

Array = NDArray[np.float64]
_RESAMPLES = 1000
_SLACK = 1e-12  # against rounding

DISTRIBUTIONS: Mapping[str, Callable[[np.random.Generator, int], Array]] = {
    "normal": lambda rng, n: rng.normal(size=n),
    "exponential": lambda rng, n: rng.exponential(size=n) - 1,
    "steps": lambda rng, n: rng.binomial(28, 0.1, n) / 28 - 0.1,
}


def intervals(sample: Array, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return the interval of the percentile bootstrap, of BCa (Efron 1987), and Student's."""
    n, mean = len(sample), sample.mean()
    means = sample[rng.integers(n, size=(_RESAMPLES, n))].mean(axis=1)
    levels = np.array([0.025, 0.975])
    below = np.clip((np.mean(means < mean) + np.mean(means <= mean)) / 2, 1e-3, 1 - 1e-3)
    left_out = (sample.sum() - sample) / (n - 1)
    skew = left_out.mean() - left_out
    squares = float((skew**2).sum())
    acceleration = float((skew**3).sum()) / (6 * squares**1.5) if squares > 0 else 0.0
    z = ndtri(below) + ndtri(levels)
    corrected = ndtr(ndtri(below) + z / (1 - acceleration * z))
    effect = effect_of(sample)
    percentile, bca = (np.quantile(means, at).tolist() for at in (levels, corrected))
    return [(percentile[0], percentile[1]), (bca[0], bca[1]), (effect.low, effect.high)]


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=4000)
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    print("distribution  differences  percentile    BCa  Student")
    for name, draw in DISTRIBUTIONS.items():
        for count in (3, 5, 10, 20):
            holds = [
                [low - _SLACK <= 0 <= high + _SLACK for low, high in intervals(sample, rng)]
                for sample in (draw(rng, count) for _ in range(arguments.samples))
            ]
            shares = "   ".join(f"{share:6.3f}" for share in np.mean(holds, axis=0))
            print(f"{name:12}  {count:11}      {shares}", flush=True)


if __name__ == "__main__":
    main()
