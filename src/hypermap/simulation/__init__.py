"""A simulated room with known truth becomes RGB-D frames."""

from hypermap.simulation.detector import EXACT_DETECTOR, DetectorNoise
from hypermap.simulation.noise import EXACT_DEPTH, DepthNoise, PoseNoise
from hypermap.simulation.recording import SimulatedRecording
from hypermap.simulation.truth import ground_truth
from hypermap.simulation.world import World, demo_world, load_world
from hypermap.simulation.writer import write_tum

__all__ = [
    "EXACT_DEPTH",
    "EXACT_DETECTOR",
    "DepthNoise",
    "DetectorNoise",
    "PoseNoise",
    "SimulatedRecording",
    "World",
    "demo_world",
    "ground_truth",
    "load_world",
    "write_tum",
]
