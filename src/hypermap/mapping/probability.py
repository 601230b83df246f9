"""How probable it is that a track is a true object, by what its views say.

Three things tell true objects from pieces of background, shadows and leaks: how much existence they
have left after all detections and misses, how far the single footprints agree with the fused shape,
and whether they were detected from different sides.

Source: logistic regression over 1,313 objects of 47 simulated drives; docs/decisions/evidence.md.
"""

from __future__ import annotations

import math

from hypermap.mapping.evidence_buffer import EvidenceBuffer
from hypermap.mapping.prepared_polygon import PreparedPolygon

_OFFSET = -5.1
_EXISTENCE = 1.4  # for each time that existence grows e-fold
_AGREEMENT = 7.0  # for a mean IoU of 1
_ANGLE = 2.2  # for views from sides that are 90 degrees apart
_WIDEST = math.pi / 2


def probability(existence: float, buffer: EvidenceBuffer, shape: PreparedPolygon) -> float:
    """Return the probability that a track is a true object, 0..1.

    Args:
        existence: of the track.
        buffer: the evidence for it.
        shape: fused from that.
    """
    if existence <= 0:
        return 0.0
    log_odds = _OFFSET + _EXISTENCE * math.log(existence) + _AGREEMENT * buffer.agreement(shape)
    log_odds += _ANGLE * min(buffer.angle() / _WIDEST, 1.0)
    return 0.5 * (1 + math.tanh(log_odds / 2))  # the logistic function, which may not overflow
