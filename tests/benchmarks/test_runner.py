"""`benchmarks/bench.py` and `hypermap bench`, run as a user runs them."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from PIL import Image

import hypermap as package

CHECKOUT = Path(__file__).resolve().parents[2]
SCRIPT = CHECKOUT / "benchmarks" / "bench.py"

_LARGE = shutil.ignore_patterns("__pycache__", "page", "*.onnx")
# A group that is as real as any, but small: sums by numpy and by Python.
GROUP = """
import sys, time, types
sys.path.insert(0, {folder!r})
import numpy as np
import bench
from suite.programs import build
from suite.race import Disagreement, Figure, Growth, each_of, race

def agree(ours, theirs):
    if ours != theirs:
        raise Disagreement(f"{{ours}} is not {{theirs}}")
    return "the same sum"

def sums(settings):
    numbers = np.arange(10000)
    yield race("10,000 numbers", "Python", lambda: int(numbers.sum()), lambda: sum(range(10000)),
               agree, settings, asked=1e-9)
    values = tuple(np.array([1.0, 2.0, 4.0]))
    yield Figure("numbers", values, "numbers", asked=1.0, less_is_better=True, note="n")

def growths(settings):
    sizes = (10, 100, 1000)
    yield Growth("slow", "objects", sizes, (0.001, 0.002, 0.2), (1e3, 1e4, 1e5), note="n")
    yield Growth("two loops", "cells", sizes, (1e-4, 1e-2, 1.0))
    yield Growth("one", "objects", sizes, (1e-4, 1e-4, 1e-4), limit=0.5)

def wrong(settings):
    yield race("one too few", "Python", lambda: sum(range(9)), lambda: sum(range(10)),
               agree, settings)

def broken(settings):
    yield from sums(settings)
    raise ValueError("a bug")

def missing(settings):
    build("boost/layer_queries.cpp", (), settings)
    yield from sums(settings)

def slow(settings):
    yield from sums(settings)
    print("now slow", flush=True)
    time.sleep(60)

def rows(settings):
    yield from each_of(settings, {{name: globals()[name] for name in {parts!r}}})

