from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hypermap.perception.detections import Detections

BOXES = [[0, 0, 2, 2], [1, 1, 3, 4]]


def test_detections_from_plain_sequences_have_their_types() -> None:
    detections = Detections.of(BOXES, ["cup", "chair"], [0.5, 0.25])
    assert detections.xyxy.dtype == detections.scores.dtype == np.float32
    assert detections.names.tolist() == ["cup", "chair"]
    assert len(detections) == 2


def test_scores_that_are_not_given_are_1() -> None:
    assert Detections.of(BOXES, ["cup", "chair"]).scores.tolist() == [1, 1]


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("caf\u00e9 table", "caf\u00e9 table"),
        ("c\0p", "c\ufffdp"),
        ("cup \ud83d", "cup \ufffd"),
        ("x" * 10**6, "x" * 200),
    ],
)
def test_a_name_that_files_and_stores_cannot_hold_is_mended(given: str, kept: str) -> None:
    assert Detections.of([[0, 0, 2, 2]], [given]).names.tolist() == [kept]


def test_no_detections_are_detections_too() -> None:
    nothing = Detections.of([], [])
    assert (len(nothing), nothing.xyxy.shape, nothing.scores.shape) == (0, (0, 4), (0,))


@pytest.mark.parametrize("index", [np.array([False, True]), slice(1, None), np.array([1]), [1]])
def test_a_mask_a_slice_or_indices_select_all_columns(index: Any) -> None:
    masks = np.stack([np.zeros((4, 4), bool), np.ones((4, 4), bool)])
    chosen = Detections.of(BOXES, ["cup", "chair"], [0.5, 0.25], masks)[index]
    assert chosen.xyxy.tolist() == [[1, 1, 3, 4]]
    assert (chosen.names.tolist(), chosen.scores.tolist()) == (["chair"], [0.25])
    assert chosen.masks is not None
    assert chosen.masks.shape == (1, 4, 4)
    assert chosen.masks.all()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (
            (BOXES, ["cup"]),
            r"expected boxes \(1, 4\) and scores \(1,\) for 1 names, got \(2, 4\) and \(1,\)",
        ),
        (
            (BOXES, ["cup", "chair"], [0.5]),
            r"expected boxes \(2, 4\) and scores \(2,\) for 2 names, got \(2, 4\) and \(1,\)",
        ),
        (
            (BOXES, ["cup", "chair"], None, np.ones((1, 4, 4), bool)),
            r"expected masks \(2, H, W\), got \(1, 4, 4\)",
        ),
        (
            (BOXES, ["cup", "chair"], None, np.full((2, 4, 4), 2, np.uint8)),
            r"expected masks of bool, got uint8",
        ),
    ],
)
def test_columns_that_do_not_fit_are_refused(arguments: Any, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        Detections.of(*arguments)
