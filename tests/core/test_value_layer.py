"""What a value layer answers: at places, in areas, and where a quantity is above or below."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.samples import Samples
from hypermap.core.value_layer import ValueLayer, decimals_for

NAN = math.nan
GRID = GridGeometry(3, 2, 1.0)
CELLS = [[20.0, 22.0, 24.0], [20.0, NAN, 28.0]]


def warmth(cells=CELLS, **others) -> ValueLayer:
    return ValueLayer("warmth", "map", GRID, cells, "°C", **others)


@pytest.mark.parametrize(
    ("point", "value", "label"),
    [
        ((0.1, 0.9), 20, "20.0 °C"),
        ((0.99, 0.5), 20, "20.0 °C"),  # up to the edge of its cell: nothing leaks
        ((1.01, 0.5), 22, "22.0 °C"),
        ((1.5, 1.5), NAN, "Unknown"),
        ((3.0, 0.5), NAN, "Unknown"),
    ],
)
def test_a_point_has_the_value_of_its_cell(point, value, label):
    np.testing.assert_array_equal(warmth().value_at(point), [value])
    assert warmth().label_at(point).tolist() == [label]


@pytest.mark.parametrize(
    ("unit", "decimals", "label"),
    [("°C", 1, "21.5 °C"), ("dBm", 0, "21 dBm"), ("", 2, "21.46"), ("m/s", 3, "21.460 m/s")],
)
def test_a_label_is_the_rounded_value_with_its_unit(unit, decimals, label):
    layer = ValueLayer("x", "map", GridGeometry(1, 1, 1.0), [[21.46]], unit, decimals)
    assert layer.label_at([0.5, 0.5]).tolist() == [label]


@pytest.mark.parametrize(
    ("area", "count", "mean", "least", "most", "share"),
    [
        (shapely.box(0, 0, 3, 2), 5, 22.8, 20, 28, 0.4),
        (shapely.box(0, 0, 2, 1), 2, 21, 20, 22, 0),
        (shapely.box(2.6, 0.1, 2.7, 0.2), 1, 24, 24, 24, 1),  # smaller than a cell
    ],
)
def test_an_area_is_summed_up(area, count, mean, least, most, share):
    found = warmth().summary_in(area, above=22)
    assert (found.count, found.least, found.most) == (count, least, most)
    assert (found.mean, found.share) == pytest.approx((mean, share))


@pytest.mark.parametrize(
    "area", [shapely.Polygon(), shapely.box(9, 9, 10, 10), shapely.box(1, 1, 2, 2)]
)
def test_an_area_without_a_value_has_no_mean(area):
    found = warmth().summary_in(area)
    assert found.count == 0
    assert math.isnan(found.mean)
    assert math.isnan(found.share)


@given(
    cells=arrays(np.float32, (5, 7), elements=st.sampled_from([1, 2, 3, NAN])),
    x=st.floats(-5, 5),
    yaw=st.floats(-3, 3),
    above=st.sampled_from([None, 0.5, 1.0, 2.5]),
    below=st.sampled_from([3.0, 2.5, 9.0]),
)
def test_where_it_is_above_and_below_is_where_the_values_at_points_are(cells, x, yaw, above, below):
    grid = GridGeometry(7, 5, 0.5, Pose2D(x, 1.0, yaw))
    layer = ValueLayer("x", "map", grid, cells)
    places = layer.where(above=above, below=below)
    rows, cols = np.divmod(np.arange(35), 7)
    centers = grid.centers(rows, cols)
    values = layer.value_at(centers)
    expected = (values > (-np.inf if above is None else above)) & (values < below)
    assert places.is_valid
    assert shapely.contains_xy(places, centers).tolist() == expected.tolist()
    assert places.area == pytest.approx(0.25 * expected.sum())
    points, distances = layer.nearest_where([0, 0], 35, above=above, below=below)
    assert sorted(map(tuple, points)) == sorted(map(tuple, centers[expected]))
    np.testing.assert_allclose(distances, np.sort(np.hypot(*centers[expected].T)))


def test_where_and_the_nearest_heed_an_area():
    area = shapely.box(0, 1, 3, 2)
    assert warmth().where(above=19, area=area).area == 2
    (place,), (distance,) = warmth().nearest_where([2.5, 0.5], below=25, area=area)
    assert place.tolist() == [0.5, 1.5]
    assert distance == pytest.approx(math.hypot(2, 1))
    with pytest.raises(ValueError, match="expected a single point, got 2"):
        warmth().nearest_where([[2.5, 0.5], [0.5, 0.5]], below=25)


def test_where_needs_a_limit_and_an_empty_layer_is_nowhere():
    with pytest.raises(ValueError, match="give above, below or both"):
        warmth().where()
    empty = ValueLayer("x", "map")
    assert empty.where(above=1).is_empty
    assert len(empty.nearest_where([0, 0], above=1)[0]) == 0


def test_a_limit_counts_as_precisely_as_the_cells():
    layer = warmth([[21.3, 0, 0], [0, 0, 0]])
    assert layer.find(21.3).tolist() == [[0.5, 0.5]]
    assert layer.where(above=21.3).is_empty
    assert layer.where(above=21.29).area == 1
    assert layer.where(above=-1e300).area == 6


def test_deviations_and_times_are_asked_for_as_values_are():
    layer = warmth(deviations=[[0.5, 1, 1], [1, NAN, 1]], stamps=[[1e9, NAN, NAN], [NAN] * 3])
    np.testing.assert_array_equal(layer.deviation_at([[0.5, 0.5], [1.5, 1.5]]), [0.5, NAN])
    np.testing.assert_array_equal(layer.stamp_at([[0.5, 0.5], [1.5, 0.5]]), [1e9, NAN])
    np.testing.assert_array_equal(warmth().deviation_at([[0.5, 0.5]]), [NAN])


def test_a_copy_cannot_be_changed_either():
    copied = pickle.loads(pickle.dumps(warmth()))
    with pytest.raises(ValueError, match="read-only"):
        copied.cells[0, 0] = 5


def test_the_summary_says_what_is_measured():
    samples = Samples.of([[0.5, 0.5]], [20.0])
    layer = warmth(quantity="temperature", samples=samples)
    assert layer.summary() == "temperature: 20.0 to 28.0 °C of 1 sample, 3 x 2 cells of 1 m"
    assert warmth([[NAN] * 3] * 2).summary().startswith("warmth: unknown all over")


def test_the_picture_runs_from_dark_to_bright_and_leaves_out_what_is_unknown():
    picture = warmth().picture()
    assert picture is not None
    brightness = picture.rgba[..., :3].sum(axis=2).tolist()
    assert brightness[0][0] == brightness[1][0] < brightness[0][1] < brightness[0][2]
    assert (picture.rgba[..., 3] > 0).tolist() == [[True, True, True], [True, False, True]]
    assert list(picture.legend) == ["28.0 °C", "26.0 °C", "24.0 °C", "22.0 °C", "20.0 °C"]
    for label, cell in (("20.0 °C", picture.rgba[0, 0]), ("28.0 °C", picture.rgba[1, 2])):
        *color, alpha = cell.astype(float)
        on_white = np.array(color) * alpha / 255 + 255 - alpha
        np.testing.assert_allclose(picture.legend[label], on_white, atol=1)


def test_a_cell_is_the_paler_the_less_certain_it_is():
    picture = warmth(deviations=[[0.0, 1.0, 2.0], [0.0, NAN, 4.0]]).picture()
    assert picture is not None
    alpha = picture.rgba[..., 3].astype(int)
    assert alpha[0, 0] == alpha[1, 0] > alpha[0, 1] > alpha[0, 2] > alpha[1, 2] > 0 == alpha[1, 1]
    assert list(picture.legend)[-1] == "paler: less certain"

    surest = warmth().picture()
    for deviations in ([[0.5] * 3] * 2, [[NAN] * 3] * 2):  # as certain everywhere, or unknown
        picture = warmth(deviations=deviations).picture()
        assert picture is not None
        assert surest is not None
        assert picture.legend == surest.legend
        np.testing.assert_array_equal(picture.rgba, surest.rgba)


@pytest.mark.parametrize(
    ("cells", "legend"), [([[7, 7, 7], [7, 7, NAN]], ["7.0 °C"]), ([[NAN] * 3] * 2, [])]
)
def test_a_picture_of_one_value_or_none_has_a_short_legend(cells, legend):
    picture = warmth(cells).picture()
    assert picture is not None
    assert list(picture.legend) == legend


@pytest.mark.parametrize(
    ("grid", "cells", "others", "message"),
    [
        (GRID, None, {}, "layer 'x': give both a grid and its cells, or neither"),
        (None, [[1.0]], {}, "layer 'x': give both a grid and its cells, or neither"),
        (GRID, [[1.0]], {}, "cells must have shape (2, 3), got (1, 1)"),
        (GRID, np.full((2, 3), np.inf), {}, "cells must be finite, or NaN where unknown"),
        (GRID, np.full((2, 3), 1e300), {}, "cells must be finite, or NaN where unknown"),
        (GRID, CELLS, {"stamps": [1.0]}, "stamps must have shape (2, 3), got (1,)"),
        (
            GRID,
            CELLS,
            {"deviations": np.full((2, 3), -1)},
            "deviations must not be negative",
        ),
    ],
)
def test_what_is_no_grid_of_values_is_refused(grid, cells, others, message):
    with pytest.raises(ValueError) as caught:
        ValueLayer("x", "map", grid, cells, **others)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("values", "decimals"),
    [([18.2, 24.9], 2), ([-90, -30], 1), ([5, 5], 1), ([NAN], 1), ([0, 1e-20], 9), ([0, 1e7], 0)],
)
def test_as_many_decimals_are_shown_as_tell_values_apart(values, decimals):
    assert decimals_for(np.array(values)) == decimals
