"""What the map server is made of, where ROS is not the point."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import FrameError, HypermapError, LayerNotFound
from hypermap.core.frames import FrameTree
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.core.trajectory import pose_from_rpy
from hypermap.ros.server.current_map import CurrentMap, KeptOpen
from hypermap.ros.server.floor_frames import FloorFrames
from hypermap.ros.server.services import failed_response
from hypermap.ros.server.updates import LayerUpdates
from hypermap.ros.typestore import response_class
from hypermap.testing import square

from .conftest import wait_for
from .map_server_tools import LAB


class Notes:
    """The few things of a port that these parts use: a log, tf, and classes of responses."""

    is_shut_down = False

    def __init__(self) -> None:
        self.lines: list[tuple[str, str]] = []
        self.tf: dict[tuple[str, str], Any] = {}

    def log(self, level: str, text: str) -> None:
        self.lines.append((level, text))

    def lookup(self, target: str, source: str, stamp: int | None, timeout: float) -> Any:
        if (target, source) not in self.tf:
            raise FrameError(f"tf has no transform from {source!r} to {target!r}")
        return self.tf[target, source]

    def response(self, type_name: str) -> type[Any]:
        return response_class(type_name)


class Shown:
    """A part that remembers what it was shown, or fails."""

    def __init__(self, error: Exception | None = None) -> None:
        self.maps: list[tuple[Hypermap, Any]] = []
        self.error = error

    def set(self, values: Any) -> None: ...
    def close(self) -> None: ...

    def show(self, hypermap: Hypermap, changed: Any = None) -> None:
        if self.error:
            raise self.error
        self.maps.append((hypermap, changed))


class Slow(Shown):
    """A part that takes its time, once it has remembered what it was shown."""

    def __init__(self) -> None:
        super().__init__()
        self.may_go_on = threading.Event()
        self.may_go_on.set()

    def show(self, hypermap: Hypermap, changed: Any = None) -> None:
        super().show(hypermap, changed)
        assert self.may_go_on.wait(120)


def lab() -> Hypermap:
    layers = [SemanticLayer("hall", "map"), SemanticLayer("lab", "lab", [square("chair", 1, 1)])]
    return Hypermap(layers, FrameTree([LAB]))


# The map now


def test_a_part_that_fails_is_logged_and_the_others_are_shown():
    port, good = Notes(), Shown()
    current = CurrentMap(port)
    current.show_on([Shown(HypermapError("no paint left")), good])
    hypermap = lab()
    current.replace(hypermap)
    assert good.maps[-1] == (hypermap, None)
    assert port.lines == [("error", "no paint left")] * 2


def test_a_change_makes_a_new_map_and_leaves_the_old_one_to_those_who_have_it():
    current, part = CurrentMap(Notes()), Shown()
    before = lab()
    current.replace(before)
    current.show_on([part])

    def emptied(_: Hypermap, layer: Any) -> Any:
        changed = layer.copy()
        changed.remove(changed.ids)
        return changed

    current.change("lab", emptied)
    assert [len(before["lab"]), len(current.hypermap["lab"])] == [1, 0]
    wait_for(lambda: part.maps[-1] == (current.hypermap, ["lab"]), "the change to be shown")


def test_changes_that_come_while_one_is_shown_are_shown_together():
    current, part = CurrentMap(Notes()), Slow()
    current.replace(lab())
    current.show_on([part])
    part.may_go_on.clear()
    current.change("lab", lambda _, layer: layer.copy())
    wait_for(lambda: len(part.maps) == 2, "the first change")
    for _ in range(20):  # none of them waits for the part
        current.change("lab", lambda _, layer: layer.copy())
    current.change("hall", lambda _, layer: layer.copy())
    last = current.hypermap
    part.may_go_on.set()
    wait_for(lambda: part.maps[-1][0] is last, "the last change")
    assert [changed for _, changed in part.maps] == [None, ["lab"], ["hall", "lab"]]


def showing() -> set[threading.Thread]:
    """Return the threads that show maps; others come and go."""
    return {thread for thread in threading.enumerate() if thread.name == "map"}


def test_what_stops_showing_waits_for_what_is_being_shown_and_may_start_again(monkeypatch):
    monkeypatch.setattr("hypermap.ros.server.current_map._PATIENCE", 240.0)
    before = showing()
    current, part = CurrentMap(Notes()), Slow()
    current.replace(lab())
    current.show_on([part])
    part.may_go_on.clear()
    current.change("lab", lambda _, layer: layer.copy())
    wait_for(lambda: len(part.maps) == 2, "the first change")
    threading.Timer(0.2, part.may_go_on.set).start()
    current.show_no_more()
    assert part.may_go_on.is_set()
    wait_for(lambda: showing() <= before, "the end of the thread")
    current.change("hall", lambda _, layer: layer.copy())
    assert len(part.maps) == 2
    current.show_on([part])
    current.change("lab", lambda _, layer: layer.copy())
    wait_for(lambda: len(part.maps) == 4, "another change")
    assert [changed for _, changed in part.maps] == [None, ["lab"], None, ["lab"]]
    current.show_no_more()


def test_who_is_interrupted_before_the_map_is_shown_can_end(monkeypatch):
    def interrupted(_):
        raise KeyboardInterrupt

    current = CurrentMap(Notes())
    monkeypatch.setattr(threading.Thread, "start", interrupted)
    with pytest.raises(KeyboardInterrupt):
        current.show_on([Shown()])
    current.show_no_more()


def test_a_part_with_a_bug_does_not_end_the_showing_of_changes():
    port, good = Notes(), Shown()
    current = CurrentMap(port)
    current.replace(lab())
    current.show_on([Shown(ZeroDivisionError("of our own")), good])
    for number in (2, 3):
        current.change("lab", lambda _, layer: layer.copy())
        wait_for(lambda number=number: len(good.maps) == number, "the change")
    assert all("ZeroDivisionError: of our own" in text for _, text in port.lines)


def test_a_change_that_fails_leaves_the_map_as_it_is():
    current, part = CurrentMap(Notes()), Shown()
    before = lab()
    current.replace(before)
    current.show_on([part])

    def broken(*_: Any) -> Any:
        raise HypermapError("broken")

    with pytest.raises(HypermapError, match="broken"):
        current.change("lab", broken)
    with pytest.raises(LayerNotFound):
        current.change("attic", broken)
    assert current.hypermap is before
    assert len(part.maps) == 1


def test_what_is_wanted_is_open_and_nothing_else():
    log: list[str] = []

    class Door:
        def __init__(self, name: str) -> None:
            self.name = name
            log.append(f"open {name}")

        def close(self) -> None:
            log.append(f"close {self.name}")

    doors: KeptOpen[Door] = KeptOpen()
    doors.keep({name: lambda name=name: Door(name) for name in "ab"})
    a = doors["a"]
    assert doors.keep({name: lambda name=name: Door(name) for name in "ac"}) == {"c"}
    assert doors["a"] is a
    doors.close()
    assert log == ["open a", "open b", "close b", "open c", "close a", "close c"]


# Frames


def test_the_maps_own_transforms_come_before_those_of_tf():
    port = Notes()
    port.tf["map", "lab"] = port.tf["map", "robot"] = pose_from_rpy(1, 2, 0.3, 0, 0, 0.5)
    frames = FloorFrames(port)
    assert frames.pose(lab(), "map", "lab") == LAB.pose
    assert frames.pose(lab(), "map", None).is_identity
    robot = frames.pose(lab(), "map", "robot")
    np.testing.assert_allclose([robot.x, robot.y, robot.yaw], [1, 2, 0.5])
    with pytest.raises(FrameError, match=r"'mars' is unknown to the map.*frames map, lab; tf"):
        frames.pose(lab(), "map", "mars")


# Updates


def test_a_flood_of_different_reasons_is_reported_of_once():
    port = Notes()
    current = CurrentMap(port)
    updates = LayerUpdates(port, current, FloorFrames(port))
    for number in range(1000):
        letters = "".join(chr(97 + int(digit)) for digit in str(number))
        updates._complain("/map", "hall", [f"a {letters} at {number} m"])
        updates._complain("/map", "hall", [f"a {letters} at -1.5 m"])
    updates._complain("/map", "lab", [f"object {number} is wrong" for number in range(1000)])
    assert len([text for _, text in port.lines if "'lab'" in text]) < 30
    port.lines = [line for line in port.lines if "'hall'" in line[1]]
    assert len(port.lines) < 30
    assert port.lines[0] == ("warning", "/map: layer 'hall': a a at 0 m")
    assert port.lines[-1][1].endswith("further reasons are not logged")


# Where services cannot fail


@pytest.mark.parametrize(
    ("type_name", "fields"),
    [
        ("hypermap_msgs/GetStringAtPoint", {"name": ""}),
        ("hypermap_msgs/GetIntAtPoint", {"value": -1}),
        ("hypermap_msgs/GetIntsByArea", {"values": [], "locations": []}),
        ("hypermap_msgs/LoadMap", {"success": False}),
        ("hypermap_msgs/FindObjects", {"success": False, "message": "why", "objects": []}),
        ("std_srvs/Trigger", {"success": False, "message": "why"}),
    ],
)
def test_a_failure_is_reported_as_well_as_the_type_can(type_name, fields):
    response = failed_response(Notes(), type_name, "why")
    assert {name: getattr(response, name) for name in fields} == fields
