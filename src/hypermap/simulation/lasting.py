"""What a detector gets wrong the whole drive long: things it never finds, or takes for others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray

if TYPE_CHECKING:
    from hypermap.simulation.detector import DetectorNoise

# Classes that detectors trained on COCO take for each other, as they look alike.
ALIKE = (
    ("tvmonitor", "monitor", "screen", "laptop"),
    ("chair", "bench", "sofa"),
    ("table", "diningtable", "bench"),
    ("cup", "bowl", "bottle"),
    ("cupboard", "shelf", "refrigerator"),
    ("plant", "pottedplant", "vase"),
    ("noteboard", "panel", "map", "tvmonitor"),
    ("keyboard", "remote"),
    ("mouse", "cell phone"),
    ("bin", "suitcase", "box"),
    ("box", "suitcase"),
    ("fan", "clock"),
    ("lamp", "umbrella"),
    ("sofa", "bed"),
    ("sink", "toilet"),
)


@dataclass(frozen=True, eq=False)
class LastingFaults:
    """What is wrong with how a detector sees each thing.

    Attributes:
        is_hard: whether it hardly ever finds the thing, shape (N,).
        aliases: the like class that it often takes the thing for; empty for none, N of them.
    """

    is_hard: BoolArray
    aliases: tuple[str, ...]

    @classmethod
    def draw(
        cls,
        names: Sequence[str],
        sizes: NDArray[np.float64],
        noise: DetectorNoise,
        rng: np.random.Generator,
    ) -> LastingFaults:
        """Draw them for things with these classes and largest sides [m]."""
        chance = noise.lasting_misses * np.minimum(1, noise.hard_size / np.maximum(sizes, 1e-3))
        is_hard = rng.random(len(names)) < chance
        is_confused = rng.random(len(names)) < noise.lasting_confusion
        aliases = [_alias(name, rng) for name in names]
        taken = [alias if is_so else "" for alias, is_so in zip(aliases, is_confused, strict=True)]
        return cls(is_hard, tuple(taken))


def like_classes(name: str) -> list[str]:
    """Return the classes that look like one, in alphabetical order.

    >>> like_classes("chair")
    ['bench', 'sofa']
    """
    return sorted({other for group in ALIKE if name in group for other in group} - {name})


def _alias(name: str, rng: np.random.Generator) -> str:
    """Return a class that looks like another; empty if there is none."""
    place = rng.random()  # one number for each, whatever there is to choose from
    likes = like_classes(name)
    return likes[int(place * len(likes))] if likes else ""
