"""How probable an object is: by its existence, the agreement of its views and their sides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
import shapely

from hypermap.mapping.evidence_buffer import EvidenceBuffer, evidence_from
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.probability import probability
from hypermap.perception.observation import Observation, ObservedObject

from .evidence_tools import ROOM, square

WHOLE = PreparedPolygon.of(square(0))


def views(*cameras_xy: tuple[float, float], shape: shapely.Polygon | None = None) -> EvidenceBuffer:
    """The evidence of views from some places."""
    buffer = EvidenceBuffer(100)
    for x, y in cameras_xy:
        pose = np.eye(4)
        pose[:2, 3] = x, y
        thing = ObservedObject("chair", 1.0, shape or square(0), 0.0, 1.0)
        ((_, evidence),) = evidence_from(Observation(0.0, pose, (thing,), ROOM))
        buffer.add(evidence)
    return buffer


@pytest.mark.parametrize("cameras_xy", [[], [(2.0, 0.0)], [(0.0, 0.0)] * 2])
def test_more_existence_is_more_probable_up_to_what_cannot_be_doubted(
    cameras_xy: Sequence[tuple[float, float]],
) -> None:
    amounts = (-1.0, 0.0, 1e-300, 1e-3, 2.0, 20.0, math.inf)
    found = [probability(existence, views(*cameras_xy), WHOLE) for existence in amounts]
    assert all(one <= other for one, other in pairwise(found))
    assert (found[0], found[-1]) == (0.0, 1.0)


def test_sides_and_agreement_make_an_object_more_probable() -> None:
    opposite, aside, one_side = (
        views((2.0, 0.0), place) for place in ((-2.0, 0.0), (0.0, 2.0), (2.0, 0.0))
    )
    angles = [buffer.angle() for buffer in (opposite, aside, one_side)]
    assert angles == pytest.approx([math.pi, math.pi / 2, 0.0], abs=1e-6)
    assert probability(3.0, opposite, WHOLE) == pytest.approx(probability(3.0, aside, WHOLE))
    assert probability(3.0, aside, WHOLE) > probability(3.0, one_side, WHOLE)

    half = views((2.0, 0.0), (2.0, 0.0), shape=shapely.box(-0.5, -0.5, 0.0, 0.5))
    assert half.agreement(WHOLE) == pytest.approx(0.5)
    assert probability(3.0, half, WHOLE) < probability(3.0, one_side, WHOLE)


def test_views_whose_outlines_cross_themselves_as_in_a_damaged_file_agree_somehow() -> None:
    crossing = shapely.Polygon([(1.5, 0.5), (0.5, 1.5), (1.5, 1.5), (0.5, 1), (1.5, 1)])
    whole = shapely.Polygon([(1, 0), (0, 0), (0, 2), (2, 2), (1, 2)])
    with pytest.raises(shapely.GEOSException):
        shapely.intersection(whole, crossing)
    buffer = views((2.0, 0.0), (3.0, 0.0))
    for item in buffer.items:
        object.__setattr__(item, "prepared", PreparedPolygon.of(whole))
    assert 0 <= buffer.agreement(PreparedPolygon.of(crossing)) <= 1
