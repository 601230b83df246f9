"""How an object's shape comes from its evidence."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.mapping.evidence_buffer import Evidence, EvidenceBuffer
from hypermap.mapping.footprint_alignment import align_footprints
from hypermap.mapping.fusion import best_shape, convex_hull, votes
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.votes import _add_steps, agreed_corners

CONFIG = EvidenceConfig()
EVERYWHERE = shapely.box(-100, -100, 100, 100)


def buffer(
    *shapes: BaseGeometry,
    areas: list[BaseGeometry] | None = None,
    scores: list[float] | None = None,
    limit: int = 100,
) -> EvidenceBuffer:
    result = EvidenceBuffer(limit)
    for i, shape in enumerate(shapes):
        result.add(
            Evidence(
                stamp=float(i),
                map_T_camera=np.eye(4),
                prepared_area=PreparedPolygon.of(areas[i] if areas else EVERYWHERE),
                score=scores[i] if scores else 1.0,
                prepared=PreparedPolygon.of(shape),
                centroid_xy=np.array([shape.centroid.x, shape.centroid.y]),
                z_min=0.1 * i,
                z_max=1.0 + 0.1 * i,
            )
        )
    return result


def square(x: float, y: float = 0.0, side: float = 1.0) -> shapely.Polygon:
    return shapely.box(x - side / 2, y - side / 2, x + side / 2, y + side / 2)


def iou(fused: PreparedPolygon, b: BaseGeometry) -> float:
    a = fused.geometry
    return a.intersection(b).area / a.union(b).area


def test_best_shape_is_nearest_to_the_mean_centroid_and_not_the_newest() -> None:
    # Centroids at x = 0, 0.5 and 4: their mean is 1.5, and 0.5 is the nearest to it.
    shapes = [square(0), square(0.5, side=0.7), square(4)]
    assert best_shape(buffer(*shapes), CONFIG).geometry is shapes[1]
    upright = [shapely.transform(shape, lambda xy: xy[:, ::-1]) for shape in shapes]
    assert best_shape(buffer(*upright), CONFIG).geometry is upright[1]


seeds = st.integers(0, 2**32 - 1)


def any_hull(rng: np.random.Generator) -> BaseGeometry:
    return shapely.MultiPoint(rng.uniform(-3, 13, (rng.integers(3, 7), 2))).convex_hull


@given(seeds)
def test_best_shape_is_that_of_measuring_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = [any_hull(rng) for _ in range(rng.integers(3, 7))]  # two would be equally near
    centroids = shapely.get_coordinates(shapely.centroid(shapes))
    nearest = np.hypot(*(centroids - centroids.mean(axis=0)).T).argmin()
    assert best_shape(buffer(*shapes), CONFIG).geometry is shapes[nearest]


def test_of_equally_good_shapes_the_oldest_is_kept() -> None:
    shapes = [square(-1), square(1)]
    assert best_shape(buffer(*shapes), CONFIG).geometry is shapes[0]


def test_the_convex_hull_covers_all_shapes() -> None:
    hull = convex_hull(buffer(square(0), square(3, side=0.5)), CONFIG).geometry
    # Worked out by hand: corners (-0.5, +-0.5) and (3.25, +-0.25) and what lies between them.
    expected = shapely.Polygon(
        [(-0.5, -0.5), (0.5, -0.5), (3.25, -0.25), (3.25, 0.25), (0.5, 0.5), (-0.5, 0.5)]
    )
    assert hull.equals(expected)


def test_votes_leave_out_what_few_views_show() -> None:
    good = [square(0)] * 9
    fused = votes(buffer(*good, square(2, side=3)), CONFIG)
    assert iou(fused, square(0)) > 0.95


def test_votes_keep_what_enough_views_show() -> None:
    left, right = shapely.box(0, 0, 1, 1), shapely.box(1, 0, 2, 1)
    fused = votes(buffer(left, right, left, right), CONFIG)
    assert iou(fused, shapely.box(0, 0, 2, 1)) > 0.95


def test_a_view_does_not_vote_on_what_it_could_not_see() -> None:
    table, corner = shapely.box(0, 0, 2, 1), shapely.box(0, 0, 0.4, 1)
    edge_of_image = shapely.box(-5, -5, 0.4, 5)
    shapes, areas = [table] + [corner] * 9, [EVERYWHERE] + [edge_of_image] * 9
    assert iou(votes(buffer(*shapes, areas=areas), CONFIG), table) > 0.95
    seen_everywhere = votes(buffer(*shapes), CONFIG)
    assert iou(seen_everywhere, corner) > 0.9


def test_an_empty_observed_area_abstains_from_nothing() -> None:
    shapes = [square(0)] * 9 + [square(2, side=3)]
    fused = votes(buffer(*shapes, areas=[shapely.Polygon()] * 10), CONFIG)
    assert iou(fused, square(0)) > 0.95


def test_votes_weigh_by_score() -> None:
    small, large = square(0, side=1), square(0, side=2)
    shapes = [small, large]
    assert iou(votes(buffer(*shapes, scores=[0.9, 0.1]), CONFIG), small) > 0.9
    assert iou(votes(buffer(*shapes, scores=[0.5, 0.5]), CONFIG), large) > 0.9


def test_votes_with_scores_of_zero_count_alike() -> None:
    assert iou(votes(buffer(square(0), square(0), scores=[0.0, 0.0]), CONFIG), square(0)) > 0.9


def test_a_shape_smaller_than_a_cell_stays_as_it_is() -> None:
    tiny = square(0.0101, 0.0099, side=0.0001)
    assert votes(buffer(tiny), CONFIG).area > 0


def test_votes_on_a_huge_shape_take_coarser_cells() -> None:
    huge = shapely.box(0, 0, 1000, 10)
    assert iou(votes(buffer(huge), CONFIG), huge) > 0.5


@pytest.mark.parametrize("fuse", [best_shape, convex_hull, votes])
def test_one_shape_is_its_own_fusion(fuse: object) -> None:
    triangle = shapely.Polygon([(0, 0), (1, 0), (0.5, 1)])
    assert iou(fuse(buffer(triangle), CONFIG), triangle) > 0.9


def test_only_the_newest_evidence_is_kept_but_all_is_counted() -> None:
    full = buffer(*(square(i) for i in range(5)), limit=3)
    assert [evidence.stamp for evidence in full.items] == [2, 3, 4]
    assert full.centroids[:, 0].tolist() == [2, 3, 4]
    assert (full.count, full.first_seen, full.last_seen) == (5, 0, 4)
    assert full.heights() == pytest.approx((0.3, 1.3))


def test_merged_evidence_is_in_order_of_time() -> None:
    first, second = buffer(square(0), square(1)), buffer(square(5), square(6))
    first.merge([second])
    assert [evidence.stamp for evidence in first.items] == [0, 0, 1, 1]
    assert first.count == 4


def test_of_merged_evidence_the_newest_is_kept_and_all_is_counted() -> None:
    first, second = buffer(square(0), square(1), square(2), limit=3), buffer(square(5), square(6))
    first.merge([second])  # their stamps are 0, 1, 2 and 0, 1
    assert [evidence.stamp for evidence in first.items] == [1, 1, 2]
    assert sorted(first.centroids[:, 0].tolist()) == [1, 2, 6]
    assert (first.count, first.first_seen, first.last_seen) == (5, 0, 2)


coordinates = st.integers(-30, 130).map(lambda n: n / 10 + 0.05)
points = st.tuples(coordinates, coordinates)


@given(
    corners=st.lists(points, min_size=3, max_size=8),
    reverse=st.booleans(),
    hole=st.booleans(),
)
def test_votes_are_counted_as_shapely_decides_about_each_cell(
    corners: list[tuple[float, float]], reverse: bool, hole: bool
) -> None:
    grid = GridGeometry(width=10, height=10, resolution=1.0, origin=Pose2D(0.0, 0.0))
    polygon: BaseGeometry = shapely.MultiPoint(corners).convex_hull
    if hole:
        polygon = polygon.difference(shapely.box(3.3, 3.3, 6.7, 6.7))
    if polygon.area == 0 or not isinstance(polygon, shapely.Polygon | shapely.MultiPolygon):
        return
    polygon = polygon.reverse() if reverse else polygon
    each = PreparedPolygon.of(polygon).edges
    edges, counts = np.vstack([each, each]), np.full((2, 2), len(each))
    weights, steps = np.array([1.0, 2.0]), np.zeros((grid.width + 1, grid.height))
    place = (0.0, 0.0, 1.0)
    _add_steps(edges, counts, 0, weights, np.zeros((2, 2)), 1.0, grid.shape, place, steps)
    counted = np.cumsum(steps[:-1], axis=0).T
    rows, cols = np.indices(grid.shape)
    centers = shapely.points(grid.centers(rows.ravel(), cols.ravel()))
    clear = shapely.distance(centers, polygon.boundary) > 1e-9
    covered = shapely.covers(polygon, centers)
    assert counted.ravel()[clear] == pytest.approx(3.0 * covered[clear])


ROWS, COLS = (side.ravel() for side in np.indices((18, 18)) - 4)  # cells of 1 m around all shapes
CENTERS = shapely.points(COLS + 0.5, ROWS + 0.5)


@given(seed=seeds, share=st.sampled_from([0.3, 0.5, 1.0]), half_weight=st.sampled_from([2, np.inf]))
def test_the_shape_is_the_hull_of_the_cells_that_get_their_share_of_the_votes(
    seed: int, share: float, half_weight: float
) -> None:
    rng = np.random.default_rng(seed)
    count = rng.integers(1, 6)
    shapes, areas = ([any_hull(rng) for _ in range(count)] for _ in range(2))
    areas = [area if rng.random() < 0.7 else shapely.Polygon() for area in areas]
    scores = rng.choice([0, 0.25, 0.5, 1], count).tolist()
    seen = buffer(*shapes, areas=areas, scores=scores)
    votes_for, votes_cast = np.zeros((2, len(CENTERS)))
    for k, (shape, area, score) in enumerate(zip(shapes, areas, scores, strict=True)):
        away = rng.integers(6)
        camera = np.eye(4)
        camera[:2, 3] = shape.centroid.x, shape.centroid.y + away
        seen.items[k] = dataclasses.replace(seen.items[k], map_T_camera=camera)
        weight = (score if any(scores) else 1) / (1 + (away / half_weight) ** 2)
        votes_for += weight * shapely.contains(shape, CENTERS)
        votes_cast += weight * (shapely.contains(area, CENTERS) | area.is_empty)
    needed = share * np.maximum(votes_for, votes_cast)
    chosen = (votes_for > 0) & (votes_for >= needed - 1e-9)
    assume(chosen.any())
    cells = shapely.box(COLS[chosen], ROWS[chosen], COLS[chosen] + 1, ROWS[chosen] + 1)

    config = dataclasses.replace(
        CONFIG, vote_resolution=1.0, vote_share=share, half_weight=half_weight, align=0.0
    )
    hull = shapely.union_all(cells).convex_hull
    assert shapely.hausdorff_distance(votes(seen, config).geometry, hull) < 1e-6


@given(seed=seeds)
def test_edges_of_visible_areas_that_are_far_away_do_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = rng.uniform(-0.3, 0.3, (4, 2)).tolist()
    shapes = [square(x, y, side=0.2) for x, y in places]
    around = [shapely.Point(*rng.uniform(-2, 2, 2)).buffer(rng.uniform(0.2, 3)) for _ in places]
    seen = buffer(*shapes, areas=around)
    found = agreed_corners(seen, CONFIG)
    few = len(seen.views.near)
    seen.views.look_at((-np.inf, -np.inf, np.inf, np.inf), seen.items)
    assert few < len(seen.views.near) == sum(len(item.prepared_area.edges) for item in seen.items)
    np.testing.assert_array_equal(found, agreed_corners(seen, CONFIG))


@given(seed=seeds)
def test_shapes_do_not_depend_on_when_they_were_fused_before(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = [square(*rng.uniform(-0.3, 0.3, 2), side=0.2) for _ in range(9)]
    shapes[4] = square(5, 5, side=0.1)  # the grid is far from the other footprints meanwhile
    areas = [shapely.Point(*rng.uniform(-2, 2, 2)).buffer(3, quad_segs=3) for _ in shapes]
    areas[2] = shapely.Polygon()
    growing = EvidenceBuffer(4)
    for number, item in enumerate(buffer(*shapes, areas=areas).items):
        growing.add(item)
        kept = buffer(*shapes[: number + 1], areas=areas[: number + 1], limit=4)
        assert growing.copy().views is not growing.views
        np.testing.assert_array_equal(agreed_corners(growing, CONFIG), agreed_corners(kept, CONFIG))


def test_votes_may_have_whole_numbers_as_scores() -> None:
    assert iou(votes(buffer(square(0), scores=[1]), CONFIG), square(0)) > 0.9


def aligning_moves(
    areas: np.ndarray, centroids: np.ndarray, weights: np.ndarray | None = None
) -> np.ndarray:
    moves, order = np.zeros(centroids.shape), np.empty(len(areas), np.int64)
    weights = np.ones(len(areas)) if weights is None else weights
    align_footprints(areas[:, np.newaxis], 0, centroids, weights, 0.1, order, moves)
    return moves


def test_footprints_that_show_a_part_are_not_aligned() -> None:
    centroids = np.array([[0.0, 0.0], [0.02, 0.0], [0.06, 0.0], [0.05, 0.0]])
    areas = np.array([1.0, 1.0, 1.0, 0.5])
    moves = aligning_moves(areas, centroids)
    meeting = (centroids + moves)[:3]
    assert np.allclose(meeting, meeting[0])
    assert 0 < meeting[0, 0] < 0.03
    assert (moves[3] == 0).all()


def test_a_footprint_well_below_the_area_of_most_is_a_part() -> None:
    areas = np.array([1.5, 2.0, 4.0])  # a quarter of such areas exceed 3; 0.6 of it is 1.8
    centroids = np.array([[0.0, 0.0], [0.02, 0.01], [0.06, 0.03]])
    moves = aligning_moves(areas, centroids)
    assert moves == pytest.approx(np.array([[0, 0], [0.02, 0.01], [-0.02, -0.01]]))


def test_footprints_are_aligned_to_a_mean_that_does_not_jump() -> None:
    centroids = np.array([[0.0, 0.0]] * 3 + [[0.03, 0.0]] * 3)
    less, more = (
        aligning_moves(np.ones(6), centroids, np.array([weight, *[1.0] * 5]))
        for weight in (0.99, 1.01)
    )
    assert np.abs(more - less).max() < 1e-3


def test_where_most_footprints_agree_the_others_hardly_matter() -> None:
    centroids = np.array([[0.0, 0.0]] * 6 + [[0.2, 0.0]] * 2)
    moves = aligning_moves(np.ones(8), centroids)
    assert np.abs(moves[:6]).max() < 0.005
    assert (moves[6:] == 0).all()


def test_the_shape_of_a_cup_hardly_depends_on_where_cells_begin() -> None:
    for offset in np.linspace(0, 0.01, 7):
        cup = shapely.Point(1 + offset, 2 - offset / 3).buffer(0.04)
        assert iou(votes(buffer(*[cup] * 3), CONFIG), cup) > 0.9


@pytest.mark.parametrize("along", [(1, 0), (0, 1), (1, -1)])
def test_drifting_footprints_are_aligned_before_they_vote(along: tuple[int, int]) -> None:
    drifts = (0.0, 0.03, -0.03, 0.05, -0.05)
    shapes = [square(along[0] * far, along[1] * far, side=0.1) for far in drifts]
    assert iou(votes(buffer(*shapes), CONFIG), square(0, side=0.1)) > 0.95
    apart = votes(buffer(*shapes), dataclasses.replace(CONFIG, align=0.0))
    assert iou(apart, square(0, side=0.1)) < 0.7


def test_votes_are_as_fine_far_away_from_where_the_map_begins() -> None:
    for x, y in [(50, 70), (-30, 40), (5, -8)]:
        assert iou(votes(buffer(square(x, y)), CONFIG), square(x, y)) > 0.95


def test_a_clock_that_was_not_set_does_not_change_when_an_object_was_first_seen() -> None:
    full = buffer(square(0))
    for stamp, first in ((1.8e9, 0.0), (1.0, 0.0)):
        full.add(dataclasses.replace(full.items[0], stamp=stamp))
        assert (full.first_seen, full.last_seen) == (first, 1.8e9)
    dated = EvidenceBuffer(100)
    for stamp in (1.8e9, 1.0, 1.7e9):
        dated.add(dataclasses.replace(full.items[0], stamp=stamp))
    assert (dated.first_seen, dated.last_seen) == (1.7e9, 1.8e9)


@given(st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)), min_size=1, max_size=12))
def test_aligning_moves_footprints_no_farther_than_its_limit(
    places: list[tuple[float, float]],
) -> None:
    centroids, ones = np.array(places), np.ones(len(places))
    moves = aligning_moves(0.04 * ones, centroids)
    steps = np.hypot(*moves.T)
    assert (steps <= 0.1 + 1e-9).all()
    together = (centroids + moves)[steps > 1e-9]
    assert np.allclose(together, together[:1])


def test_near_views_weigh_more() -> None:
    near, far = square(0, side=0.4), square(1, side=0.4)
    away = np.eye(4)
    away[0, 3] = 8.0
    seen = buffer(near, far, far)
    seen.items[1:] = [
        dataclasses.replace(evidence, map_T_camera=away) for evidence in seen.items[1:]
    ]
    config = dataclasses.replace(CONFIG, align=0.0)
    assert not votes(seen, config).geometry.intersects(far)
    assert votes(seen, dataclasses.replace(config, half_weight=np.inf)).geometry.intersects(far)
