"""Recorded detections and occupancy maps."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import FormatError, HypermapError
from hypermap.perception.detectors.origin import detection_origin
from hypermap.recordings import open_recording

from .bag_builder import (
    DARKNET,
    GRID,
    KINDS,
    VISION,
    BagBuilder,
    add_images,
    add_poses,
    grid,
    header,
)
from .shots import SHOTS, START, Shot


def darknet(kind: str, shot: Shot) -> Any:
    box = {"probability": 0.75, "xmin": 3, "ymin": 4, "xmax": 9, "ymax": 8}
    box["Class" if kind == "ros1" else "class_id"] = "cup"
    stamps = {"header": header(shot.stamp + 10**8), "image_header": header(shot.color_stamp)}
    return stamps | {"bounding_boxes": [box]}


def vision(kind: str, shot: Shot) -> Any:
    if kind == "ros1":
        results: Any = [{"id": 3, "score": 0.25}, {"id": 41, "score": 0.75}]
        center: Any = {"x": 6.0, "y": 6.0}
    else:
        likely = {"hypothesis": {"class_id": "cup", "score": 0.75}}
        results = [{"hypothesis": {"class_id": "cat", "score": 0.25}}, likely]
        center = {"position": {"x": 6.0, "y": 6.0}}
    found = {"results": results, "bbox": {"center": center, "size_x": 6.0, "size_y": 4.0}}
    nothing = {"bbox": {"center": center, "size_x": 6.0, "size_y": 4.0}}
    return {"header": header(shot.color_stamp), "detections": [nothing, found]}


@pytest.mark.parametrize(("type_name", "make"), [(DARKNET, darknet), (VISION, vision)])
@pytest.mark.parametrize("kind", [*KINDS, "db3 without definitions"])
def test_recorded_detections_go_with_the_image_they_were_made_from(
    tmp_path: Path, kind: str, type_name: str, make: Callable[[str, Shot], Any]
) -> None:
    kind, _, is_without = kind.partition(" without ")
    bag = BagBuilder(tmp_path, kind)
    with bag:
        add_poses(bag, SHOTS)
        for shot in SHOTS:
            add_images(bag, shot)
        late = SHOTS[-1].stamp + 10**9
        bag.add("/boxes", type_name, late, make(bag.kind, SHOTS[2]))
    if is_without:  # as ROS 2 wrote them before Iron
        [file] = bag.path.glob("*.db3")
        with closing(sqlite3.connect(file)) as database, database:
            database.execute("DELETE FROM message_definitions")
    recording = open_recording(bag.path)
    found = [frame.detections for frame in recording.frames()]
    assert [detections is None for detections in found] == [True, True, False, True]
    assert found[2] is not None
    is_number = type_name == VISION and bag.kind == "ros1"
    assert found[2].names.tolist() == ["41" if is_number else "cup"]
    assert found[2].scores.tolist() == [0.75]
    assert found[2].xyxy.tolist() == [[3, 4, 9, 8]]
    notes = recording.info().notes
    assert "recorded detections in 1 of 4 frames" in notes
    by_number = "the recorded detections name classes by number, and so will the map"
    assert (by_number in notes) == is_number


@pytest.mark.parametrize("late", [0, 10**7, 25 * 10**7])
def test_detections_that_were_stamped_after_the_image_are_told(tmp_path: Path, late: int) -> None:
    """At 0.01 s they are taken as those of the image, at 0.25 s they are of none."""
    with BagBuilder(tmp_path, "mcap") as bag:
        add_poses(bag, SHOTS)
        for shot in SHOTS[:2]:
            add_images(bag, shot)
        stamped = replace(SHOTS[1], color_stamp=SHOTS[1].color_stamp + late)
        bag.add("/boxes", VISION, SHOTS[1].stamp + 10**9, vision(bag.kind, stamped))
    recording = open_recording(bag.path)
    info = recording.info()
    assert any("exactly the stamp of a color image" in note for note in info.notes) == (
        late == 10**7
    )
    if late < 10**8:
        assert not info.missing
        assert detection_origin(recording, None, None, 0.3, None) is not None
        return
    [said] = info.missing
    assert said.startswith("none of the recorded detections on /boxes has the stamp of a frame's")
    with pytest.raises(HypermapError, match="none of the recorded detections on /boxes"):
        detection_origin(recording, None, None, 0.3, None)


def test_the_last_occupancy_map_becomes_a_layer(bag: BagBuilder) -> None:
    with bag:
        bag.add("/move_base/costmap", GRID, START, grid([100] * 6))
        bag.add("/map", GRID, START, grid([-1] * 6))
        bag.add("/map", GRID, START + 5, grid([0, 100, -1, 0, 50, 0], "/map"))
    layer = open_recording(bag.path).occupancy()
    assert layer is not None
    assert layer.frame_id == "map"
    assert layer.cells is not None
    assert layer.cells.tolist() == [[0, 100, -1], [0, 50, 0]]
    assert layer.grid is not None
    assert layer.grid.origin.yaw == pytest.approx(np.pi / 2)
    assert layer.grid.centers([0], [0])[0] == pytest.approx([0.75, 2.25])


def test_a_map_in_another_frame_is_left_out_and_noted(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        bag.add("/map", GRID, START, grid([0] * 6, "floor_2"))
    recording = open_recording(bag.path)
    assert recording.occupancy() is None
    note = "the map on /map is left out: it is not in frame 'map'"
    assert note in recording.info().notes


def test_a_map_with_too_few_cells_is_an_error_that_names_the_topic(tmp_path: Path) -> None:
    with BagBuilder(tmp_path, "mcap") as bag:
        bag.add("/map", GRID, START, grid([0] * 6, width=4))
    with pytest.raises(FormatError) as caught:
        open_recording(bag.path).occupancy()
    assert str(caught.value) == f"{bag.path}: /map: the map of 4 x 2 cells has 6 numbers"
