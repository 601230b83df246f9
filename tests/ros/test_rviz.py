"""A map in a real rviz on a screen that nobody looks at, found again in its pixels."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml

from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.exploration import Frontier
from hypermap.formats import save_map
from hypermap.ros.messages.exploration_messages import exploration_markers
from hypermap.ros.rviz.config import RvizView, map_configuration, view_of
from hypermap.testing import square

from .conftest import Process, wait_for
from .screen import Screen, Seen, expected

pytestmark = pytest.mark.xdist_group("rviz")

PATIENCE = 240.0  # s until a window is drawn, on a machine that has much to do
ENOUGH = 0.98  # of the points of each color have it
# The lab's frame stands outside of the map, and is turned by 90 degrees against it.
LAB = Transform("map", "lab", Pose2D(20.0, 0.0, math.pi / 2))


def grid(name: str) -> OccupancyLayer:
    """A room of 8 m x 6 m with walls and a block."""
    cells = np.zeros((12, 16), dtype=np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    cells[7:9, 11:14] = 100
    return OccupancyLayer(name, "map", GridGeometry(16, 12, 0.5, Pose2D(10.0, 2.0)), cells)


def room() -> Hypermap:
    """Furniture in the frame of the grid, and some in the lab's: (x, y) is (20 - y, x) there."""
    sofa = shapely.box(11, 6, 14, 7.5).difference(shapely.box(12, 6.4, 13, 7.1))
    things = [
        SemanticObject("table", shapely.box(11, 3, 13.5, 5)),
        square("tray", 11.6, 4.4, 0.9),
        SemanticObject("sofa", sofa),
    ]
    layers = [
        grid("occupancy"),
        SemanticLayer("things", "map", things),
        SemanticLayer("of the lab", "lab", [SemanticObject("bed", shapely.box(2.8, 3, 4.8, 5.5))]),
    ]
    return Hypermap(layers, FrameTree([LAB]))


def other_room() -> Hypermap:
    """The same room with one layer gone, one new, and one that has another place."""
    return Hypermap(
        [
            grid("scan"),
            SemanticLayer("things", "map", [SemanticObject("bed", shapely.box(11, 3, 13, 5))]),
            SemanticLayer("plants", "map", [square("plant", 15, 4, 1.5)]),
        ]
    )