group = types.ModuleType("suite.sums")
group.rows = rows
sys.modules["suite.sums"] = group
bench.GROUPS = ("sums",)
sys.exit(bench.main(sys.argv[1:]))
"""


def command(parts: list[str], *options: object) -> list[str]:
    code = GROUP.format(folder=str(SCRIPT.parent), parts=parts)
    return [sys.executable, "-c", code, *map(str, options)]


def run(parts: list[str], *options: object, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(parts, *options),
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | environment,
    )


def test_every_module_with_rows_is_a_group_that_the_documents_describe() -> None:
    modules = (SCRIPT.parent / "suite").glob("*.py")
    groups = {module.stem for module in modules if "\ndef rows(" in module.read_text()}
    code = "import bench; print(*bench.GROUPS)"
    listed = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=SCRIPT.parent
    )
    assert set(listed.stdout.split()) == groups
    page = (CHECKOUT / "docs" / "benchmarks.md").read_text()
    assert all(f"| `{group}` |" in page for group in groups)


def test_each_row_is_printed_and_saved(tmp_path: Path) -> None:
    files = tmp_path / "races.json", tmp_path / "races.md"
    done = run(["sums"], "--repeat", 3, "--times", files[0], "--markdown", files[1])
    assert done.returncode == 0, done.stderr
    assert "processor" in done.stdout
    assert "10,000 numbers" in done.stdout
    assert "asked at most 1: NO" in done.stdout
    data = json.loads(files[0].read_text())
    assert {"processor", "memory", "Python", "date", "load before"} <= set(data["machine"])
    race, figure = data["groups"]["sums"]
    assert len(race["ours"]) == len(race["theirs"]) == 3
    assert race["ratio"] == pytest.approx(sorted(race["theirs"])[1] / sorted(race["ours"])[1])
    assert race["agreement"] == "the same sum"
    assert (race["reached"], figure["reached"]) == (True, False)
    page = files[1].read_text()
    assert "| 10,000 numbers |" in page
    assert "| numbers | 2 numbers |  |  | 1.5 to 3 | at most 1 | NO | n |" in page


def test_a_bug_costs_its_part_alone_and_is_no_success(tmp_path: Path) -> None:
    file = tmp_path / "races.json"
    done = run(["broken", "growths"], "--repeat", 1, "--times", file)
    assert done.returncode == 1
    assert "Traceback" in done.stderr
    rows = json.loads(file.read_text())["groups"]["sums"]
    kinds = ["race", "figure", "failure", "growth", "growth", "growth"]
    assert [row["kind"] for row in rows] == kinds
    assert (rows[2]["work"], rows[2]["reason"]) == ("broken", "ValueError: a bug")


def test_a_growth_is_printed_saved_and_drawn(tmp_path: Path) -> None:
    files, plots = (tmp_path / "races.json", tmp_path / "races.md"), tmp_path / "plots"
    options = "--repeat", 1, "--times", files[0], "--markdown", files[1], "--plots", plots
    done = run(["growths"], *options)
    assert done.returncode == 0, done.stderr
    assert "objects 10: 1 ms, 1 kB; 100: 2 ms, 10 kB; 1,000: 200 ms, 100 kB" in done.stdout
    assert "time n^1.15, memory n^1.00" in done.stdout
    slow, square, one = json.loads(files[0].read_text())["groups"]["sums"]
    assert (slow["kind"], slow["of"]) == ("growth", "objects")
    assert slow["sizes"] == [10, 100, 1000]
    assert slow["seconds"] == [0.001, 0.002, 0.2]
    assert slow["bytes"] == [1e3, 1e4, 1e5]
    assert slow["exponents"] == {"time": 1.151, "memory": 1.0}
    assert [row["reached"] for row in (slow, square, one)] == [True, False, True]
    assert (square["exponents"], one["asked"]) == ({"time": 2.0}, 0.5)
    assert "| two loops | time n^2.00 |  |  |  | at most n^1.29 | NO |" in files[1].read_text()
    pictures = sorted(plots.iterdir())
    assert [file.name for file in pictures] == ["growth-cells.png", "growth-objects.png"]
    for file, least in zip(pictures, (500, 1000), strict=True):
        with Image.open(file) as picture:
            assert picture.format == "PNG"
            assert picture.width > 800
            assert picture.height > least  # of objects, there is a panel of memory, too


def test_without_growths_nothing_is_drawn(tmp_path: Path) -> None:
    done = run(["sums"], "--repeat", 1, "--plots", tmp_path / "plots")
    assert done.returncode == 0
    assert "no growth was measured, so nothing is drawn" in done.stderr


def test_a_wrong_answer_fails_the_benchmark_and_the_others_go_on(tmp_path: Path) -> None:
    file = tmp_path / "races.json"
    done = run(["wrong", "sums"], "--repeat", 1, "--times", file)
    assert done.returncode == 1, done.stderr
    assert "wrong: WRONG: 36 is not 45" in done.stdout
    first, *others = json.loads(file.read_text())["groups"]["sums"]
    assert (first["kind"], first["is_wrong"]) == ("failure", True)
    assert [row["kind"] for row in others] == ["race", "figure"]


def test_a_peer_that_is_not_installed_is_left_out_with_the_remedy(tmp_path: Path) -> None:
    empty = tmp_path / "bin"
    empty.mkdir()
    done = run(["missing", "sums"], "--repeat", 1, "--build", tmp_path / "build", PATH=str(empty))
    assert done.returncode == 0, done.stderr
    assert "missing: left out: g++ is missing; on Debian: scripts/peers.sh" in done.stdout
    assert "10,000 numbers" in done.stdout


def test_ctrl_c_keeps_what_was_measured(tmp_path: Path) -> None:
    file = tmp_path / "races.json"
    options = command(["slow"], "--repeat", 1, "--times", file)
    with subprocess.Popen(options, stdout=subprocess.PIPE, text=True) as measuring:
        assert measuring.stdout is not None
        while "now slow" not in measuring.stdout.readline():
            assert measuring.poll() is None
        time.sleep(0.2)
        measuring.send_signal(signal.SIGINT)
        assert measuring.wait(240) == 130
    assert len(json.loads(file.read_text())["groups"]["sums"]) == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["grid"], "there is no group 'grid'; known: perception, mapping"),
        (["--repeat", "0"], "--repeat must be at least 1, got 0"),
        (["--times", "nowhere/races.json"], "nowhere/races.json: no file can be written there"),
        (["--plots", "nowhere/plots"], "nowhere/plots: no folder can be made there"),
    ],
)
def test_bad_options_are_one_line_before_anything_is_measured(options, message: str) -> None:
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *options], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("hypermap bench: error: " + message)
    assert not done.stdout


def test_the_command_runs_the_suite_of_the_checkout(tmp_path: Path) -> None:
    file = tmp_path / "races.json"
    started = [sys.executable, "-m", "hypermap", "bench", "startup", "--quick", "--repeat", "1"]
    done = subprocess.run(
        [*started, "--json", str(file), "--plots", str(tmp_path / "plots")],
        capture_output=True,
        text=True,
        check=False,
        cwd=CHECKOUT,
    )
    assert done.returncode == 0, done.stderr
    assert "--json: a deprecated name; use --times" in done.stderr
    assert "so nothing is drawn" in done.stderr  # of a start, there is no growth
    rows = json.loads(file.read_text())["groups"]["startup"]
    assert any(row["kind"] == "race" and row["ratio"] > 0 for row in rows)
    assert not any(row["kind"] == "failure" for row in rows)


def test_without_a_checkout_the_error_says_what_to_do(tmp_path: Path) -> None:
    site = tmp_path / "site"  # as `pip install` leaves it: the package alone
    shutil.copytree(Path(package.__file__).parent, site / "hypermap", ignore=_LARGE)
    done = subprocess.run(
        [sys.executable, "-m", "hypermap", "bench"],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(site)},
    )
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert "clone the repository and run `make bench` in it" in line
