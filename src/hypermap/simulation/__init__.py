"""A simulated room with known truth becomes RGB-D frames."""

from hypermap.simulation.bag_writer import write_bag
from hypermap.simulation.depth_noise import EXACT_DEPTH, DepthNoise
from hypermap.simulation.detector import EXACT_DETECTOR, DetectorNoise
from hypermap.simulation.levels import LEVELS, Errors, errors_of_level
from hypermap.simulation.map_noise import MapNoise
from hypermap.simulation.network import network_detector
from hypermap.simulation.pose_noise import PoseNoise
from hypermap.simulation.recording import SimulatedRecording
from hypermap.simulation.sensors import SENSORS, sensor_of
from hypermap.simulation.truth import ground_truth
from hypermap.simulation.variation import varied
from hypermap.simulation.world import (
    World,
    built_in_world,
    built_in_worlds,
    demo_world,
    load_world,
)
from hypermap.simulation.writer import write_tum

__all__ = [
    "EXACT_DEPTH",
    "EXACT_DETECTOR",
    "LEVELS",
    "SENSORS",
    "DepthNoise",
    "DetectorNoise",
    "Errors",
    "MapNoise",
    "PoseNoise",
    "SimulatedRecording",
    "World",
    "built_in_world",
    "built_in_worlds",
    "demo_world",
    "errors_of_level",
    "ground_truth",
    "load_world",
    "network_detector",
    "sensor_of",
    "varied",
    "write_bag",
    "write_tum",
]
