"""Continuing a map: whether that is possible, and which parts of the map stay."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import shapely

from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.semantic import SemanticLayer
from hypermap.formats.backup import BY_HAND
from hypermap.history import HistoryPolicy
from hypermap.mapping.by_hand import HandEdit, hand_edits, ids_by_edit, marked
from hypermap.mapping.config import MappingConfig, profile_like, to_dict
from hypermap.mapping.mapper_state import MapperState, parse_published, parse_state
from hypermap.mapping.overrides import override
from hypermap.mapping.stages import EvidenceConfig

SEMANTIC = "semantic"
"""Name of the semantic layer that mapping makes."""

_PART = 0.5  # least share of the shape of a part that is in the object


class CannotGoOn(HypermapError):
    """Mapping cannot continue a map."""


def config_to_go_on_with(hypermap: Hypermap, asked: MappingConfig | None = None) -> MappingConfig:
    """Return the configuration of a map, after checking that mapping can continue it.

    Whether pictures are kept, and whether poses are corrected by the map, may change. Settings that
    the version that made the map did not know are those of its profile.

    Args:
        hypermap: the map.
        asked: the configuration that the user asks for; must be that of the map, but for values
            that are those of its profile, which another version may have changed; None for any.

    Raises:
        CannotGoOn: If it cannot.
    """
    values = hypermap.metadata.get("config")
    if not isinstance(values, Mapping):
        raise CannotGoOn("this map was not made by mapping, so mapping cannot continue it")
    try:
        config = override(profile_like(values), values)
    except FormatError as error:
        raise CannotGoOn(f"this map was made by another version: config: {error}") from error
    if asked is not None:
        alignment = replace(config.alignment, enabled=asked.alignment.enabled)
        config = replace(config, pictures=asked.pictures, alignment=alignment)
        _check_same(config, asked)
    if hypermap.mapper_state is None:
        raise CannotGoOn(
            "the state of the mapper is not in the map, for example after --drop-evidence; "
            "map all recordings again"
        )
    try:
        HistoryPolicy.of(hypermap.metadata)  # without which nothing could be saved in the end
    except HypermapError as error:
        raise CannotGoOn(str(error)) from error
    return config


def _check_same(config: MappingConfig, asked: MappingConfig) -> None:
    """Raise a CannotGoOn if a user asks for other settings than those of a map."""
    before, now = to_dict(config), to_dict(asked)
    own = profile_like(before)
    defaults = to_dict(own) if profile_like(now) == own else {}
    for stage, values in before.items():
        for key, value in values.items():
            is_default = key != "min_score" and defaults.get(stage, {}).get(key) == now[stage][key]
            if now[stage][key] != value and not is_default:
                raise CannotGoOn(
                    f"the map was made with {stage}: {key}: {value}, not {now[stage][key]}; "
                    "mapping continues with the map's configuration: leave out "
                    "--profile, --config and --score, or make a new map"
                )


def state_of(hypermap: Hypermap, config: MappingConfig) -> MapperState:
    """Return the state of the mapper in a map with this configuration.

    Raises:
        CannotGoOn: If it cannot be read.
    """
    kept = hypermap.mapper_state
    content = kept() if callable(kept) else kept or b""
    try:
        state = parse_state(content, config.evidence)
    except FormatError as error:
        raise CannotGoOn(f"{error}; map all recordings again") from error
    layer = layer_of_objects(hypermap)
    for track in state.tracks.objects:
        if layer is None or track.id in state.apart:
            continue
        if pictures := layer.kept_pictures.get(track.id):
            track.buffer.pictures = pictures
        if layer.kept_embeddings is not None:
            own = layer.kept_embeddings.embedding(track.id)
            track.buffer.embedding = own or track.buffer.embedding
    return state


def edits_of(hypermap: Hypermap, state: MapperState, config: EvidenceConfig) -> dict[int, HandEdit]:
    """Return all edits made by hand to a map, by the objects' ids.

    What was deleted, or has got another shape, takes along its parts and doubles, which the map
    does not show: they are deleted.

    Raises:
        CannotGoOn: If the semantic layer is missing.
    """
    layer = layer_of_objects(hypermap)
    if layer is not None:
        before = {track.id: track.by_hand for track in state.tracks.objects if track.by_hand}
        edits = hand_edits(state.published, layer, before)
        return edits | _edits_of_parts(edits, state, config)
    if state.published:
        raise CannotGoOn("its semantic layer is missing; was it renamed or removed?")
    return {}


def _edits_of_parts(
    edits: Mapping[int, HandEdit], state: MapperState, config: EvidenceConfig
) -> dict[int, HandEdit]:
    """Return the deletions of tracks that the map shows as parts of edited objects."""
    tracks, shown = state.tracks, {item.id: item for item in state.published}
    is_there = tracks.existence > config.publish_above
    free = {n: track for n, track in enumerate(tracks.objects) if track.by_hand is None}
    hidden = [n for n, track in free.items() if is_there[n] and track.id not in shown]
    found: dict[int, HandEdit] = {}
    for whole in free.values():
        edit, item = edits.get(whole.id), shown.get(whole.id)
        if item is None or edit is None or not (edit.is_deleted or edit.shape is not None):
            continue
        for row in hidden:
            part, shape = free[row], tracks.shapes.polygons[row]
            shared = shapely.area(shapely.intersection(shape.geometry, item.footprint))
            if part.name == whole.name and shared >= _PART * shape.area:
                found[part.id] = HandEdit(is_deleted=True)
    return found


def layer_of_objects(hypermap: Hypermap) -> SemanticLayer | None:
    """Return the semantic layer that mapping has made; None if there is none."""
    named = (layer for layer in hypermap if layer.name == SEMANTIC)
    return next((layer for layer in named if isinstance(layer, SemanticLayer)), None)


def with_marks(hypermap: Hypermap) -> Hypermap:
    """Return a map in which edits made by hand are marked; see `by_hand`.

    Raises:
        FormatError: If its mapper state cannot be read.
    """
    kept = hypermap.mapper_state
    layer = layer_of_objects(hypermap)
    if kept is None or layer is None:
        return hypermap
    published, before = parse_published(kept() if callable(kept) else kept)
    edits = hand_edits(published, layer, before)
    other = hypermap.with_layer(marked(layer, edits))
    other.metadata.pop(BY_HAND, None)
    if edits:
        other.metadata[BY_HAND] = ids_by_edit(edits)
    return other


def replaced(base: Hypermap, layers: Iterable[Layer]) -> list[Layer]:
    """Return the layers of a map, some replaced by layers with the same names; new ones come first.

    Settings of a layer stay, and so do its entries that could not be read.
    """
    new: dict[str, Any] = {layer.name: layer for layer in layers}
    found: list[Layer] = []
    for old in base:
        layer = new.pop(old.name, old)
        if layer is not old:
            layer.settings = old.settings
            if isinstance(layer, SemanticLayer) and isinstance(old, SemanticLayer):
                layer.rejected = old.rejected
        found.append(layer)
    return [*new.values(), *found]
