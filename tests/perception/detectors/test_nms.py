from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from shapely import box

from hypermap.perception.detectors.nms import suppress

corner, side = st.integers(0, 20), st.integers(1, 20)
candidates = st.lists(
    st.tuples(corner, corner, side, side, st.integers(0, 100), st.integers(0, 1)), max_size=12
)


def iou(a: np.ndarray, b: np.ndarray) -> float:
    return box(*a).intersection(box(*b)).area / box(*a).union(box(*b)).area


@given(candidates, st.sampled_from([0.0, 0.3, 0.45, 0.7, 1.0]))
def test_a_box_goes_exactly_if_a_better_one_of_its_class_that_stays_overlaps_it(
    drawn: list[tuple[int, int, int, int, int, int]], threshold: float
) -> None:
    table = np.array(drawn, float).reshape(-1, 6)
    xyxy = np.hstack([table[:, :2], table[:, :2] + table[:, 2:4]])
    scores, class_ids = table[:, 4] / 100, table[:, 5].astype(int)
    kept = suppress(xyxy, scores, class_ids, threshold)

    assert (np.diff(scores[kept]) <= 0).all()
    order = np.argsort(-scores, kind="stable")
    expected: list[int] = []
    for i in order:
        rivals = [j for j in expected if class_ids[i] == class_ids[j]]
        if all(iou(xyxy[i], xyxy[j]) <= threshold for j in rivals):
            expected.append(i)
    assert kept.tolist() == expected


def test_boxes_without_area_are_no_reason_to_fail() -> None:
    boxes = np.zeros((2, 4))
    assert suppress(boxes, np.array([0.5, 0.6]), np.array([0, 0]), 0.5).tolist() == [1, 0]
