"""The layers of two maps in one: the first map's, then the others of the second one."""

from __future__ import annotations

import copy
from dataclasses import dataclass

from hypermap.alignment.frames import frames_of, free_name, in_frame_of, with_frames_renamed
from hypermap.core.errors import FrameError
from hypermap.core.frames import FrameTree, Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.mapping.going_on import SEMANTIC, layer_of_objects
from hypermap.mapping.merging.settings import CannotMerge


@dataclass(frozen=True, eq=False)
class MergedLayers:
    """The layers of two maps.

    Attributes:
        layers: in their order; the semantic layer that mapping makes is empty.
        frames: those of both maps.
        renamed: new names of layers of the second map whose names were in use, by their old names.
    """

    layers: list[Layer]
    frames: FrameTree
    renamed: dict[str, str]


def grid_of(hypermap: Hypermap) -> OccupancyLayer:
    """Return the occupancy layer that belongs to the objects: the first one.

    Raises:
        CannotMerge: If it is not in the base frame.
    """
    grids = (layer for layer in hypermap if isinstance(layer, OccupancyLayer))
    layer = next(grids, OccupancyLayer("occupancy", hypermap.base_frame))
    if layer.frame_id != hypermap.base_frame:
        raise CannotMerge(
            f"the occupancy layer {layer.name!r} is in {layer.frame_id!r}, not in the base frame "
            f"{hypermap.base_frame!r}"
        )
    return layer


def merged_layers(
    first: Hypermap, second: Hypermap, a_T_b: Pose2D, occupancy: OccupancyLayer
) -> MergedLayers:
    """Return the layers of two maps, in frames of their own.

    Args:
        first: a map made by mapping.
        second: another one; its objects and its grid (`grid_of`) are left out.
        a_T_b: transforms points from the base frame of the second map to that of the first.
        occupancy: takes the place of the first map's layer with its name.

    Raises:
        FrameError: If the frames of both maps cannot be joined in one tree.
    """
    own = _layers_of_first(first, occupancy)
    if layer_of_objects(first) is None and layer_of_objects(second) is not None:
        own.append(SemanticLayer(SEMANTIC, first.base_frame))
    skip = {grid_of(second).name, SEMANTIC}
    if all(layer.name in skip for layer in second):
        return MergedLayers(own, first.frames, {})
    second = _with_own_frames(first, second, a_T_b)
    try:
        frames = FrameTree([*first.frames, *second.frames])
    except FrameError as error:
        raise FrameError(f"the frames of the two maps do not fit together: {error}") from None
    others, renamed = _renamed(
        [layer for layer in second if layer.name not in skip],
        {layer.name for layer in first} | {SEMANTIC},
    )
    return MergedLayers([*own, *others], frames, renamed)


def _layers_of_first(first: Hypermap, occupancy: OccupancyLayer) -> list[Layer]:
    """Return the first map's layers, with the given occupancy layer and an empty semantic one."""
    layers: list[Layer] = []
    for layer in first:
        if isinstance(layer, SemanticLayer) and layer.name == SEMANTIC:
            empty = SemanticLayer(layer.name, layer.frame_id)
            empty.settings, empty.rejected = layer.settings, layer.rejected
            layers.append(empty)
        else:
            layers.append(occupancy if layer.name == occupancy.name else layer)
    return layers


def _with_own_frames(first: Hypermap, second: Hypermap, a_T_b: Pose2D) -> Hypermap:
    """Return the second map with no frame of the first one but its base frame."""
    base = first.base_frame
    if second.base_frame == base or base not in frames_of(second):
        second = in_frame_of(first, second, a_T_b)
    known = frames_of(first)
    taken = {*known, *frames_of(second)}
    names = {}
    for frame in sorted((known & frames_of(second)) - {base}):
        names[frame] = free_name(frame, taken)
        taken.add(names[frame])
    return with_frames_renamed(second, names)


def _renamed(layers: list[Layer], used: set[str]) -> tuple[list[Layer], dict[str, str]]:
    """Return layers with names that are not used yet, and the new names by the old ones."""
    found, renamed = [], {}
    for layer in layers:
        name = layer.name if layer.name not in used else free_name(layer.name, used)
        used.add(name)
        if name != layer.name:
            renamed[layer.name] = name
            layer = copy.copy(layer)
            layer.name = name
        found.append(layer)
    return found, renamed
