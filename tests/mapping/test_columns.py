"""Columns of a table that grows and shrinks."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hypermap.mapping.columns import Column

steps = st.lists(st.sampled_from(["append", "extend", "keep", "remove first"]), max_size=30)


@given(steps=steps)
def test_a_column_holds_what_a_list_would_hold(steps: list[str]) -> None:
    column, expected = Column(np.empty((0, 2))), []
    for number, step in enumerate(steps):
        if step == "append":
            column.append((number, -number))
            expected.append([number, -number])
        elif step == "extend":
            column.room_for(number)[: number // 2] = (number, -number)
            column.extend(number // 2)
            expected.extend([number, -number] for _ in range(number // 2))
        elif step == "keep":
            wanted = np.arange(len(expected)) % 3 != number % 3
            column.keep(np.flatnonzero(wanted))
            expected = [row for row, is_wanted in zip(expected, wanted, strict=True) if is_wanted]
        else:
            count = len(expected) // 2
            column.remove_first(count)
            del expected[:count]
        assert column.values.tolist() == expected
        assert len(column) == len(expected)


def test_values_may_be_written_to() -> None:
    column = Column(np.empty(0))
    for number in range(20):
        column.append(number)
    column.values[3] = 99
    column.append(20)
    assert column.values.tolist() == [0, 1, 2, 99, *range(4, 21)]
