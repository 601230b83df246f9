"""The two ends of `hypermap demo`: a recording to map, and the truth to compare the map with."""

from __future__ import annotations

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.evaluation import Evaluation, evaluate
from hypermap.simulation.recording import SimulatedRecording
from hypermap.simulation.truth import true_objects
from hypermap.simulation.world import World, demo_world


def demo_recording(seed: int = 0) -> SimulatedRecording:
    """Return a drive of about 160 frames through the demo room.

    It comes without an occupancy map, so that mapping has to make one from depth.
    """
    return SimulatedRecording(demo_world(), has_occupancy=False, seed=seed)


def compare_with_truth(estimate: Hypermap, world: World) -> Evaluation:
    """Return how well a map's objects agree with the true ones.

    Args:
        estimate: a map whose first semantic layer is compared.
        world: the world that was mapped.

    Raises:
        HypermapError: If the map has no semantic layer.
    """
    layer = next((layer for layer in estimate.layers if isinstance(layer, SemanticLayer)), None)
    if layer is None:
        raise HypermapError("the map has no semantic layer to compare with the truth")
    return evaluate(layer.objects(), true_objects(world, layer.frame_id).objects())
