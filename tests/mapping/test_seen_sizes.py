"""Equal things in a row that touch stay apart: no view is as large as two of them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from tests.mapping.evidence_tools import DEFAULT, published_all, seen

from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.evidence_buffer import EvidenceBuffer, evidence_from
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.seen_sizes import may_be_one
from hypermap.mapping.tracks import Track

Seen = tuple[Track, PreparedPolygon]


def strip(begin: float, end: float) -> shapely.Polygon:
    return shapely.box(begin, 0, end, 0.6)


def track(shape: BaseGeometry, *views: BaseGeometry) -> Seen:
    """A track with a shape and these views of it."""
    buffer = EvidenceBuffer(100)
    for view in views:
        ((_, evidence),) = evidence_from(seen(view))
        buffer.add(evidence)
    return Track(0, "shelf", buffer), PreparedPolygon.of(shape)


def test_shelves_in_a_row_whose_views_reach_over_the_next_one_stay_two() -> None:
    left, right, reaching = strip(0, 2.6), strip(2.7, 4.1), strip(1.4, 4.1)

    def mapped(max_growth: float) -> list[float]:
        config = published_all(dataclasses.replace(DEFAULT, max_growth=max_growth, loss=0.0))
        evidence = EvidenceMap(config)
        evidence.update(seen(left, right))
        for _ in range(6):
            evidence.update(seen(reaching, area=reaching))
        return [round(found.footprint.bounds[0], 1) for found in evidence.objects()]

    assert mapped(math.inf) == [0.0]
    assert mapped(1.3) == [0.0, 1.4]


def test_parts_that_no_frame_shows_together_become_one_that_is_hardly_longer_than_a_view() -> None:
    for end, count in ((3.3, 1), (4.1, 2)):
        evidence = EvidenceMap(published_all(dataclasses.replace(DEFAULT, loss=0.0)))
        for _ in range(3):
            evidence.update(seen(strip(0, 2.6)))
        evidence.update(seen(strip(2.1, end)))
        for _ in range(6):
            evidence.update(seen(strip(1.4, end)))
        assert len(evidence) == count


def test_the_sizes_of_views_are_those_that_are_kept() -> None:
    buffer = EvidenceBuffer(2)

    def add(shape: BaseGeometry) -> list[float]:
        ((_, evidence),) = evidence_from(seen(shape))
        buffer.add(evidence)
        return buffer.sizes[:, 1].round(6).tolist()

    assert buffer.sizes.shape == (0, 2)
    assert [add(strip(0, end)) for end in (1, 2, 3)] == [[0.6], [0.6, 1.2], [1.2, 1.8]]
    buffer.merge([track(strip(0, 4), strip(0, 4))[0].buffer])
    assert buffer.sizes[:, 1].round(6).tolist() == [1.8, 2.4]


def test_two_ends_of_a_bench_are_one_if_a_view_shows_nearly_all_of_it() -> None:
    ends = track(strip(0, 1.2), strip(0, 1.2)), track(strip(1, 2), strip(1, 2), strip(0.2, 2))
    assert may_be_one(*ends, [one for one, _ in ends], 1.3)
    apart = track(strip(0, 1.2), strip(0, 1.2)), track(strip(1, 2), strip(1, 2))
    assert not may_be_one(*apart, [one for one, _ in apart], 1.3)


def test_two_ends_of_a_bench_are_one_if_other_benches_are_as_long() -> None:
    ends = track(strip(0, 1.2), strip(0, 1.2)), track(strip(1, 2), strip(1, 2))
    other = track(strip(5, 7), *[strip(5, 7)] * 8)
    assert may_be_one(*ends, [one for one, _ in (*ends, other)], 1.3)


def test_what_is_no_longer_may_still_be_too_wide() -> None:
    front, back = shapely.box(0, 0, 2, 0.5), shapely.box(0, 0.4, 2, 0.95)
    pair = track(front, front), track(back, back)
    assert not may_be_one(*pair, [one for one, _ in pair], 1.3)
    assert may_be_one(*pair, [one for one, _ in pair], 1.5)


def test_a_large_object_takes_in_what_is_inside_of_it_even_without_views() -> None:
    none: list[Track] = []
    large, piece = track(strip(0, 4)), track(strip(0.5, 1))
    assert may_be_one(large, piece, none, 1.3)
    assert not may_be_one(track(strip(0, 2)), track(strip(2, 4)), none, 1.3)
    assert may_be_one(track(strip(0, 2)), track(strip(2, 4)), none, np.inf)
