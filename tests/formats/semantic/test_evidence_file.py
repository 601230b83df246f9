"""The evidence behind objects in files: exact, lazy, and no burden for those who know it not."""

from __future__ import annotations

import dataclasses
import json
import logging
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import FormatError, ObjectNotFound
from hypermap.core.evidence import EvidenceTable
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import limits, open_map, save_map
from hypermap.formats.semantic.evidence_file import dump_evidence, parse_evidence
from hypermap.testing import assert_same_evidence, assert_same_objects, square

from ..strategies import polygons

numbers = st.floats(-1e6, 1e6)
# A multipolygon of one comes back as the polygon that it is.
footprints = polygons() | st.lists(polygons(), min_size=2, max_size=3).map(shapely.MultiPolygon)
areas = footprints | st.just(shapely.Polygon())


@st.composite
def tables(draw: st.DrawFn) -> EvidenceTable:
    view_count = draw(st.integers(1, 4))
    count = draw(st.integers(0, 6))
    some = st.lists(numbers, min_size=count, max_size=count).map(np.array)
    rows = st.lists(st.integers(0, view_count - 1), min_size=count, max_size=count)
    ids = st.lists(st.integers(0, 2**31 - 1), min_size=count, max_size=count)
    poses = np.tile(np.eye(4), (view_count, 1, 1))
    poses[:, :3] = np.reshape([draw(numbers) for _ in range(12 * view_count)], (-1, 3, 4))
    return EvidenceTable(
        object_ids=np.array(draw(ids), dtype=np.int64),
        views=np.array(draw(rows), dtype=np.int64),
        scores=draw(some).reshape(-1),
        footprints=np.fromiter((draw(footprints) for _ in range(count)), dtype=object),
        heights=np.column_stack([draw(some), draw(some)]).reshape(-1, 2),
        stamps=np.array([draw(numbers) for _ in range(view_count)]),
        poses=poses,
        areas=np.fromiter((draw(areas) for _ in range(view_count)), dtype=object),
    )


def a_table() -> EvidenceTable:
    """Two views; both show object 3, the second one shows object 5, too."""
    holed = shapely.box(0, 0, 4, 4).difference(shapely.box(1, 1, 2, 2))
    two = shapely.MultiPolygon([shapely.box(8, 8, 9, 9), shapely.box(10, 8, 11, 9)])
    return EvidenceTable(
        object_ids=np.array([3, 5, 3]),
        views=np.array([0, 1, 1]),
        scores=np.array([0.5, 0.25, 0.75]),
        footprints=np.array([holed, two, shapely.box(0, 0, 4, 3)], dtype=object),
        heights=np.array([[0.0, 0.5], [0.1, 0.2], [0.0, 0.75]]),
        stamps=np.array([10.0, 12.5]),
        poses=np.tile(np.eye(4), (2, 1, 1)),
        areas=np.array([shapely.Polygon(), shapely.box(-1, -1, 12, 12)], dtype=object),
    )


def a_map(evidence: EvidenceTable | None = None) -> Hypermap:
    things = [
        dataclasses.replace(square("table", 2, 2, side=4), id=3),
        dataclasses.replace(square("cups", 9.5, 8.5, side=3), id=5),
    ]
    return Hypermap([SemanticLayer("semantic", "map", things, evidence=evidence)])


def semantic(path: Path) -> SemanticLayer:
    layer = open_map(path)["semantic"]
    assert isinstance(layer, SemanticLayer)
    return layer


@given(tables())
def test_any_evidence_is_the_same_again_but_for_a_rounding_that_is_small(
    table: EvidenceTable,
) -> None:
    content, rounded = dump_evidence(table), table.rounded()
    again = parse_evidence(content, "evidence")
    assert_same_evidence(again, rounded)
    assert dump_evidence(again) == content
    for one, other in ((table.footprints, rounded.footprints), (table.areas, rounded.areas)):
        moved = np.abs(shapely.get_coordinates(one) - shapely.get_coordinates(other))
        assert moved.max(initial=0) <= 0.5e-4 + 1e-6  # far out, numbers are not finer than that
    assert np.abs(table.scores - rounded.scores).max(initial=0) <= 1e-6
    np.testing.assert_array_equal(table.stamps, rounded.stamps)


