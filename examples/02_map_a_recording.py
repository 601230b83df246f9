"""Make a map of a recording: prints what was found, and writes recording.hmap and recording.png.

    python examples/02_map_a_recording.py [RECORDING MODEL.onnx]

Without arguments, a part of the simulated drive is mapped, with simulated detections.
"""

import sys

from hypermap import save_map
from hypermap.mapping.config import profile
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detectors import load_detector
from hypermap.perception.detectors.sources import (
    detections_from_detector,
    detections_from_recording,
)
from hypermap.perception.recording import Recording
from hypermap.recordings import open_recording
from hypermap.simulation import SimulatedRecording, demo_world
from hypermap.viewer.picture import render

recording: Recording  # a protocol, which both of these have
if len(sys.argv) > 2:
    recording = open_recording(sys.argv[1])
    source = detections_from_detector(load_detector(sys.argv[2]))
else:
    recording = SimulatedRecording(demo_world(), rate=0.5, has_occupancy=False)
    source = detections_from_recording()

made = map_recording(recording, source, profile("default"))
for item in made.semantic():
    x, y = item.footprint.centroid.coords[0]
    print(f"{item.name} at ({x:.2f}, {y:.2f}), existence {item.existence:.1f}")

save_map(made, "recording.hmap")
render(made, "recording.png")
print("wrote recording.hmap and recording.png")
