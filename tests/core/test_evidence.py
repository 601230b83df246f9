"""Evidence as columns that fit each other."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
import shapely

from hypermap.core.arrays import as_objects
from hypermap.core.evidence import EvidenceTable

BOX = shapely.box(0, 0, 1, 1)
HOLLOW = shapely.from_wkt("POLYGON((0 0, 1 0, 1 1, 0 0), EMPTY)")
with np.errstate(invalid="ignore"):
    NAN = shapely.Polygon([(0, 0), (np.nan, 0), (1, 1)])


def table() -> EvidenceTable:
    """Three observations in two views, of which the first saw two objects."""
    return EvidenceTable(
        object_ids=np.array([7, 3, 7]),
        views=np.array([0, 0, 1]),
        scores=np.array([0.5, 0.25, 1 / 3]),
        footprints=as_objects(shapely.box(k, 0, k + 1 / 3, 1) for k in range(3)),
        heights=np.array([[0, 1], [0.5, 2 / 3], [0, 2]]),
        stamps=np.array([4.0, 5.0]),
        poses=np.stack([np.eye(4), 2 / 3 * np.eye(4)]),
        areas=as_objects([BOX, shapely.Polygon()]),
    )


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("views", np.array([0, 1]), "views must have shape (3,), got (2,)"),
        ("scores", np.zeros((3, 1)), "scores must have shape (3,), got (3, 1)"),
        ("footprints", as_objects([BOX]), "footprints must have shape (3,), got (1,)"),
        ("heights", np.zeros(3), "heights must have shape (3, 2), got (3,)"),
        ("poses", np.zeros((2, 3, 4)), "poses must have shape (2, 4, 4), got (2, 3, 4)"),
        ("areas", as_objects([]), "areas must have shape (2,), got (0,)"),
        ("scores", np.array([0, 1, np.nan]), "scores must be finite"),
        ("stamps", np.array([0, np.inf]), "stamps must be finite"),
        ("views", np.array([0, 0, 2]), "views must be rows of the 2 views"),
        ("views", np.array([0, 0, -1]), "views must be rows of the 2 views"),
        ("footprints", as_objects([BOX, BOX, shapely.Polygon()]), "a footprint must not be empty"),
        ("footprints", as_objects([BOX, BOX, shapely.box(0, 0, 1, 2e9)]),
         "shapes must be finite and within 1e+09 m"),
        ("areas", as_objects([BOX, shapely.box(-2e9, 0, 1, 1)]),
         "shapes must be finite and within 1e+09 m"),
        ("areas", as_objects([BOX, HOLLOW]),
         "a hole of a shape must have corners; leave out the empty hole"),
        ("footprints", as_objects([BOX, NAN, BOX]), "shapes must be finite and within 1e+09 m"),
        ("areas", as_objects([NAN, BOX]), "shapes must be finite and within 1e+09 m"),
    ],
)  # fmt: skip
def test_columns_that_fit_no_evidence_are_refused(column: str, values: Any, message: str) -> None:
    with pytest.raises(ValueError) as caught:
        dataclasses.replace(table(), **{column: values})
    assert str(caught.value) == message


def test_evidence_of_some_objects_comes_with_their_views_alone() -> None:
    of_seven = table().of([7, 99])
    assert of_seven.object_ids.tolist() == [7, 7]
    assert of_seven.views.tolist() == [0, 1]
    of_three = table().of([3])
    assert (of_three.stamps.tolist(), of_three.views.tolist()) == ([4.0], [0])
    assert (len(table()), len(of_seven), len(of_three)) == (3, 2, 1)
    assert len(table().of([])) == len(EvidenceTable.empty()) == 0
    assert of_three.footprints[0].equals(table().footprints[1])
    again = dataclasses.replace(table(), views=np.array([1, 1, 1])).of([7])
    assert (again.stamps.tolist(), again.views.tolist()) == ([5.0], [0, 0])


def test_evidence_is_rounded_to_what_files_keep() -> None:
    rounded = table().rounded()
    assert rounded.scores.tolist() == [0.5, 0.25, 0.333333]
    assert rounded.heights.tolist() == [[0, 1], [0.5, 0.6667], [0, 2]]
    assert rounded.footprints[1].bounds == (1, 0, 1.3333, 1)
    assert rounded.poses[1, 0, 0] == 0.666666667
    assert (rounded.stamps.tolist(), rounded.object_ids.tolist()) == ([4, 5], [7, 3, 7])
    assert rounded.areas[1].is_empty