def test_a_map_keeps_its_evidence_in_an_archive_and_in_a_folder(tmp_path: Path) -> None:
    for path in (tmp_path / "map.hmap", tmp_path / "map.yaml"):
        save_map(a_map(a_table()), path)
        layer = semantic(path)
        assert_same_evidence(layer.evidence(), a_table())
        assert "evidence" not in layer.settings
        files = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
        save_map(open_map(path), path)
        assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == files


def test_a_layer_of_columns_keeps_its_evidence_too(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="GeoParquet needs pyarrow: pip install pyarrow")
    path = tmp_path / "map.hmap"
    save_map(a_map(a_table()), path, semantic="parquet")
    with zipfile.ZipFile(path) as archive:
        assert "semantic.parquet" in archive.namelist()
    assert_same_evidence(semantic(path).evidence(), a_table())


def test_evidence_is_asked_for_by_object() -> None:
    layer = a_map(a_table())["semantic"]
    assert isinstance(layer, SemanticLayer)
    of_table = layer.evidence_of(3)
    assert of_table.scores.tolist() == [0.5, 0.75]
    assert of_table.stamps[of_table.views].tolist() == [10.0, 12.5]
    of_cups = layer.evidence_of(5)
    assert (len(of_cups), of_cups.stamps.tolist()) == (1, [12.5])
    with pytest.raises(ObjectNotFound, match="no object with id 4"):
        layer.evidence_of(4)
    without = a_map()["semantic"]
    assert isinstance(without, SemanticLayer)
    assert (without.evidence(), len(without.evidence_of(3))) == (None, 0)


def test_other_readers_find_all_as_before(tmp_path: Path) -> None:
    save_map(a_map(), tmp_path / "plain.hmap")
    save_map(a_map(a_table()), tmp_path / "seen.hmap")
    with (
        zipfile.ZipFile(tmp_path / "plain.hmap") as one,
        zipfile.ZipFile(tmp_path / "seen.hmap") as other,
    ):
        plain = {name: one.read(name) for name in one.namelist()}
        seen = {name: other.read(name) for name in other.namelist()}
    assert seen.pop("semantic.evidence.json")
    config = seen["hmap_config.yaml"].decode().splitlines()
    config.remove("  evidence: semantic.evidence.json")
    assert {**seen, "hmap_config.yaml": "\n".join([*config, ""]).encode()} == plain


