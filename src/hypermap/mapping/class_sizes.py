"""Plausible sizes and heights of each class: a detection of another size is a false positive.

Source: Hoiem, Efros, Hebert, "Putting objects in perspective", CVPR 2006, weigh detections by how
probable the size of the object is. A depth image measures it, so wide limits do here.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

from hypermap.mapping.evidence_buffer import Evidence

# The largest of length, width and height, from that of a small one, or of what is seen of one that
# is half hidden, to that of a very large one that stands askew [m].
CLASS_SIZES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "apple": (0.03, 0.25),
        "backpack": (0.15, 1.0),
        "banana": (0.05, 0.4),
        "bed": (0.8, 3.5),
        "bench": (0.3, 6.0),
        "bin": (0.12, 1.5),
        "book": (0.06, 0.6),
        "bottle": (0.05, 0.6),
        "bowl": (0.05, 0.5),
        "cellphone": (0.04, 0.3),
        "chair": (0.25, 1.6),
        "couch": (0.5, 5.0),
        "cup": (0.03, 0.3),
        "cupboard": (0.3, 8.0),
        "desk": (0.4, 5.0),
        "diningtable": (0.3, 8.0),
        "fan": (0.1, 2.5),
        "fork": (0.05, 0.4),
        "handbag": (0.1, 1.0),
        "keyboard": (0.12, 0.8),
        "knife": (0.05, 0.6),
        "laptop": (0.12, 0.7),
        "microwave": (0.2, 1.0),
        "monitor": (0.12, 2.5),
        "mouse": (0.03, 0.3),
        "noteboard": (0.25, 6.0),
        "orange": (0.03, 0.25),
        "oven": (0.3, 2.0),
        "person": (0.25, 2.4),
        "plant": (0.08, 3.5),
        "pottedplant": (0.08, 3.5),
        "refrigerator": (0.4, 2.8),
        "remote": (0.04, 0.4),
        "scissors": (0.04, 0.4),
        "screen": (0.12, 2.5),
        "shelf": (0.3, 12.0),
        "sink": (0.15, 3.0),
        "sofa": (0.5, 5.0),
        "spoon": (0.05, 0.4),
        "suitcase": (0.2, 1.2),
        "table": (0.3, 8.0),
        "toilet": (0.25, 1.2),
        "tv": (0.12, 2.5),
        "tvmonitor": (0.12, 2.5),
        "wineglass": (0.05, 0.4),
    }
)


# Highest place of the lowest point that is seen of things that stand on the floor or on a table [m
# above the floor]; wide, as something may hide all that is below.
CLASS_LOWEST: Mapping[str, float] = MappingProxyType(
    {
        "bed": 1.0,
        "bench": 0.8,
        "bin": 0.9,
        "chair": 0.9,
        "couch": 0.9,
        "desk": 1.2,
        "diningtable": 1.2,
        "keyboard": 1.3,
        "laptop": 1.5,
        "mouse": 1.3,
        "person": 1.3,
        "sink": 1.2,
        "sofa": 0.9,
        "suitcase": 1.0,
        "table": 1.2,
        "toilet": 0.8,
    }
)
_OTHER_FLOOR = 2.4  # meters above z = 0 from which on the map has its floor elsewhere


def is_usual(name: str, evidence: Evidence) -> bool:
    """Return whether an observation is as large and as low as things of its class are."""
    return has_usual_size(name, evidence) and is_at_usual_height(name, evidence)


def has_usual_size(name: str, evidence: Evidence) -> bool:
    """Return whether an observation has a plausible size for its class.

    Args:
        name: the class. A class that is not in `CLASS_SIZES` may have any size.
        evidence: the observation.
    """
    limits = CLASS_SIZES.get(_key(name))
    if limits is None:
        return True
    xmin, ymin, xmax, ymax = evidence.prepared.box
    least, most = limits
    return least <= max(xmax - xmin, ymax - ymin, evidence.z_max - evidence.z_min) <= most


def is_at_usual_height(name: str, evidence: Evidence) -> bool:
    """Return whether an observation is as low as things of its class are.

    Args:
        name: the class. A class that is not in `CLASS_LOWEST` may be anywhere.
        evidence: the observation.
    """
    highest = CLASS_LOWEST.get(_key(name))
    return highest is None or not highest < evidence.z_min < _OTHER_FLOOR


@lru_cache
def _key(name: str) -> str:
    return name.replace(" ", "").lower()
