"""Models of furniture: their parts are sound, and their footprints are what they should be."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from hypermap.simulation.models import MODELS, build, size_parameters
from hypermap.simulation.parts import Part, rgb
from hypermap.simulation.scene import footprint


@pytest.mark.parametrize("name", MODELS)
def test_every_part_of_a_model_is_a_closed_convex_body(name: str) -> None:
    for part in build(name, {}, None):
        mesh = trimesh.Trimesh(part.vertices, part.faces)
        assert mesh.is_watertight
        # Its volume is that of its convex hull, and positive: its faces look outwards.
        assert mesh.volume == pytest.approx(mesh.convex_hull.volume, rel=1e-6)


@pytest.mark.parametrize("name", MODELS)
def test_a_model_stands_on_its_origin_in_one_piece(name: str) -> None:
    parts = build(name, {}, None)
    z = np.concatenate([part.vertices[:, 2] for part in parts])
    assert z.min() == pytest.approx(0, abs=1e-9)
    assert isinstance(footprint(parts), shapely.Polygon)
    assert footprint(parts).covers(shapely.Point(0, 0))


@pytest.mark.parametrize("name", MODELS)
def test_every_size_has_an_effect_and_its_default_is_what_is_built(name: str) -> None:
    def shape(size: dict[str, float]) -> np.ndarray:
        return np.concatenate([part.vertices for part in build(name, size, None)])

    for key, default in size_parameters(name).items():
        assert (shape({key: default}) == shape({})).all()
        assert not np.allclose(shape({key: default * 1.1}), shape({}))


# Footprint areas worked out by hand [m2].
@pytest.mark.parametrize(
    ("name", "size", "area"),
    [
        ("chair", {}, 0.45 * 0.45),
        ("table", {"length": 0.5, "width": 2.0}, 1.0),
        ("sofa", {"length": 0.8, "width": 1.5}, 1.2),
        ("sink", {}, 0.6 * 0.8),
        # The handles stand out; next to and between the doors there are gaps.
        ("cupboard", {}, 0.45 * 1.0 + 2 * 0.02 * 0.02 - 0.02 * 0.02),
        ("lamp", {"radius": 0.3}, 24 / 2 * 0.3**2 * np.sin(2 * np.pi / 24)),  # a 24-gon
    ],
)
def test_the_footprint_of_a_model_is_the_projection_of_its_parts(
    name: str, size: dict[str, float], area: float
) -> None:
    assert footprint(build(name, size, None)).area == pytest.approx(area, rel=1e-6)


@pytest.mark.parametrize("name", ["cup", "person", "plant", "monitor"])
def test_a_footprint_agrees_with_the_projection_that_trimesh_finds(name: str) -> None:
    parts = build(name, {}, None)
    triangles = np.concatenate([part.vertices[part.faces][:, :, :2] for part in parts])
    expected = shapely.union_all(shapely.make_valid(shapely.polygons(triangles)))
    assert footprint(parts).symmetric_difference(expected).area < 1e-9


def test_a_chair_looks_along_x_and_a_monitor_shows_its_picture_there() -> None:
    chair = build("chair", {}, None)
    back = max(chair, key=lambda part: part.vertices[:, 2].max())
    assert back.vertices[:, 0].mean() < -0.1
    monitor = build("monitor", {}, None)
    picture = max(monitor, key=lambda part: part.color[2])
    assert picture.vertices[:, 0].max() == max(_right(part) for part in monitor if _is_high(part))


def test_the_color_of_a_model_is_that_of_its_main_parts() -> None:
    parts = build("chair", {}, "#0000ff")
    assert all(part.color.tolist() == [0, 0, 1] for part in parts)


@given(st.tuples(*[st.integers(0, 255)] * 3))
def test_a_color_is_read_as_written(color: tuple[int, int, int]) -> None:
    assert (rgb("#{:02x}{:02x}{:02x}".format(*color)) * 255).round().tolist() == list(color)


def _right(part: Part) -> float:
    return float(part.vertices[:, 0].max())


def _is_high(part: Part) -> bool:
    return bool(part.vertices[:, 2].min() > 0.1)
