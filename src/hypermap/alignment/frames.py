"""Writes an alignment into the frames of a map."""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping

from hypermap.core.errors import FrameError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer


def in_frame_of(
    first: Hypermap, second: Hypermap, a_T_b: Pose2D, frame_id: str | None = None
) -> Hypermap:
    """Return the second map with a transform to the base frame of the first.

    No data change. If a frame of the second map has the name of the first map's base frame, it gets
    another name, because the two frames differ.

    Args:
        first: gives the name of the frame.
        second: the map.
        a_T_b: takes points in the base frame of the second map to that of the first.
        frame_id: the new name of the second map's frame; None for one with a number.

    Raises:
        FrameError: If the second map's base frame has a parent already, or the new name is in use.
    """
    target, base = first.base_frame, second.base_frame
    frames = frames_of(second)
    if frame_id is not None and frame_id in {*frames - {base}, target}:
        raise FrameError(f"there is a frame {frame_id!r} already; give another name")
    names = {} if frame_id is None else {base: frame_id}
    if target in frames and target not in names:
        names[target] = free_name(target, frames)
    other = with_frames_renamed(second, names)
    other.frames = FrameTree([*other.frames, Transform(target, other.base_frame, a_T_b)])
    return other


def frames_of(hypermap: Hypermap) -> set[str]:
    """Return the frames of a map's transforms and layers."""
    return {*hypermap.frames.frames, *(layer.frame_id for layer in hypermap)}


def with_frames_renamed(hypermap: Hypermap, names: Mapping[str, str]) -> Hypermap:
    """Return a map some of whose frames have other names; it shares all data with the given one.

    Args:
        hypermap: the map.
        names: the new names, by the old ones.
    """
    layers = [
        _renamed(layer, names[layer.frame_id]) if layer.frame_id in names else layer
        for layer in hypermap
    ]
    other = hypermap.with_layers(layers)
    other.frames = FrameTree(
        Transform(names.get(one.parent, one.parent), names.get(one.child, one.child), one.pose)
        for one in hypermap.frames
    )
    return other


def free_name(name: str, taken: Collection[str]) -> str:
    """Return a name with the first number that makes it new.

    >>> free_name("map", {"map", "map_2"})
    'map_3'
    """
    number = 2
    while f"{name}_{number}" in taken:
        number += 1
    return f"{name}_{number}"


def _renamed(layer: Layer, frame_id: str) -> Layer:
    other = copy.copy(layer)
    other.frame_id = frame_id
    return other
