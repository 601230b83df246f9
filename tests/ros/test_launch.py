"""The launch files of ROS 1, started by roslaunch on a real roscore."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hypermap import open_map, save_map
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.evaluation.metrics import evaluate
from hypermap.simulation import SimulatedRecording, demo_world, ground_truth, write_bag
from hypermap.testing import square

from .conftest import wait_for
from .map_server_tools import Client

pytestmark = pytest.mark.xdist_group("ros_launch")

CAMERA = {
    "depth_topic": "/camera/depth_registered/image_raw",
    "camera_info_topic": "/camera/depth_registered/camera_info",
    "detections_topic": "/darknet_ros/bounding_boxes",
    "map_topic": "/map",
}
RATE = 4  # of a bag; at a higher one, a machine with other work drops too many frames


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive through the demo's room, with the map of a SLAM node, in a bag of 54 s."""
    path = tmp_path_factory.mktemp("drive") / "a drive.bag"
    write_bag(SimulatedRecording(demo_world(), rate=0.5), path)
    return path


def slam_map() -> OccupancyLayer:
    grid = GridGeometry(40, 30, 0.05, Pose2D(-1.0, -0.5))
    cells = np.random.default_rng(3).choice([-1, 0, 100], size=grid.shape).astype(np.int8)
    return OccupancyLayer("occupancy", "map", grid, cells)


def test_show_map_serves_the_map_with_its_keepout_zones(launch, rospy, tmp_path) -> None:
    path = tmp_path / "my office.hmap"
    semantic = SemanticLayer("semantic", "map", [square("desk", 0, 0)])
    save_map(Hypermap([slam_map(), semantic]), path)
    server = launch("show_map.launch", file=path, rviz="false", keepout="['desk 0.1']")

    client = Client(rospy, "hypermap_server")
    asked = client.call(
        "get_string_at_point",
        "GetStringAtPoint",
        layer="semantic",
        location=client.point(0.2, 0.2, "map"),
    )
    assert asked.name == "desk"
    assert 100 in client.heard("keepout_mask", "nav_msgs/OccupancyGrid").data
    assert server.stop() == 0


def test_record_map_saves_at_its_end_what_a_slam_node_has_published(
    launch, rospy, ros1_types, tmp_path
) -> None:
    from hypermap.ros.messages.to_messages import occupancy_grid

    path = tmp_path / "recorded.hmap"
    server = launch("record_map.launch", save_to=path, map_topic="/slam/map")
    client = Client(rospy, "hypermap_server")
    slam = client.publisher("/slam/map", "nav_msgs/OccupancyGrid", latch=False)
    final = slam_map()
    assert final.grid is not None
    young = OccupancyLayer("occupancy", "map", final.grid, np.full(final.grid.shape, -1, np.int8))
    slam.publish(occupancy_grid(young, ros1_types, 10**9))
    slam.publish(occupancy_grid(final, ros1_types, 2 * 10**9))
    client.heard("occupancy_map", "nav_msgs/OccupancyGrid", lambda heard: 100 in heard.data)
    slam.unregister()
    assert not path.exists()
    assert server.stop() == 0

    recorded = open_map(path)
    assert [layer.name for layer in recorded] == ["occupancy"]
    np.testing.assert_array_equal(recorded["occupancy"].cells, final.cells)
    assert recorded["occupancy"].grid.origin == final.grid.origin
    assert recorded["occupancy"].grid.resolution == pytest.approx(0.05)


@pytest.mark.slow
def test_semantic_mapping_serves_the_growing_map_and_saves_it(
    launch, rospy, start, drive, tmp_path
) -> None:
    path = tmp_path / "live.hmap"
    nodes = launch("semantic_mapping.launch", save_to=path, **CAMERA)
    topics = ["/tf", *CAMERA.values()]
    bag = start(
        *("rosbag", "play", "--quiet", "--wait-for-subscribers", f"--rate={RATE}"),
        *("--topics", *topics, f"--bags={drive}"),
    )
    client = Client(rospy, "hypermap_server")
    served = client.heard(
        "semantic_semmap",
        "hypermap_msgs/SemanticMap",
        lambda heard: len(heard.objects) > 5,
        timeout=240,  # two nodes have to start, and to see something
    )
    assert {item.name for item in served.objects} <= set(
        ground_truth(demo_world())["semantic"].names
    )
    free = client.call(
        "get_string_at_point",
        "GetStringAtPoint",
        layer="occupancy",
        location=client.point(*free_place(), "map"),
    )
    assert free.name == "Free"
    wait_for(lambda: bag.popen.poll() is not None, "the end of the bag", 240)
    assert nodes.stop() == 0
    assert_mapped(path)


@pytest.mark.slow
def test_map_bag_ends_with_the_bag_and_saves_the_map(launch, drive, tmp_path) -> None:
    path = tmp_path / "mapped.hmap"
    nodes = launch("map_bag.launch", bag=drive, save_to=path, rate=RATE, **CAMERA)
    wait_for(lambda: nodes.popen.poll() is not None, "the end of the bag", 240)
    assert path.exists(), nodes.output
    assert_mapped(path)


def free_place() -> tuple[float, float]:
    truth = SimulatedRecording(demo_world(), rate=0.5).occupancy()
    assert truth is not None
    x, y = truth.find("Free")[0]
    return float(x), float(y)


def assert_mapped(path: Path) -> None:
    """The map holds the room's objects, but for those in frames that a live node may drop."""
    mapped = open_map(path)
    objects = mapped["semantic"].objects()
    truth = ground_truth(demo_world())["semantic"].objects()
    score = evaluate(objects, truth).overall
    assert len(objects) > 8
    assert score.detection[1].precision > 0.7, score
    recorded = SimulatedRecording(demo_world(), rate=0.5).occupancy()
    assert recorded is not None
    np.testing.assert_array_equal(mapped["occupancy"].cells, recorded.cells)
