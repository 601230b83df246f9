"""A room with known furniture is recorded, read back, mapped, saved, opened, and found again."""

from __future__ import annotations

from pathlib import Path

from hypermap.evaluation import evaluate
from hypermap.formats import open_map, save_map
from hypermap.mapping.config import profile
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detectors.sources import detections_from_file
from hypermap.recordings import open_recording
from hypermap.simulation import EXACT_DETECTOR, SimulatedRecording, ground_truth, write_tum
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, Wall, World, WorldObject

ROOM = World(
    "room",
    FloorPlan((0, 0, 5, 4)),
    objects=(
        WorldObject("table", (3.2, 2.8), size={"length": 0.8, "width": 0.8}),
        WorldObject("cup", (3.1, 2.7), z=0.74),
        WorldObject("plant", (3.2, 0.8)),
    ),
    walls=(Wall(rectangle=(-0.05, -0.05, 5.05, 4.05)),),
    drive=DrivePlan(((0.8, 2.0), (1.8, 2.2, 30), (1.8, 1.6, -30)), speed=0.6),
)


def test_known_furniture_is_found_again(tmp_path: Path) -> None:
    recording = SimulatedRecording(
        ROOM, detector_noise=EXACT_DETECTOR, has_masks=True, has_occupancy=False
    )
    write_tum(recording, tmp_path / "drive")
    found = map_recording(
        open_recording(tmp_path / "drive"),
        detections_from_file(tmp_path / "drive" / "detections.json"),
        profile("default"),
    )
    save_map(found, tmp_path / "room.hmap")

    again, truth = open_map(tmp_path / "room.hmap"), ground_truth(ROOM)
    evaluation = evaluate(again["semantic"].objects(), truth["semantic"].objects())
    assert evaluation.overall.detection[0].recall == 1
    assert evaluation.overall.centroid_distance < 0.1
    assert again.label_at("occupancy", [[3.0, 1.7]]).tolist() == ["Free"]
    assert again.label_at("occupancy", [[5.0, 2.0]]).tolist() == ["Occupied"]
