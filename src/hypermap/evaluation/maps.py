"""The objects of whole maps, transformed into one frame for comparison."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace

from hypermap.core.errors import FrameError, HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject


@dataclass(frozen=True, eq=False)
class MapObjects:
    """The objects of all semantic layers of a map.

    Attributes:
        name: the map's name in messages and results, such as its path.
        frame_id: the frame of the footprints.
        objects: in the order of the layers.
        layers: name of the layer of each object.
        repaired: number of outlines that cross themselves; they count as what they wind around.
        unread: number of entries in the map's files that could not be read, and so are missing.
    """

    name: str
    frame_id: str
    objects: tuple[SemanticObject, ...]
    layers: tuple[str, ...]
    repaired: int
    unread: int


def map_objects(
    hypermap: Hypermap, name: str, ground_truth: Hypermap | None = None, truth_name: str = ""
) -> MapObjects:
    """Return all objects of a map in the base frame of the true map.

    Args:
        hypermap: the map.
        name: its name in messages.
        ground_truth: the true map; None if this is the true map.
        truth_name: name of the true map in messages.

    Raises:
        HypermapError: If the map has no semantic layer, or the true map no objects.
        FrameError: If neither map has a transform between the two base frames, or the map has
            none between a layer's frame and its own.
    """
    if ground_truth is None:
        found = objects_in_frame(hypermap, name, hypermap.base_frame, Pose2D())
        if not found.objects:
            raise HypermapError(f"{name}: the ground truth has no objects to compare with")
        return found
    truth_T_base = _pose_in_truth(hypermap, name, ground_truth, truth_name)
    return objects_in_frame(hypermap, name, ground_truth.base_frame, truth_T_base)


def objects_in_frame(
    hypermap: Hypermap, name: str, frame_id: str, frame_T_base: Pose2D
) -> MapObjects:
    """Return all objects of a map in a frame; rooms count only if it has no other objects.

    Args:
        hypermap: the map.
        name: its name in messages.
        frame_id: name of the frame.
        frame_T_base: takes points in the base frame of the map to the frame.

    Raises:
        HypermapError: If the map has no semantic layer.
        FrameError: If it has no transform between a layer's frame and its own.
    """
    layers = [layer for layer in hypermap.layers if isinstance(layer, SemanticLayer)]
    layers = [layer for layer in layers if layer.name != ROOMS] or layers
    if not layers:
        raise HypermapError(f"{name}: the map has no layer of objects, so nothing can be compared")
    objects: list[SemanticObject] = []
    for layer in layers:
        frame_T_layer = frame_T_base @ _pose_in_base(hypermap, name, layer)
        objects += [_moved(thing, frame_T_layer) for thing in layer.objects()]
    return MapObjects(
        name=name,
        frame_id=frame_id,
        objects=tuple(objects),
        layers=tuple(layer.name for layer in layers for _ in range(len(layer))),
        repaired=sum(not thing.footprint.is_valid for thing in objects),
        unread=sum(len(layer.rejected) for layer in layers),
    )


def _pose_in_base(hypermap: Hypermap, name: str, layer: SemanticLayer) -> Pose2D:
    try:
        return hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
    except FrameError as error:
        raise FrameError(f"{name}: layer {layer.name!r}: {error}") from None


def _pose_in_truth(
    hypermap: Hypermap, name: str, ground_truth: Hypermap, truth_name: str
) -> Pose2D:
    """Return the pose of a map's base frame in that of the true map, from either map."""
    target, source = ground_truth.base_frame, hypermap.base_frame
    for frames in (ground_truth.frames, hypermap.frames):
        with contextlib.suppress(FrameError):
            return frames.lookup(target, source)
    raise FrameError(
        f"{name} is in the frame {source!r} and {truth_name} in {target!r}, and neither map has a "
        "transform between the two; add it to the `transforms` of one of them"
    )


def _moved(thing: SemanticObject, target_T_thing: Pose2D) -> SemanticObject:
    return replace(thing, footprint=target_T_thing.apply_geometry(thing.footprint))
