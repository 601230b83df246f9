"""Compares maps, layers or lists of objects, and lists the differences."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from hypermap.core.evidence import EvidenceTable
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.notes_layer import NotesLayer
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.opaque import OpaqueLayer
from hypermap.core.samples import Samples
from hypermap.core.semantic import SemanticLayer
from hypermap.core.value_layer import ValueLayer


def assert_same_map(actual: Hypermap, expected: Hypermap) -> None:
    """Raise an AssertionError unless layers, frames and metadata are exactly the same."""
    _same("the layers", [x.name for x in actual.layers], [x.name for x in expected.layers])
    _same("the transforms", list(actual.frames), list(expected.frames))
    _same("the metadata", actual.metadata, expected.metadata)
    for one, other in zip(actual.layers, expected.layers, strict=True):
        assert_same_layer(one, other)


def assert_same_layer(actual: Layer, expected: Layer) -> None:
    """Raise an AssertionError unless the layers are exactly the same.

    Layers of other packages are compared by what they answer.
    """
    where = f"layer {expected.name!r}"
    for key in ("class_name", "name", "frame_id", "settings"):
        _same(f"{where}: {key}", getattr(actual, key), getattr(expected, key))
    if isinstance(actual, OccupancyLayer) and isinstance(expected, OccupancyLayer):
        _same(f"{where}: the grid", actual.grid, expected.grid)
        _same_arrays(f"{where}: the cells", actual.cells, expected.cells)
    elif isinstance(actual, SemanticLayer) and isinstance(expected, SemanticLayer):
        assert_same_objects(actual.objects(), expected.objects())
        _same(f"{where}: rejected", actual.rejected, expected.rejected)
        assert_same_evidence(actual.evidence(), expected.evidence())
    elif isinstance(actual, ValueLayer) and isinstance(expected, ValueLayer):
        for key in ("grid", "unit", "decimals", "quantity", "made_by"):
            _same(f"{where}: {key}", getattr(actual, key), getattr(expected, key))
        for key in ("cells", "deviations", "stamps"):
            _same_arrays(f"{where}: the {key}", getattr(actual, key), getattr(expected, key))
        _same_samples(f"{where}: the samples", actual.samples, expected.samples)
    elif isinstance(actual, NotesLayer) and isinstance(expected, NotesLayer):
        _same(f"{where}: the notes", actual.notes(), expected.notes())
        _same(f"{where}: next_id", actual.next_id, expected.next_id)
        hashes = [_hashes_of_contents(layer) for layer in (actual, expected)]
        _same(f"{where}: the attached files", *hashes)
    elif isinstance(actual, OpaqueLayer) and isinstance(expected, OpaqueLayer):
        _same(f"{where}: the files", actual.files, expected.files)
    else:
        assert_same_answers(actual, expected)


def assert_same_objects(
    actual: Sequence[SemanticObject], expected: Sequence[SemanticObject]
) -> None:
    """Raise an AssertionError unless the objects, in their order, are exactly the same."""
    _same("the objects' names", [x.name for x in actual], [x.name for x in expected])
    for one, other in zip(actual, expected, strict=True):
        for key in (field.name for field in dataclasses.fields(SemanticObject)):
            what = f"object {other.id} {other.name!r}: {key}"
            if key == "footprint":
                same = bool(shapely.equals_identical(one.footprint, other.footprint))
                _require(same, what, one.footprint.wkt, other.footprint.wkt)
            else:
                _same(what, getattr(one, key), getattr(other, key))


def assert_same_evidence(actual: EvidenceTable | None, expected: EvidenceTable | None) -> None:
    """Raise an AssertionError unless the evidence is exactly the same, or missing in both."""
    _same("whether there is evidence", actual is not None, expected is not None)
    if actual is None or expected is None:
        return
    for key in (field.name for field in dataclasses.fields(EvidenceTable)):
        one, other = getattr(actual, key), getattr(expected, key)
        if one.dtype == object:
            _same(f"the evidence's number of {key}", len(one), len(other))
            is_same = shapely.equals_identical(one, other)
            _require(bool(np.all(is_same)), f"the evidence's {key}", one, other)
        else:
            _same_arrays(f"the evidence's {key}", one, other)


def assert_same_answers(actual: Layer, expected: Layer) -> None:
    """Raise an AssertionError unless two layers give the same answers everywhere."""
    where = f"layer {expected.name!r}"
    extents = actual.extent(), expected.extent()
    _require(bool(shapely.equals_identical(*extents)), f"{where}: the extent", *extents)
    for question in ("labels_in", "values_in"):
        hits = [getattr(layer, question)(extents[1]) for layer in (actual, expected)]
        _same_arrays(f"{where}: {question}", hits[0].values, hits[1].values)
        _same_arrays(f"{where}: locations", hits[0].points_xy, hits[1].points_xy)


def _hashes_of_contents(layer: NotesLayer) -> list[str]:
    """Return the hash of what can be read of each file."""
    hashes = []
    for each in (each for note in layer for each in note.attachments):
        with each.open() as opened:
            hashes.append(hashlib.sha256(opened.read()).hexdigest())
    return hashes


def _same_samples(what: str, actual: Samples | None, expected: Samples | None) -> None:
    _same(f"whether there are {what}", actual is not None, expected is not None)
    if actual is not None and expected is not None:
        for key in (field.name for field in dataclasses.fields(Samples)):
            _same_arrays(f"{what}: {key}", getattr(actual, key), getattr(expected, key))


def _same(what: str, actual: Any, expected: Any) -> None:
    _require(actual == expected, what, actual, expected)


def _same_arrays(what: str, actual: Any, expected: Any) -> None:
    np.testing.assert_array_equal(actual, expected, err_msg=f"{what} differ", strict=True)


def _require(same: bool, what: str, actual: Any, expected: Any) -> None:
    if not same:
        raise AssertionError(f"{what} differ:\n  actual:   {actual}\n  expected: {expected}")
