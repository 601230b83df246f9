"""Evidence on the command line: kept by `map`, shown by `info` and `query --evidence`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import shapely

from hypermap.console.evidence import plain_evidence
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.testing import occupancy_from_text, square

from .conftest import INTRINSICS, Result, assert_one_error

Run = Callable[..., Result]


@pytest.fixture
def made(hypermap: Run, drive: Path, tmp_path: Path) -> Path:
    out = tmp_path / "out.hmap"
    assert hypermap("map", drive, "--intrinsics", INTRINSICS, "-o", out).code == 0
    return out


def test_a_map_tells_what_its_objects_were_made_of(hypermap: Run, made: Path) -> None:
    (row,) = hypermap("query", made, "--name", "chair", "--evidence", "--json").json["answers"]
    evidence = row["evidence"]
    layer = open_map(made)["semantic"]
    assert isinstance(layer, SemanticLayer)
    (item,) = layer.objects()
    looks = evidence["observations"]
    assert len(looks) == evidence["seen"] == item.attributes["evidence"] == 6
    assert looks[0]["stamp"] == evidence["first_seen"] == item.first_seen
    assert looks[-1]["stamp"] == evidence["last_seen"] == item.last_seen
    for look in looks:
        (rings,) = look["polygons"]
        assert shapely.Polygon(rings[0]).distance(shapely.Point(1.5, 0)) < 0.1
        assert look["distance"] == pytest.approx(1.3, abs=0.15)
    own, *others = evidence["fused"]
    assert own["method"] == "votes"
    # Half of the looks lie 6 cm next to the others; which of them are moved there is a toss.
    assert own["jaccard"] > 0.7
    assert {one["method"] for one in others} == {"best_shape", "convex_hull"}
    assert hypermap("info", made, "--json").json["layers"][1]["observations"] == 6
    assert "1 object of 1 class, with 6 observations" in " ".join(
        hypermap("info", made).out.split()
    )


def test_the_answer_reads_well_as_text(hypermap: Run, made: Path) -> None:
    result = hypermap("query", made, "--name", "chair", "--evidence")
    assert result.code == 0
    assert "chair 0 of semantic" in result.out
    assert "seen 6 times, 6 kept, mean score" in result.out
    assert "votes (made the map)" in result.out


@pytest.mark.parametrize(
    ("last", "expected"),
    [(12.5, "from 2.0 s to 12.5 s of the recording"), (86_400.0, "from 2026-11-18 ")],
    ids=["one drive", "several"],
)
def test_observations_of_several_drives_have_dates(last: float, expected: str) -> None:
    begin = 1_795_011_200.0
    kept = [{"stamp": begin + 2, "score": 0.8}, {"stamp": begin + last, "score": 0.8}]
    seen = {"first_seen": begin + 2, "last_seen": begin + last, "start": begin}
    evidence = seen | {"seen": 2, "observations": kept, "fused": []}
    row = {"label": "cup", "value": 1, "layer": "semantic", "evidence": evidence}
    assert expected in plain_evidence([row])


def test_evidence_can_be_left_out(hypermap: Run, drive: Path, made: Path, tmp_path: Path) -> None:
    out = tmp_path / "plain.hmap"
    arguments = ("--intrinsics", INTRINSICS, "--drop-evidence", "-o", out)
    assert hypermap("map", drive, *arguments).code == 0
    assert out.stat().st_size < made.stat().st_size
    assert hypermap("info", out, "--json").json["layers"][1]["observations"] == 0
    result = hypermap("query", out, "--name", "chair", "--evidence")
    assert result.code == 0
    assert "This map contains no evidence." in result.out


def test_only_objects_can_be_looked_behind(hypermap: Run, tmp_path: Path) -> None:
    things = SemanticLayer("semantic", "map", [square("cup", 0, 0)])
    path = tmp_path / "map.hmap"
    save_map(Hypermap([occupancy_from_text("#."), things]), path)
    assert_one_error(
        hypermap("query", path, "--at", "0,0", "--evidence"), "--evidence shows the observations"
    )
    nothing = hypermap("query", path, "--name", "elephant", "--evidence")
    assert (nothing.code, nothing.out) == (0, "")
