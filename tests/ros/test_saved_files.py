"""A live map whose file others edit or replace meanwhile. No ROS is needed."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.core.trajectory import trajectory_of
from hypermap.formats import open_map, save_map
from hypermap.perception.frame import RgbdFrame
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.saving import Saving
from hypermap.ros.mapper.settings import LiveSettings
from hypermap.ros.throttle import Throttle
from hypermap.testing import square

from ..mapping.test_mapper import boxes, frame

DAY = 1_700_000_000.0


class Node:
    """A live map and what saves it, as the node has them."""

    def __init__(self, file: Path, *, onto: bool = True, saves: bool = True) -> None:
        settings = LiveSettings(
            depth_topic="/depth",
            detections_topic="/boxes",
            onto=str(file) if onto else "",
            save_to=str(file) if saves else "",
            save_every=0.0,
        )
        self.lines: list[str] = []
        self.map = LiveMap(settings)
        port: Any = self
        self.activate = lambda: Saving(port, settings, self.map, Throttle(self.log))
        self._saving = self.activate()
        self.save = lambda name="": self._saving.store(name)
        self.close = lambda: self._saving.close()

    def activate_again(self) -> None:
        self.close()
        self._saving = self.activate()

    def log(self, level: str, text: str) -> None:
        self.lines.append(f"{level}: {text}")

    def show(self, first: int, count: int = 8) -> None:
        """Show the box about the origin, from places that no other call shows it from."""
        for i in range(first, first + count):
            seen: RgbdFrame = frame(i, x=0.1 * (i % 8) - 0.3 + i / 1000)
            self.map.add(dataclasses.replace(seen, stamp=DAY + i, detections=boxes(seen)))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "office.hmap"


@pytest.fixture
def node(file: Path) -> Node:
    """A node that has saved a box."""
    made = Node(file)
    made.show(0)
    made.save()
    return made


def edit(file: Path, change: Callable[[SemanticLayer], object]) -> None:
    hypermap = open_map(file)
    change(hypermap.semantic())
    save_map(hypermap, file)


def names(file: Path) -> list[str]:
    return sorted(item.name for item in open_map(file).semantic().objects())


def test_it_is_a_warning_that_a_map_goes_on_and_is_saved_nowhere(node: Node, file: Path) -> None:
    (line,) = Node(file, saves=False).lines
    assert line.startswith("warning: no save_to (-o) says where")
    (line,) = Node(file, onto=False, saves=False).lines
    assert line.startswith("info: ")


def test_what_people_edit_in_the_file_of_a_live_map_stays(node: Node, file: Path) -> None:
    edit(file, lambda layer: (layer.rename(0, "Anna's box"), layer.add(square("zone", 5, 5))))
    node.show(20)
    node.save()
    assert names(file) == ["Anna's box", "zone"]
    renamed = open_map(file).semantic().get(0)
    assert renamed.attributes["evidence"] == 16, "and mapping goes on"
    assert renamed.attributes["by_hand"] == ["name"]
    assert f"info: {file} was edited; mapping goes on with the edits" in node.lines
    history = open_map(file).history
    assert history is not None
    assert [one.cause for one in history.revisions()] == ["mapping", "edit", "mapping"]


def test_edits_one_after_the_other_stay_and_can_be_taken_back(node: Node, file: Path) -> None:
    edit(file, lambda layer: layer.add(square("zone", 5, 5)))
    node.show(20)
    node.save()
    edit(file, lambda layer: layer.rename(0, "crate"))
    node.show(40)
    node.save()
    assert names(file) == ["crate", "zone"]
    edit(file, lambda layer: [layer.remove(item.id) for item in layer if item.name == "zone"])
    node.show(60)
    node.save()
    assert names(file) == ["crate"]


def test_what_was_deleted_does_not_come_back(node: Node, file: Path) -> None:
    edit(file, lambda layer: layer.remove(0))
    for first in (20, 40):
        node.show(first)
        node.save()
        assert names(file) == []


def test_edits_of_an_older_state_that_was_saved_over_a_newer_one_count(
    node: Node, file: Path
) -> None:
    opened = open_map(file)  # on a page
    node.show(20)
    node.save()
    opened.semantic().rename(0, "Anna's box")
    save_map(opened, file)
    node.show(40)
    node.save()
    (box,) = open_map(file).semantic().objects()
    assert (box.name, box.attributes["evidence"]) == ("Anna's box", 24)


def test_layers_and_frames_that_others_add_to_the_file_stay(node: Node, file: Path) -> None:
    hypermap = open_map(file)
    hypermap.add(SemanticLayer("zones", "map", [square("no entry", 2, 2)]))
    hypermap.metadata["building"] = "west"
    save_map(hypermap, file)
    node.show(20)
    node.save()
    saved = open_map(file)
    zones = saved["zones"]
    assert isinstance(zones, SemanticLayer)
    assert [item.name for item in zones.objects()] == ["no entry"]
    assert saved.metadata["building"] == "west"
    assert saved.metadata["frames"]["used"] == 16


def test_what_is_drawn_keeps_its_id_even_if_mapping_has_used_it_by_then(
    node: Node, file: Path
) -> None:
    edit(file, lambda layer: layer.add(square("zone", 5, 5)))  # as object 1
    for i in range(8):  # and so is the crate that mapping finds meanwhile
        seen = frame(20 + i, x=0.1 * i - 0.3)
        found = dataclasses.replace(boxes(seen), names=np.array(["crate"]))
        pose = seen.map_T_camera.copy()
        pose[1, 3] += 10
        node.map.add(
            dataclasses.replace(seen, stamp=DAY + 20 + i, map_T_camera=pose, detections=found)
        )
    node.save()
    assert names(file) == ["box", "crate", "zone"]
    assert open_map(file).semantic().get(1).name == "zone"
    history = open_map(file).history
    assert history is not None
    assert [change.kind for change in history.revisions()[-1].changes] == ["added"]


def test_edits_outlive_a_correction_of_the_poses(node: Node, file: Path) -> None:
    edit(file, lambda layer: (layer.rename(0, "Anna's box"), layer.add(square("zone", 5, 5))))
    node.show(20)
    node.save()
    stamps, poses = node.map.logged_poses()
    poses[:, 0, 3] += 1.0
    assert node.map.correct(trajectory_of(stamps, poses), 0.02) is not None
    node.save()
    assert names(file) == ["Anna's box", "zone"]
    moved = open_map(file).semantic().get(0)
    assert moved.footprint.centroid.x == pytest.approx(1.0, abs=0.05)


def test_a_map_that_another_program_puts_in_its_place_stays(node: Node, file: Path) -> None:
    save_map(Hypermap([SemanticLayer("semantic", "map", [square("desk", 0, 0)])]), file)
    node.show(20)
    node.save()
    node.show(40)
    node.close()
    assert names(file) == ["desk"]
    beside = file.with_name("office-1.hmap")
    assert open_map(beside).metadata["frames"]["used"] == 24
    (line,) = (line for line in node.lines if line.startswith("error"))
    assert line == (
        f"error: another program has replaced {file}, which stays as it is; this map is saved in "
        f"{beside} from now on"
    )


def test_a_node_that_has_saved_beside_another_map_goes_on_there(node: Node, file: Path) -> None:
    """Also once it is activated again, or if a client names the file."""
    save_map(Hypermap([SemanticLayer("semantic", "map", [square("desk", 0, 0)])]), file)
    node.show(20)
    node.activate_again()
    node.show(40)
    node.save(file.name)
    node.show(60)
    node.activate_again()
    assert names(file) == ["desk"]
    assert sorted(one.name for one in file.parent.glob("*.hmap")) == ["office-1.hmap", file.name]
    assert open_map(file.with_name("office-1.hmap")).metadata["frames"]["used"] == 32
    assert sum(line.startswith("error") for line in node.lines) == 1
    told = f"info: the map is saved in {file.with_name('office-1.hmap')}, at the end"
    assert node.lines.count(told) == 2


def test_two_nodes_on_one_file_lose_nothing_to_each_other(node: Node, file: Path) -> None:
    one, other = Node(file), Node(file)  # both go on with what is there
    one.show(20)
    one.save()
    other.show(40, 3)
    other.save()
    one.show(60)
    one.close()
    other.close()
    assert open_map(file).metadata["frames"]["used"] == 24
    assert open_map(file.with_name("office-1.hmap")).metadata["frames"]["used"] == 11


def test_a_file_that_is_gone_is_written_again(node: Node, file: Path) -> None:
    file.rename(file.with_name("yesterday.hmap"))
    node.show(20)
    node.save()
    assert open_map(file).metadata["frames"]["used"] == 16
    assert open_map(file.with_name("yesterday.hmap")).metadata["frames"]["used"] == 8


def test_what_was_edited_before_the_map_was_cleared_is_of_another_map(
    node: Node, file: Path
) -> None:
    edit(file, lambda layer: layer.rename(0, "Anna's box"))
    node.map.clear()
    node.show(20)
    node.save()
    assert names(file) == ["Anna's box"]
    assert names(file.with_name("office-1.hmap")) == ["box"]
