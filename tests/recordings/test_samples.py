"""Samples out of tables and bags: where they were taken, and what is wrong with them."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.core.trajectory import Trajectory
from hypermap.recordings.samples import motion_in_bag, read_bag, read_table

from .bag_builder import BagBuilder, header

SECOND = 10**9
START = 1_700_000_000 * SECOND


def write(tmp_path, text: str):
    path = tmp_path / "samples.csv"
    path.write_text(text, encoding="utf-8")
    return path


# Tables


def test_a_table_has_places_values_and_times(tmp_path):
    path = write(tmp_path, "stamp,x,y,value\n5,1.5,2,20.5\n\n6,-1,0,21\n")
    samples = read_table(path).samples
    assert samples.points_xy.tolist() == [[1.5, 2], [-1, 0]]
    assert samples.values.tolist() == [20.5, 21]
    assert samples.stamps.tolist() == [5, 6]
    assert not samples.is_below.any()


def test_times_of_a_table_may_be_nanoseconds(tmp_path):
    path = write(tmp_path, "stamp,x,y,value\n1700000000250000000,1.5,2,20.5\n,-1,0,21\n")
    assert read_table(path).samples.stamps.tolist() == pytest.approx(
        [1_700_000_000.25, np.nan], nan_ok=True
    )


@pytest.mark.parametrize(
    "text",
    [
        "timestamp,x,y,value\n2023-11-14T22:13:20.250Z,1.5,2,20.5\n2023-11-15T00:13:21+02:00,1,2,3\n",
        "Time;x;y;value\n1700000000,25;1,5;2;20,5\n1700000001;1;2;3\n",
        "%time,field.header.stamp,x,y,value\n1,1700000000250000000,1.5,2,20.5\n"
        "2,1700000001000000000,1,2,3\n",  # of `rostopic echo -p`
    ],
)
def test_the_column_of_times_may_have_another_usual_name(tmp_path, text):
    samples = read_table(write(tmp_path, text)).samples
    assert samples.stamps.tolist() == pytest.approx([1_700_000_000.25, 1_700_000_001], abs=1e-5)


def test_the_columns_may_stand_in_any_order_and_the_field_names_one(tmp_path):
    path = write(tmp_path, "\ufeffco2, y, x\n400,2,1\n")
    measured = read_table(path, "co2")
    assert measured.samples.points_xy.tolist() == [[1, 2]]
    assert np.isnan(measured.samples.stamps).all()


@pytest.mark.parametrize(
    "text",
    [
        "X,Y,Value\n1.5,2,20.5\n",
        "x;y;value\n1,5;2;20,5\n",  # a spreadsheet where a comma is the decimal point
        "x;y;value\r\n1.5;2;20.5\r\n",
        "x\ty\tvalue\n1.5\t2\t20.5\n",
    ],
)
def test_a_table_may_come_from_a_spreadsheet(tmp_path, text):
    samples = read_table(write(tmp_path, text)).samples
    assert samples.points_xy.tolist() == [[1.5, 2]]
    assert samples.values.tolist() == [20.5]


def test_of_two_columns_that_differ_in_case_the_exact_name_counts(tmp_path):
    path = write(tmp_path, "RSSI,rssi,X,x,y,Y\n1,2,3,4,5,6\n")
    samples = read_table(path, "rssi").samples
    assert samples.points_xy.tolist() == [[4, 5]]
    assert samples.values.tolist() == [2]


def test_what_was_not_heard_is_left_out_or_below_a_limit(tmp_path):
    path = write(tmp_path, "x,y,value\n0,0,-60\n1,0,\n2,0,NaN\n3,0,-97\n4,0,inf\nnan,0,1\n")
    plain = read_table(path)
    assert plain.samples.values.tolist() == [-60, -97]
    assert plain.left_out == {"without a pose at their time": 1, "without a number": 3}
    heard = read_table(path, censored_below=-95)
    assert heard.samples.values.tolist() == [-60, -95, -95, -95]
    assert heard.samples.is_below.tolist() == [False, True, True, True]
    assert heard.left_out == {"without a pose at their time": 1, "without a number": 1}


def test_a_trajectory_says_where_samples_with_stamps_were_taken(tmp_path):
    path = write(tmp_path, "stamp,value\n10.5,1\n12,2\n99,3\n")
    ways = np.array([[0.0, 0, 0], [2, 4, 0], [2, 4, 0]])
    motion = Trajectory(np.array([10.0, 11, 12]), ways, np.tile([0.0, 0, 0, 1], (3, 1)))
    measured = read_table(path, motion=motion)
    assert measured.samples.points_xy.tolist() == [[1, 2], [2, 4]]
    assert measured.left_out == {"without a pose at their time": 1}
    late = write(tmp_path, "stamp,value\n100,1\n101,2\n")
    with pytest.raises(HypermapError, match="no sample has a pose at its time: the samples reach"):
        read_table(late, motion=motion)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "names no column 'value', it has nothing"),
        ("x,y,temp\n1,2,3\n", "names no column 'value', it has x, y, temp; name that of the"),
        ("stamp,value\n1,2\n", "names no column 'x', in meters; of samples with stamps, name the"),
        ("1,2,20.5\n3,4,21\n", "the first line must name the columns, such as x,y,value"),
        ("x y value\n1 2 3\n", "separate columns by commas, semicolons or tabs"),
        ("x,y,value\n", "there are no samples in it"),
        ("x,y,value\n1,2\n", "line 2: has 2 cells, the first line 3"),
        ("x,y,value\n1,2,3\n1,2,warm\n", "line 3: value: 'warm' is not a number"),
        ("x,y,value,time\n1,2,3,noon\n", "line 2: time: 'noon' is no time, such as "),
        ('x,y,value\n1,2,"3\n', "is not a CSV file"),
    ],
)
def test_a_broken_table_is_named_with_its_line(tmp_path, text, said):
    path = write(tmp_path, text)
    with pytest.raises(FormatError, match=said) as caught:
        read_table(path)
    assert str(path) in str(caught.value)


def test_what_is_no_table_is_refused(tmp_path):
    path = tmp_path / "samples.csv"
    with pytest.raises(FileMissing):
        read_table(path)
    for encoding in ("latin-1", "utf-16"):
        path.write_text("x,y,°C\n1,2,20.5\n", encoding=encoding)
        with pytest.raises(FormatError, match=r"samples\.csv: is not text in UTF-8; if it is text"):
            read_table(path, "°C")


# Bags


def add_drive(bag: BagBuilder, seconds: int = 4) -> None:
    """Add tf: the base drives along x at 1 m/s from (0, 1), the sensor is 0.5 m before it."""
    for second in range(seconds + 1):
        bag.add_tf("/tf", START + second * SECOND, "map", "base_link", (second, 1, 0))
    bag.add_tf("/tf_static", START, "base_link", "sensor", (0.5, 0, 0.3))


def add_temperature(bag: BagBuilder, second: float, value: float) -> None:
    stamp = START + int(second * SECOND)
    message = {"header": header(stamp, "sensor"), "temperature": value}
    bag.add("/warmth", "sensor_msgs/msg/Temperature", stamp, message)


def test_a_sample_lies_where_the_sensor_was_at_its_stamp(bag):
    with bag:
        add_drive(bag)
        add_temperature(bag, 0.5, 20)
        add_temperature(bag, 3.25, 21)
        add_temperature(bag, 9, 22)  # after the last pose
        add_temperature(bag, 1, float("nan"))
    measured = read_bag(bag.path, "/warmth")
    np.testing.assert_allclose(measured.samples.points_xy, [[1, 1], [3.75, 1]])
    assert measured.samples.values.tolist() == [20, 21]
    assert measured.samples.stamps.tolist() == [START / SECOND + 0.5, START / SECOND + 3.25]
    assert (measured.unit, measured.quantity) == ("°C", "temperature")
    assert measured.left_out == {"without a pose at their time": 1, "without a number": 1}


@pytest.mark.parametrize(
    ("name", "values", "field", "expected", "unit"),
    [
        ("sensor_msgs/msg/RelativeHumidity", {"relative_humidity": 0.5}, None, 50, "%"),
        ("sensor_msgs/msg/Illuminance", {"illuminance": 300}, None, 300, "lx"),
        ("sensor_msgs/msg/FluidPressure", {"fluid_pressure": 101325}, None, 101325, "Pa"),
        ("sensor_msgs/msg/BatteryState", {"voltage": 12.5}, None, 12.5, "V"),
        ("sensor_msgs/msg/BatteryState", {"percentage": 0.75}, "percentage", 0.75, ""),
        (
            "sensor_msgs/msg/MagneticField",
            {"magnetic_field": {"x": 3e-5, "y": 0.0, "z": -4e-5}},
            None,
            5e-5,
            "T",
        ),
        (
            "sensor_msgs/msg/Range",
            {"min_range": 0.5, "max_range": 4, "range": 2},
            None,
            2,
            "m",
        ),
        ("sensor_msgs/msg/LaserScan", {"ranges": [1, 2, 3]}, "ranges[2]", 3, ""),
        (
            "geometry_msgs/msg/TwistStamped",
            {"twist": {"linear": {"x": 0.25}}},
            "twist.linear.x",
            0.25,
            "",
        ),
        (
            "diagnostic_msgs/msg/DiagnosticArray",
            {
                "status": [
                    {"name": "lte", "values": [{"key": "level", "value": "-3"}]},
                    {"name": "wifi", "values": [{"key": "level", "value": "-71.5 dBm"}]},
                ]
            },
            "wifi/level",
            -71.5,
            "",
        ),
    ],
)
def test_each_kind_of_message_has_its_number(tmp_path, name, values, field, expected, unit):
    with BagBuilder(tmp_path, "mcap") as bag:
        add_drive(bag)
        bag.add("/it", name, START, {"header": header(START + SECOND, "sensor")} | values)
    measured = read_bag(bag.path, "/it", field)
    assert measured.samples.values.tolist() == [pytest.approx(expected, rel=1e-6)]
    assert measured.samples.points_xy.tolist() == [[1.5, 1]]
    assert measured.unit == unit


def test_numbers_without_a_header_are_placed_by_the_time_of_recording(bag):
    with bag:
        add_drive(bag)
        bag.add("/ppm", "std_msgs/msg/Float64", START + 2 * SECOND, {"data": 400})
    assert read_bag(bag.path, "/ppm").samples.points_xy.tolist() == [[2, 1]]
    of_sensor = read_bag(bag.path, "/ppm", sensor_frame="sensor").samples
    assert of_sensor.points_xy.tolist() == [[2.5, 1]]


def test_what_was_out_of_range_is_no_number(tmp_path):
    with BagBuilder(tmp_path, "ros1") as bag:
        add_drive(bag)
        for value in (0.1, 2, float("inf")):
            values = {"min_range": 0.5, "max_range": 4.0, "range": value}
            message = {"header": header(START, "sensor")} | values
            bag.add("/sonar", "sensor_msgs/msg/Range", START, message)
    measured = read_bag(bag.path, "/sonar")
    assert measured.samples.values.tolist() == [2]
    assert measured.left_out == {"without a number": 2}


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    with BagBuilder(tmp_path_factory.mktemp("drive"), "ros1") as bag:
        add_drive(bag)
        add_temperature(bag, 0.5, 20)
        bag.add("/text", "std_msgs/msg/String", START, {"data": "warm"})
        bag.add("/scan", "sensor_msgs/msg/LaserScan", START, {"ranges": [1.0]})
    return bag.path


@pytest.mark.parametrize(
    ("topic", "options", "said"),
    [
        ("/warm", {}, "there are no messages on topic '/warm' .*did you mean '/warmth'"),
        ("/warmth", {"field": "temprature"}, "there is no 'temprature'; did you mean 'temp"),
        ("/warmth", {"field": "header"}, "is not a number; it has .*stamp, frame_id"),
        ("/warmth", {"field": "temperature[0]"}, "there is no list that has element 0"),
        ("/warmth", {"field": "a b"}, "a path is like signal.rssi"),
        ("/warmth", {"field": "__class__"}, "a path is like signal.rssi"),
        ("/text", {}, "a std_msgs/msg/String has no single number; name the field"),
        ("/text", {"field": "data"}, "is not a number"),
        ("/warmth", {"map_frame": "world"}, "tf has no frame 'world'; it has map, base_link"),
        ("/warmth", {"sensor_frame": "nose"}, "no frame 'nose'.*--sensor-frame"),
    ],
)
def test_what_cannot_be_read_is_reported_with_a_remedy(drive, topic, options, said):
    with pytest.raises(FormatError, match=said) as caught:
        read_bag(drive, topic, **options)
    assert str(drive) in str(caught.value)


def test_a_list_that_is_too_short_has_no_number(drive):
    measured = read_bag(drive, "/scan", "ranges[7]")
    assert measured.left_out == {"without a number": 1}


def test_a_bag_without_tf_says_so(tmp_path):
    with BagBuilder(tmp_path, "db3") as bag:
        add_temperature(bag, 0.5, 20)
    with pytest.raises(FormatError, match="there is no tf, so the poses of the sensor are unknown"):
        read_bag(bag.path, "/warmth")


def test_the_poses_of_a_bag_go_with_a_table(drive, tmp_path):
    path = write(tmp_path, f"stamp,value\n{START / SECOND + 1.5},7\n")
    measured = read_table(path, motion=motion_in_bag(drive, "map", "sensor"))
    np.testing.assert_allclose(measured.samples.points_xy, [[2, 1]])
