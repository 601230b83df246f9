"""Where a lens shows points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.perception.lens import EQUIDISTANT, PLUMB_BOB, RATIONAL, Lens

# A Kinect's color camera, one of an Azure Kinect's kind, and a fisheye.
KINECT = Lens(PLUMB_BOB, (0.2624, -0.9531, -0.0054, 0.0026, 1.1633))
AZURE = Lens(RATIONAL, (0.4517, -2.5146, 0.00063, -0.00033, 1.4635, 0.3313, -2.3399, 1.3908))
THIN = Lens(RATIONAL, (*AZURE.coefficients, 0.001, -0.002, 0.0015, 0.0005))
FISHEYE = Lens(EQUIDISTANT, (-0.0136, 0.0205, -0.0112, 0.0021))
K = np.array([[525.0, 0, 319.5], [0, 525.0, 239.5], [0, 0, 1]])


@pytest.mark.parametrize(
    ("lens", "points", "pixels"),  # as OpenCV 5.0 projects them: projectPoints, of fisheye the last
    [
        (KINECT, [(0.3, -0.2), (-0.45, 0.35)], [(481.001610, 131.582010), (79.341257, 425.713800)]),
        (AZURE, [(0.3, -0.2), (-0.45, 0.35)], [(478.918701, 133.248849), (76.991785, 428.181201)]),
        (THIN, [(0.3, -0.2), (-0.45, 0.35)], [(478.969205, 133.355660), (77.051503, 428.464865)]),
        (FISHEYE, [(0.3, -0.2), (-1, 0.7)], [(470.457851, 138.861433), (-59.878633, 505.065043)]),
    ],
)
def test_points_are_where_opencv_projects_them(
    lens: Lens, points: list[tuple[float, float]], pixels: list[tuple[float, float]]
) -> None:
    shown = (np.array(pixels) - K[:2, 2]) / K[[0, 1], [0, 1]]
    np.testing.assert_allclose(lens.distorted(np.array(points)), shown, atol=1e-8)
    np.testing.assert_allclose(lens.undistorted(shown), points, atol=1e-8)


@given(
    k1=st.floats(-0.3, 0.3),
    k2=st.floats(-0.1, 0.1),
    p=st.tuples(st.floats(-0.003, 0.003), st.floats(-0.003, 0.003)),
    at=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.4, 0.4)),
)
def test_what_is_found_is_shown_there(
    k1: float, k2: float, p: tuple[float, float], at: tuple[float, float]
) -> None:
    x, y = at
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2 * r2
    u = x * radial + 2 * p[0] * x * y + p[1] * (r2 + 2 * x * x)
    v = y * radial + p[0] * (r2 + 2 * y * y) + 2 * p[1] * x * y
    found = Lens(PLUMB_BOB, (k1, k2, *p)).undistorted(np.array([[u, v]]))
    np.testing.assert_allclose(found[0], at, atol=1e-7)


def test_beyond_where_a_polynomial_turns_back_nothing_is_shown() -> None:
    lens = Lens(PLUMB_BOB, (-0.9, 0.0, 0.0, 0.0, 0.0))  # turns back at 0.609, shown at 0.406
    shown = lens.distorted(np.array([[0.6, 0.0], [0.62, 0.0], [0.0, -0.6], [0.5, 0.5]]))
    assert np.isfinite(shown).all(axis=1).tolist() == [True, False, True, False]
    found = lens.undistorted(np.array([[0.4, 0.0], [0.41, 0.0]]))
    assert np.isfinite(found).all(axis=1).tolist() == [True, False]
    assert 0.5 < found[0, 0] < 0.609


@pytest.mark.parametrize("lens", [KINECT, AZURE, FISHEYE, Lens(PLUMB_BOB, (-0.9, 0, 0, 0))])
@given(far=st.lists(st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)), max_size=3))
def test_a_point_is_found_whatever_others_are_asked_for(
    lens: Lens, far: list[tuple[float, float]]
) -> None:
    near = [(0.3, -0.2), (-0.1, 0.0)]
    together = np.array([*near, *far])
    for ask in (lens.distorted, lens.undistorted):
        np.testing.assert_allclose(ask(together)[:2], ask(np.array(near)), atol=1e-9)


def test_the_number_of_coefficients_tells_which_they_are() -> None:
    points = np.array([(0.3, -0.2), (-0.45, 0.35)])
    named = Lens(PLUMB_BOB, AZURE.coefficients), Lens(RATIONAL, KINECT.coefficients)
    np.testing.assert_array_equal(named[0].distorted(points), AZURE.distorted(points))
    np.testing.assert_array_equal(named[1].distorted(points), KINECT.distorted(points))
    padded = Lens(RATIONAL, (*THIN.coefficients, 0.0, 0.0))
    np.testing.assert_array_equal(padded.distorted(points), THIN.distorted(points))


@pytest.mark.parametrize(
    ("model", "coefficients", "message"),
    [
        ("", (0.1, 0, 0, 0, 0), "the known models are plumb_bob, rational_polynomial, equidistant"),
        (PLUMB_BOB, (0.1,), "plumb_bob has 4 or 5 or 8 or 12 or 14 coefficients, got 1"),
        (RATIONAL, (0.1,) * 14, "sensors not tilted"),
        (EQUIDISTANT, (0.1, float("nan"), 0, 0), "must be finite"),
    ],
)
def test_other_lenses_are_refused(
    model: str, coefficients: tuple[float, ...], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Lens(model, coefficients)
