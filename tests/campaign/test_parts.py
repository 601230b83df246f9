"""The short form of the campaign, with fixed seeds: nothing falls, and what is wrong would."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from unittest.mock import ANY

import numpy as np
import pytest

from hypermap import HypermapError, OccupancyLayer

CHECKOUT = Path(__file__).resolve().parents[2]


def campaign(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "campaign", "--folder", str(folder), *words]
    return subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=False)


def budget(folder: Path, seed: int = 1):
    from campaign.part import Budget

    return Budget(seconds=1.0, seed=seed, short=True, folder=folder)


@pytest.mark.slow
@pytest.mark.parametrize("part", ["kill", "differential"])
def test_nothing_falls(part: str, tmp_path: Path) -> None:
    done = campaign(tmp_path, part, "--short", "--seed", "1")
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"| {part} |" in done.stdout


@pytest.mark.slow
def test_a_little_fuzzing_finds_nothing(tmp_path: Path) -> None:
    """Targets are fuzzed one after the other, with what all have imported."""
    from campaign.fuzz import SHORT_RUNS

    # The others, which take their time to begin, are left to `make campaign`.
    targets = [
        *("config", "map_server", "semantic_yaml", "geojson", "wkt", "tum", "detections"),
        *("http", "images", "job_files"),
    ]
    command = [sys.executable, "-m", "campaign.fuzz_worker", ",".join(targets)]
    done = subprocess.run(
        [*command, "600", "1", str(tmp_path), str(SHORT_RUNS)],
        cwd=CHECKOUT,
        check=True,
        capture_output=True,
        text=True,
    )
    said = [json.loads(line) for line in done.stdout.splitlines()]
    assert [(one["target"], one["way"], one["findings"]) for one in said] == [
        (target, "random", []) for target in targets
    ]
    assert min(one["runs"] for one in said) > SHORT_RUNS
    assert {path.name for path in tmp_path.iterdir()} == {*targets, "log"}


@pytest.mark.slow
def test_a_target_may_be_fuzzed_in_a_process_of_its_own(tmp_path: Path) -> None:
    from campaign.fuzz import SHORT_RUNS, fuzz

    result = fuzz(budget(tmp_path), ["png"])
    assert result.findings == []
    assert result.runs > SHORT_RUNS


def test_targets_whose_library_is_missing_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    from campaign import fuzz_targets

    assert fuzz_targets.targets_here()[:2] == ["archive", "config"]
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    assert set(fuzz_targets.TARGETS) - set(fuzz_targets.targets_here()) == {"spool", "store_api"}


def test_an_unknown_part_is_refused(tmp_path: Path) -> None:
    done = campaign(tmp_path, "kil")
    assert done.returncode == 2
    assert "there is no part 'kil'; known: kill, " in done.stderr


def test_the_table_has_a_row_for_each_part() -> None:
    from campaign.part import Finding, Result
    from campaign.report import Row, findings, table

    found = Result("fuzz", 2, [Finding("png: slow", 7, Path("x.input"))], {"slowest": "3 s"})
    late = Result("kill", 1305, left_out=["4 ways killed"])
    rows = [Row(late, 1.2, 100.4), Row(found, 60.0, 99.6)]
    assert table(rows).splitlines()[2:] == [
        "| kill | 1,305 | 0 | 1 | 1 |  | 100 |",
        "| fuzz | 2 | 1 | 0 | 60 | 3 s | 100 |",
    ]
    assert findings(found) == "  FOUND png: slow (seed 7, x.input)"
    assert findings(late) == "  LEFT OUT for lack of time: 4 ways killed"


# That a busy machine ends it no more


def test_a_target_without_time_is_left_out(tmp_path: Path) -> None:
    from campaign.fuzz import fuzz
    from campaign.part import Budget

    done = fuzz(Budget(seconds=0.0, seed=1, short=False, folder=tmp_path), ["png", "wkt"])
    assert (done.runs, done.findings, done.left_out) == (0, [], ["png", "wkt"])


def test_a_target_that_does_not_get_ready_in_its_time_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from campaign.part import Budget

    from campaign import fuzz

    monkeypatch.setattr(fuzz, "LEAST", 0.0)
    done = fuzz.fuzz(Budget(seconds=0.05, seed=1, short=False, folder=tmp_path), ["png"])
    assert (done.runs, done.findings, done.left_out) == (0, [], ["png"])


def test_a_part_that_does_not_end_is_ended(tmp_path: Path) -> None:
    from campaign.own_process import row_of
    from campaign.part import Budget

    row = row_of("kill", Budget(seconds=0.0, seed=1, short=False, folder=tmp_path), grace=0.1)
    assert [finding.what[:8] for finding in row.result.findings] == ["it hangs"]
    assert row.seconds < 60


def test_what_is_left_of_the_time_is_shared(tmp_path: Path) -> None:
    from campaign.part import Budget

    whole = Budget(seconds=60.0, seed=1, short=False, folder=tmp_path)
    part = whole.share(2)
    assert 29 < part.left <= part.seconds <= 30
    assert not whole.is_over
    assert Budget(seconds=0.0, seed=1, short=False, folder=tmp_path).share(1).is_over
    assert not budget(tmp_path).share(1e12).is_over  # the short form has no end


# That each part would see what is wrong


def test_the_oracle_sees_a_wrong_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    from campaign.differential import World, Wrong

    right = OccupancyLayer.value_at

    def wrong(layer: OccupancyLayer, points_xy):
        return np.where(right(layer, points_xy) == 57, 58, right(layer, points_xy))

    monkeypatch.setattr(OccupancyLayer, "value_at", wrong)
    worlds = [World(seed) for seed in range(1, 8)]
    grids = [world for world in worlds if isinstance(world.hypermap.layers[0], OccupancyLayer)]

    def ask_all() -> None:
        for world in grids:  # not each has such a cell where it is asked
            world.ask_and_change()

    with pytest.raises(Wrong, match="58, not one of"):
        ask_all()


def test_other_golden_answers_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from campaign import golden

    assert golden.differences() == []
    right = golden.answers
    monkeypatch.setattr(
        golden, "answers", lambda hypermap: {**dict(right(hypermap)), "base frame": "lab"}.items()
    )
    assert len(golden.differences()) == len(golden.MAPS)


def test_the_live_nodes_way_to_save_saves_what_it_reads(tmp_path: Path) -> None:
    """A way that raises by itself would be tried no further."""
    from campaign.ways_to_save import ways

    (live,) = (way for way in ways() if way.name == "the live node's end")
    read = []
    for version in (0, 1):
        live.save(tmp_path, version)
        read.append(live.read(tmp_path))
    assert read[0] != read[1]


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_save_that_writes_in_place_is_found_out(tmp_path: Path) -> None:
    from campaign.kill import Trial, kill_at_operations
    from campaign.way import Way

    def save(folder: Path, version: int) -> None:
        with (folder / "a").open("w") as file:
            file.write(f"{version}" * 100)
        (folder / "b").write_text(f"{version}" * 100)

    def read(folder: Path) -> str:
        parts = {(folder / name).read_text() for name in "ab"}
        if len(parts) != 1 or len(parts.pop()) != 100:
            raise HypermapError("not whole")
        return (folder / "a").read_text()

    trial = Trial(Way("in place", save, read), tmp_path)
    trial.prepare()
    assert trial.operations == 2
    assert any("cannot be read" in problem for problem in kill_at_operations(trial))


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_spool_that_loses_what_it_took_is_found_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("psycopg", reason="psycopg is missing")
    from campaign.sqlite_faults import is_reachable
    from campaign.store import spool_problem

    if not is_reachable():
        pytest.skip("Python's SQLite is built in")
    from hypermap.fleet.store.spool import Spool

    _, count = spool_problem(tmp_path / "spool", None)
    assert count > 30
    for at, fault in ((count // 2, "once"), (count // 3, "for good"), (count - 9, "kill")):
        assert spool_problem(tmp_path / "spool", at, fault) == ("", 0 if fault == "kill" else ANY)
    right = Spool.put

    def wrong(spool: Spool, observed: object) -> None:
        with contextlib.suppress(HypermapError):
            right(spool, observed)

    monkeypatch.setattr(Spool, "put", wrong)
    problems = [spool_problem(tmp_path / "spool", at, "once")[0] for at in range(20, 40, 8)]
    assert "1 of 4 observations are lost" in problems


@pytest.mark.parametrize(
    ("kind", "what"),
    [("KeyError", "KeyError in "), ("slow", "slow: "), ("HypermapError", None)],
)
def test_fuzzing_tells_what_is_ours_from_what_is_not(
    kind: str, what: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from campaign import fuzz_worker

    monkeypatch.setattr(fuzz_worker, "MOST_SECONDS", 0.0 if kind == "slow" else 1e9)
    monkeypatch.setattr(fuzz_worker, "MOST_BYTES", 1e18)

    def ask(data: bytes) -> None:
        if data == b"right":
            return
        if kind == "KeyError":
            raise KeyError(kind)
        if kind == "HypermapError":
            raise HypermapError(kind)

    tries = fuzz_worker.Tries(ask, tmp_path)
    tries.warm_up([b"right"])
    tries(b"wrong")
    tries.close()
    found = " ".join(tries.findings.values())
    assert (what or "") in found
    assert bool(found) == (what is not None)
    kept = [path.read_bytes() for path in tmp_path.glob("*.input")]
    assert kept == ([b"wrong"] if what else [])


@pytest.mark.parametrize("leaks", [True, False])
def test_arrays_that_comparisons_give_are_freed(leaks: bool) -> None:
    import ctypes

    from campaign.fuzz_worker import without_leak

    def compare(left, right, *_: object):
        found = left == right
        if leaks:
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(found))
        return found

    mended = without_leak(compare)
    found = mended(np.zeros(3), 0.0, 2, 0, True)
    assert sys.getrefcount(found) == 2  # the name and the argument
    assert mended(1, 1, 2, 0, False) is True
    assert (mended is compare) != leaks