def test_a_map_without_the_file_opens_and_is_saved(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "hmap_config.yaml"
    save_map(a_map(a_table()), path)
    (tmp_path / "semantic.evidence.json").unlink()
    assert semantic(path).evidence() is None
    assert "semantic.evidence.json: there is no such file" in caplog.text
    save_map(open_map(path), tmp_path / "again.hmap")
    caplog.clear()
    assert_same_objects(semantic(tmp_path / "again.hmap").objects(), semantic(path).objects())


def test_evidence_goes_with_its_object(tmp_path: Path) -> None:
    layer = a_map(a_table())["semantic"]
    assert isinstance(layer, SemanticLayer)
    changed = layer.copy()
    renamed = dataclasses.replace(layer.get(3), name="desk", footprint=shapely.box(0, 0, 1, 1))
    changed.update(3, renamed)
    changed.remove([5])
    path = tmp_path / "map.hmap"
    save_map(Hypermap([changed]), path)
    again = semantic(path)
    (number,) = again.add([dataclasses.replace(square("new", 0, 0), id=None)])
    assert number == 6  # that of a removed object is not used again
    again.add([dataclasses.replace(square("newer", 0, 0), id=5)])
    assert_same_evidence(again.evidence(), a_table().of([3]))
    assert len(again.evidence_of(5)) == 0
    # Who takes the removal back has the evidence, too.
    changed.add([layer.get(5)])
    assert_same_evidence(changed.evidence(), a_table())


def test_what_an_older_map_left_in_a_folder_is_not_taken_for_evidence(tmp_path: Path) -> None:
    path = tmp_path / "hmap_config.yaml"
    save_map(a_map(a_table()), path)
    save_map(a_map(), path)
    assert (tmp_path / "semantic.evidence.json").is_file()
    assert semantic(path).evidence() is None


def test_damaged_evidence_is_reported_when_asked_for_and_kept(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "hmap_config.yaml"
    save_map(a_map(a_table()), path)
    file = tmp_path / "semantic.evidence.json"
    file.write_bytes(b'{"format": "hypermap evi')
    layer = semantic(path)
    assert len(layer) == 2
    for ask in (layer.evidence, lambda: layer.evidence_of(3)):
        with pytest.raises(FormatError, match=r"semantic\.evidence\.json: is not JSON"):
            ask()
    assert caplog.text == ""
    save_map(open_map(path), tmp_path / "again.hmap")
    assert "the evidence behind the objects is unchanged" in caplog.text
    with zipfile.ZipFile(tmp_path / "again.hmap") as archive:
        assert archive.read("semantic.evidence.json") == file.read_bytes()


def test_too_much_evidence_is_left_out_and_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(limits, "MAX_EVIDENCE_BYTES", 100)
    with caplog.at_level(logging.WARNING):
        save_map(a_map(a_table()), tmp_path / "map.hmap")
    assert "layer 'semantic': its evidence is left out" in caplog.text
    assert semantic(tmp_path / "map.hmap").evidence() is None


def changed(**values: Any) -> dict[str, Any]:
    return {**json.loads(dump_evidence(a_table())), **values}


def with_views(**values: Any) -> dict[str, Any]:
    return changed(views={**changed()["views"], **values})


def with_observations(**values: Any) -> dict[str, Any]:
    return changed(observations={**changed()["observations"], **values})


def with_footprints(**values: Any) -> dict[str, Any]:
    before = changed()["observations"]["footprint"]
    return with_observations(footprint={**before, **values})


BAD = [
    ([], "format: does not say that its format is 'hypermap evidence'"),
    (changed(format="GeoJSON"), "format: does not say that its format is 'hypermap evidence'"),
    (changed(version=2), "version: is of version 2; this program reads 1"),
    ({k: v for k, v in changed().items() if k != "views"}, "views is missing"),
    (with_views(stamp=[1.0]), "cannot reshape"),
    (with_views(stamp=[1.0, float("nan")]), "stamps must be finite"),
    (with_views(map_T_camera=[[0.0] * 12]), "cannot reshape"),
    (with_views(map_T_camera=[[1e308] * 12] * 2), "poses must be within 1e+09"),
    (with_observations(score=[1e308, 1, 2]), "scores must be within 1e+09"),
    (with_observations(object=[3, 5]), "views must have shape"),
    (with_observations(object=[3, 5, 1.5]), "lists of whole numbers"),
    (with_observations(view=[0, 1, 2]), "views must be rows of the 2 views"),
    (with_observations(view=[0, 1, -1]), "views must be rows of the 2 views"),
    (with_observations(score=["a", 1, 2]), "could not convert"),
    (with_footprints(steps=[0] * 3), "cannot reshape"),
    (with_footprints(steps=[0] * 4), "points were expected, found 2"),
    (with_footprints(points=[2] * 5), "a ring at least three points"),
    (with_footprints(rings=[1]), "do not match"),
    (with_footprints(polygons=[-1, 3, 2]), "must be 0 or more"),
    (with_footprints(polygons=[10**30, 1, 1]), "lists of whole numbers"),
    (with_footprints(steps=[10**18] * 40), "a point is farther away"),
    (with_footprints(polygons=[0, 2, 2]), "a footprint must not be empty"),
]


@pytest.mark.parametrize(("document", "problem"), BAD)
def test_a_file_that_holds_no_evidence_gives_one_clear_error(document: Any, problem: str) -> None:
    with pytest.raises(FormatError) as caught:
        parse_evidence(json.dumps(document).encode(), "map.hmap/evidence.json")
    assert str(caught.value).startswith("map.hmap/evidence.json: ")
    assert problem in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"[" * 100_000, b"{}"])
def test_no_bytes_make_a_traceback(content: bytes) -> None:
    with pytest.raises(FormatError, match=r"^evidence: "):
        parse_evidence(content, "evidence")
