"""`hypermap map --value`: what other sensors have measured becomes layers of the map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hypermap import ValueLayer, open_map

from ..prepared import run
from ..recordings.bag_builder import BagBuilder, add_images, add_poses, header
from ..recordings.shots import HEIGHT, WIDTH, make_shots, write_tum
from .conftest import assert_one_error

pytestmark = pytest.mark.xdist_group("map_values")  # they share what takes long to make

SHOTS = make_shots(8)
WARMTH = ["--value", "/warmth,unit=degF"]


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A drive with a thermometer at the camera, a radio that falls silent, and others."""
    with BagBuilder(tmp_path_factory.mktemp("drive"), "ros1") as bag:
        add_poses(bag, SHOTS)
        for number, shot in enumerate(SHOTS):
            add_images(bag, shot)
            values = {"header": header(shot.stamp), "temperature": 20.0 + number}
            bag.add("/warmth", "sensor_msgs/msg/Temperature", shot.stamp, values)
            level = {"header": header(shot.stamp), "point": {"x": -60.0 - 8 * number}}
            bag.add("/radio", "geometry_msgs/msg/PointStamped", shot.stamp, level)
            silent = {"data": float("nan")}
            bag.add("/silent", "std_msgs/msg/Float32", shot.stamp, silent)
        bag.add("/once", "std_msgs/msg/Float32", SHOTS[0].stamp, {"data": 7.0})
    return bag.path


@pytest.fixture(scope="module")
def warm(drive, tmp_path_factory):
    """The map with the layers, and what the command said."""
    path = tmp_path_factory.mktemp("map") / "warm.hmap"
    radio = "/radio:point.x,quantity=wifi,unit=dBm,censored-below=-95"
    few = ["/once,sensor-frame=base,unit=V", "/silent,sensor-frame=base,censored-below=-3"]
    values = [*WARMTH, "--value", radio, *(word for each in few for word in ("--value", each))]
    result = run("map", drive, "--no-objects", *values, "-o", path)
    result.check_returncode()
    return path, result.stderr


def layer_of(path, name: str) -> ValueLayer:
    layer = open_map(path)[name]
    assert isinstance(layer, ValueLayer)
    assert layer.samples is not None
    return layer


def test_topics_of_the_recording_become_layers_of_the_map(warm):
    path, _ = warm
    layer = layer_of(path, "temperature")
    assert (layer.unit, layer.made_by["occupancy"]) == ("°F", "occupancy")
    np.testing.assert_allclose(layer.samples.values, 68 + 1.8 * np.arange(8))
    np.testing.assert_allclose(layer.samples.points_xy, [shot.position[:2] for shot in SHOTS])
    wifi = layer_of(path, "wifi")
    assert wifi.samples.is_below.tolist() == [False] * 5 + [True] * 3
    assert np.isfinite(wifi.cells).any()


def test_of_too_few_samples_the_map_keeps_them_without_inventing_values(warm):
    path, said = warm
    once, silent = layer_of(path, "once"), layer_of(path, "silent")
    assert (once.samples.values.tolist(), once.unit) == ([7], "V")
    assert np.isnan(once.cells).all()
    assert silent.samples.is_below.all()
    lines = " ".join(said.split())
    assert "'once' keeps its samples, but has no values: 1 sample with a value is too few" in lines
    assert "'silent' keeps its samples, but has no values: no sample of 8" in lines


def test_samples_that_the_map_has_already_do_not_count_twice(hypermap, warm, drive):
    path, _ = warm
    said = hypermap("map", drive, "--no-objects", "--onto", path, *WARMTH, "-o", path)
    assert said.code == 0
    assert "temperature: 8 samples already in the map" in said.err
    assert len(layer_of(path, "temperature").samples) == 8


def test_samples_move_with_poses_that_are_corrected_without_a_map(hypermap, tmp_path):
    """The poses say that the camera moves away from what it sees; all images are the same."""
    wall, ahead = np.full((HEIGHT, WIDTH), 2500, np.uint16), np.array([-0.5, 0.5, -0.5, 0.5])
    shots = [
        replace(shot, depth_mm=wall, position=np.array([0.12 * i, 0.0, 1.0]), quat_xyzw=ahead)
        for i, shot in enumerate(SHOTS)
    ]
    with BagBuilder(tmp_path, "ros1") as bag:
        add_poses(bag, shots)
        for shot in shots:
            add_images(bag, shot)
            values = {"header": header(shot.stamp), "temperature": 20.0}
            bag.add("/warmth", "sensor_msgs/msg/Temperature", shot.stamp, values)
    out = tmp_path / "out.hmap"
    graph = ["--correct-poses", "graph", "-o", out]
    made = hypermap("map", bag.path, "--no-objects", *WARMTH, *graph)
    assert made.code == 0, made.err
    assert "7 of 8 corrected by a pose graph" in made.err
    places = layer_of(out, "temperature").samples.points_xy
    np.testing.assert_allclose(places, np.zeros((8, 2)), atol=0.03)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("/warm", "did you mean '/warmth'?"),
        ("/radio", "has no single number; name the field that has it with --field"),
        ("/radio:point.w", "there is no 'w'"),
        ("/radio:point.x,units=dBm", "there is no setting 'units'; did you mean 'unit'?"),
        ("/warmth,unit=dBm", "values in '°C' cannot be converted to 'dBm'"),
        ("/warmth,sample-unit=K", "these samples are in °C"),
        ("/warmth,quantity=occupancy", "there is a layer 'occupancy' already; add ,quantity=NAME"),
        ("/silent,sensor-frame=base", "no usable sample: 8 samples without a number"),
        ("/once", "tf has no frame 'base_link'"),
    ],
)
def test_a_wrong_value_is_refused_before_anything_is_mapped(hypermap, drive, tmp_path, value, said):
    target = tmp_path / "out.hmap"
    result = hypermap("map", drive, "--no-objects", "--value", value, "-o", target)
    assert result.code == 2
    assert said in result.err
    assert not target.exists()


def test_values_need_topics(hypermap, warm, tmp_path):
    folder = write_tum(tmp_path / "tum", SHOTS[:2])
    result = hypermap("map", folder, "--no-objects", *WARMTH, "-o", tmp_path / "out.hmap")
    assert_one_error(result, "is not a bag, so it has no topics; give samples to")
    poses = ["--onto", warm[0], "--poses", folder / "groundtruth.txt"]
    result = hypermap("map", *poses, *WARMTH, "-o", tmp_path / "out.hmap")
    assert_one_error(result, "give the RECORDING that has the topic")
