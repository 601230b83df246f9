"""What a map says about how it was made: the metadata that mapping writes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hypermap._version import __version__
from hypermap.core.history import MAP_ID, MAP_VERSION
from hypermap.formats.backup import BY_HAND
from hypermap.mapping.alignment import Aligner
from hypermap.mapping.by_hand import HandEdit, ids_by_edit
from hypermap.mapping.config import MappingConfig, to_dict
from hypermap.mapping.counts import Counts
from hypermap.mapping.drives import Drive, map_id

MADE_BY = "hypermap_version"
_DEFAULTS_OF = "defaults_of_version"


def version_of_defaults(metadata: Mapping[str, Any]) -> object:
    """Return the version of Hypermap whose defaults a map was begun with; None if unknown."""
    return metadata.get(_DEFAULTS_OF, metadata.get(MADE_BY))


def made_metadata(
    before: dict[str, Any],
    config: MappingConfig,
    drives: list[Drive],
    counts: Counts,
    surplus: int,
    aligner: Aligner | None,
    edits: dict[int, HandEdit],
) -> dict[str, Any]:
    """Return the metadata of a map.

    Args:
        before: the metadata of the map that mapping continues; empty for a new map.
        config: of mapping.
        drives: all drives in the map.
        counts: of all their frames.
        surplus: detections that were dropped because their frames had too many.
        aligner: corrects the poses by the occupancy map; None if they are as recorded.
        edits: made by hand, by the objects' ids.
    """
    metadata = before | {
        MADE_BY: __version__,
        "frames": counts.as_metadata(),
        **({"surplus_detections": surplus} if surplus else {}),
        "poses": "as recorded" if aligner is None else "corrected by the occupancy map",
        **({} if aligner is None else {"pose_corrections": aligner.corrections.summary()}),
        "config": to_dict(config),
        "drives": [drive.described() for drive in drives],
        **_identity(before, drives, config),
    }
    begun_by = version_of_defaults(before)
    if begun_by not in (None, __version__):  # whose settings the map keeps
        metadata[_DEFAULTS_OF] = begun_by
    metadata.pop(BY_HAND, None)
    if marked := ids_by_edit(edits):
        metadata[BY_HAND] = marked
    return metadata


def _identity(before: dict[str, Any], drives: list[Drive], config: MappingConfig) -> dict[str, Any]:
    """Return the id of the map, which it keeps, and its version, which counts up.

    The same first frame, pose and configuration give the same id, and so the same bytes.
    """
    known = before.get(MAP_VERSION)
    return {
        MAP_ID: before.get(MAP_ID) or map_id(drives, to_dict(config)),
        MAP_VERSION: 1 + (known if type(known) is int else 0),
    }