def far_room() -> Hypermap:
    """The layers of the room elsewhere, in a larger grid."""
    cells = np.zeros((20, 30), dtype=np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    hall = OccupancyLayer("occupancy", "map", GridGeometry(30, 20, 0.5, Pose2D(-60.0, 40.0)), cells)
    bed = SemanticObject("bed", shapely.box(-57, 43, -53, 46))
    return Hypermap([hall, SemanticLayer("things", "map", [bed])])


@pytest.fixture
def screen(tmp_path: Path) -> Iterator[Screen]:
    folder = tmp_path / "screen"
    folder.mkdir()
    screen = Screen(folder)
    yield screen
    screen.close()


@pytest.fixture
def serve(roscore: str, start: Callable[..., Process], tmp_path: Path) -> Callable[[str], Process]:
    """Start a map server of that name, with the maps `room` and `other` in its directory."""
    save_map(room(), tmp_path / "room.hmap")
    save_map(other_room(), tmp_path / "other.hmap")
    save_map(far_room(), tmp_path / "far.hmap")

    def run(name: str) -> Process:
        server = start(
            *("hypermap", "serve", tmp_path / "room.hmap", "--ros1", f"__name:={name}"),
            *("--map-directory", tmp_path),
        )
        server.expect("loaded")
        return server

    return run


def wait_until_it_shows(
    screen: Screen, hypermap: Hypermap, grid: str, view: RvizView, hidden: tuple[str, ...] = ()
) -> None:
    points, colors = expected(hypermap, grid, hidden)
    shares: list[float] = []

    def shows() -> bool:
        time.sleep(0.2)
        shares.append(Seen(screen.pixels(), view).share(points, colors))
        return shares[-1] >= ENOUGH

    try:
        wait_for(shows, "the map on the screen", PATIENCE)
    except pytest.fail.Exception:
        pytest.fail(f"of the worst color, at best {max(shares):.1%} of the points have it")


def comes_up(
    rviz: Process, screen: Screen, hypermap: Hypermap, view: RvizView, hidden: tuple[str, ...]
) -> bool:
    """Wait until rviz shows a map, and return whether it does; not if it has ended."""
    points, colors = expected(hypermap, "occupancy", hidden)

    def has_come() -> bool:
        time.sleep(0.2)
        is_there = Seen(screen.pixels(), view).share(points, colors) >= ENOUGH
        return is_there or rviz.popen.poll() is not None

    wait_for(has_come, "the map on the screen", PATIENCE)
    return rviz.popen.poll() is None


def test_a_configuration_shows_the_map(
    screen: Screen, serve: Any, start: Any, rospy: Any, tmp_path: Path
) -> None:
    hypermap = room()
    view = view_of(hypermap)
    config = yaml.safe_load(map_configuration(hypermap, "/shown"))
    displays = {d["Name"]: d for d in config["Visualization Manager"]["Displays"]}
    displays["things"]["Namespaces"]["table"] = False  # as a click in rviz leaves it
    config["Visualization Manager"]["Global Options"]["Frame Rate"] = 5  # it draws without a GPU
    file = tmp_path / "room.rviz"
    file.write_text(yaml.safe_dump(config))
    serve("shown")
    for _ in range(5):  # rviz 1.14.19 sometimes aborts at its start: free(): invalid next size
        rviz = start("rviz", "-d", file, env=screen.environment)
        if comes_up(rviz, screen, hypermap, view, hidden=("table",)):
            break
    wait_until_it_shows(screen, hypermap, "occupancy", view, hidden=("table",))
    word = *shapely.box(15, 2.8, 17, 4.8).centroid.coords[0], 0.2
    wait_for(lambda: Seen(screen.pixels(), view).has_ink(*word), "the word 'bed'")

    # A class goes at the server and comes again; the one that is off in rviz stays off.
    rospy.set_param("/shown/hidden_classes", ["tray"])
    wait_until_it_shows(screen, hypermap, "occupancy", view, hidden=("table", "tray"))
    rospy.set_param("/shown/hidden_classes", [])
    wait_until_it_shows(screen, hypermap, "occupancy", view, hidden=("table",))
    assert "Failed" not in rviz.output


def children(process: Process) -> list[int]:
    pid = process.popen.pid
    try:
        listed = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    except (FileNotFoundError, ProcessLookupError):  # it has ended
        return []
    return [int(child) for child in listed.split()]


def test_a_window_that_crashes_comes_again(screen: Screen, serve: Any, start: Any) -> None:
    serve("crashing")
    hypermap = room()
    view = view_of(hypermap)
    # Should it hang, SIGABRT says where.
    environment = {**screen.environment, "PYTHONFAULTHANDLER": "1"}
    for _ in range(3):  # rviz itself crashes at times, and only three crashes are forgiven
        window = start("hypermap", "rviz", "--server", "crashing", env=environment)
        wait_until_it_shows(screen, hypermap, "occupancy", view)
        if "has crashed" not in window.output:
            break
        window.stop()
    crashed: set[int] = set()

    def running() -> list[int]:
        return [child for child in children(window) if child not in crashed]

    def crash(number: signal.Signals) -> bool:
        found = running()
        for child in found:
            os.kill(child, number)
        crashed.update(found)
        return bool(found)

    for number in (signal.SIGSEGV, signal.SIGABRT):
        assert crash(number)
        try:
            wait_for(running, "the next window, which is there when the one before has ended")
        except pytest.fail.Exception:
            window.popen.send_signal(signal.SIGABRT)
            raise
        wait_until_it_shows(screen, hypermap, "occupancy", view)
        assert f"rviz has crashed ({number.name}); starting it again" in window.output
    while window.popen.poll() is None:
        crash(signal.SIGABRT)
        time.sleep(0.05)
    assert window.popen.returncode != 0
    # By our signal, if the last one was not a crash of its own.
    assert "hypermap: error: rviz has crashed 4 times (SIG" in window.output.splitlines()[-1]


def test_without_a_display_the_window_asks_for_one(screen: Screen, start: Any, rospy: Any) -> None:
    nowhere = {**screen.environment, "DISPLAY": ":no-such-display"}
    window = start("hypermap", "rviz", env=nowhere)
    wait_for(lambda: window.popen.poll() is not None, "the end", PATIENCE)
    assert window.popen.returncode == 2
    assert "is there a display?" in window.output.splitlines()[-1]


def test_the_window_follows_the_server(
    screen: Screen, serve: Any, start: Any, rospy: Any, ros1_types: Any
) -> None:
    from hypermap.ros.ros1.messages import service_class

    serve("followed")
    window = start("hypermap", "rviz", "--server", "followed", env=screen.environment)
    before, after = room(), other_room()
    view = view_of(before)
    assert view == view_of(after)
    wait_until_it_shows(screen, before, "occupancy", view)

    load = rospy.ServiceProxy("/followed/load_map", service_class("hypermap_msgs/LoadMap"))
    assert load(filename="other.hmap").success
    wait_until_it_shows(screen, after, "scan", view)
    assert load(filename="far.hmap").success
    far = far_room()
    wait_until_it_shows(screen, far, "occupancy", view_of(far))
    assert load(filename="room.hmap").success
    wait_until_it_shows(screen, before, "occupancy", view)

    # A zone around the table, which reaches 0.9 m beyond it.
    rospy.set_param("/followed/keepout", ["table 0.9"])
    around = shapely.box(11, 3, 13.5, 5).buffer(0.8).difference(shapely.box(11, 3, 13.5, 5))
    points = np.array([(12.25, 2.7), (10.7, 3.5), (13.8, 4.5)])
    assert shapely.covers(around, shapely.points(points)).all()

    def shows_the_zone() -> bool:
        red, green, blue = Seen(screen.pixels(), view).colors(points).T
        return bool((np.minimum(red, blue) - green > 50).all())  # purple over white

    wait_for(shows_the_zone, "the keepout zone", PATIENCE)

    # A frontier on the free floor, as the mapper of this namespace would publish it.
    points = np.column_stack([np.arange(11.05, 13, 0.1), np.full(20, 5.45)])
    stand = Pose2D(15.0, 3.4, math.pi / 2)
    frontier = Frontier(points, 2.0, points[-1], stand, distance=3.0, gain=1.0)
    markers = exploration_markers([frontier], [], "map", ros1_types)
    publisher = rospy.Publisher(
        "/semantic_mapper/frontiers", type(markers), latch=True, queue_size=1
    )
    publisher.publish(markers)

    def shows_the_frontier() -> bool:
        red, _, blue = Seen(screen.pixels(), view).colors(points[:12]).T
        return bool((blue - red > 50).all())

    wait_for(shows_the_frontier, "the frontier", PATIENCE)
    publisher.unregister()

    assert window.stop(signal.SIGINT) == 130
    assert "Traceback" not in window.output
    wait_for(lambda: not Seen(screen.pixels(), view).is_drawn, "the end of the window")
