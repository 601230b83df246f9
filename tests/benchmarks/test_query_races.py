"""The races of questions, at small sizes: answers really are compared, and a wrong one is seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest


@pytest.fixture(scope="module")
def world():
    from suite.objects import floor

    return floor(300, 500, moves=20)


@pytest.fixture
def settings():
    from suite.race import Settings

    build = Path(__file__).resolve().parents[2] / "build" / "benchmarks"
    return Settings(data=None, repeat=1, quick=True, build=build)


@pytest.mark.parametrize("name", ["GeoPandasLayer", "RtreeLayer"])
def test_the_python_libraries_answer_the_same(world, settings, name: str) -> None:
    from suite import queries, query_peers

    library = {"GeoPandasLayer": "geopandas", "RtreeLayer": "rtree"}[name]
    pytest.importorskip(library, reason=f"{library} is for the benchmark (make bench installs it)")
    rows = list(queries._against(getattr(query_peers, name), world, settings))
    assert len(rows) == (12 if name == "RtreeLayer" else 13)
    assert all("the same" in row.agreement for row in rows)


def test_the_program_in_cpp_answers_the_same(world, settings) -> None:
    from suite import queries, query_peers
    from suite.race import Unavailable

    try:
        rows = list(queries._against(query_peers.BoostLayer, world, settings))
    except Unavailable as missing:
        pytest.skip(str(missing))
    assert len(rows) == 13
    assert all("the same" in row.agreement for row in rows)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        ([1, 2, -1], [1, -1]),
        ([1, 2, -1], [1, 3, -1]),
        ([1, -1, 2, -1], [1, 2, -1, -1]),  # in the wrong answer of two
        ([5], [-1]),
    ],
)
def test_other_ids_are_a_disagreement(ours: list[int], theirs: list[int]) -> None:
    from suite.queries import same_ids
    from suite.race import Disagreement

    with pytest.raises(Disagreement, match="are not the same"):
        same_ids(np.array(ours), np.array(theirs))
    assert same_ids(np.array([2, 1, -1, 4, -1]), np.array([1, 2, -1, 4, -1])) == "the same 3 ids"


def test_growth_is_reported_for_each_size_and_work(settings) -> None:
    from suite import queries

    rows = list(queries._growth(settings))
    assert [row.work for row in rows][:2] == ["one point", "a change of one object"]
    for row in rows:
        assert row.sizes == (100, 1000, 10_000)
        assert row.exponents.keys() == {"time"}
