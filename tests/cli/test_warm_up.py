"""Loops are compiled once for a machine, which is said, and can be done beforehand."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hypermap.simulation import SimulatedRecording, demo_world, write_tum
from hypermap.simulation.render import DEFAULT_CAMERA

pytestmark = pytest.mark.xdist_group("warm_up")  # they share what takes long to make

COMPILING = "compiling for this machine, once"

# What numba makes of sorting, sums and error messages takes longer to compile than the loops do.
HEAVY = ("numba.misc.", "numba.cpython.unicode", "numba.np.arraymath.")
# The loop that sums up the points of a window exists twice: on its own, and within its caller.
PLANES = """
import numpy as np
from hypermap.perception.region_growing.normals import fit_planes

def write_planes(path):
    rows, columns = np.indices((96, 128), np.float32)
    depth = 2 + np.random.default_rng(0).normal(0, 0.02, rows.shape).astype(np.float32)
    cloud = np.stack([(columns - 64) * depth / 150, (rows - 48) * depth / 150, depth])
    wanted = np.zeros(rows.shape, bool)
    wanted[32:-32, 32:-32] = True
    normals, _, _ = fit_planes(cloud, wanted, 50, (150.0, 150.0))
    normals[:, wanted].tofile(path)
"""

WATCHED = """
import gc, sys
from numba.core import event, types
from hypermap.cli.main import main

compiled = []

class Names(event.Listener):
    def on_start(self, event):
        compiled.append(event.data["dispatcher"])

    def on_end(self, event):
        pass

event.register("numba:compile", Names())
try:
    main(sys.argv[1:])
finally:
    if sys.argv[1:] == ["warm-up"]:
        write_planes("cold.bin")
    with open("names.txt", "a") as names:
        for each in compiled:
            names.write(f"{each.py_func.__module__}.{each.py_func.__name__}\\n")
    with open("wrong.txt", "a") as wrong:
        if not gc.isenabled():
            wrong.write("garbage is not collected any more\\n")
        for each in compiled:
            returned = [s.return_type for s in each.nopython_signatures]
            is_counted = each.targetoptions.get("_nrt", True)
            if not is_counted and any(isinstance(type_, types.Array) for type_ in returned):
                wrong.write(f"{each.py_func.__name__} returns an array without counting it\\n")
"""

# One process, as starting each takes longer than what it does.
IN_TURN = """
import json, sys
from hypermap.cli.main import main

for command in json.loads(sys.argv[1]):
    try:
        main(command)
    except SystemExit as ended:
        assert not ended.code, command
write_planes("warm.bin")
"""


def python(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run Python in a process of its own, which keeps its loops in a folder."""
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder / "loops")},
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )


@pytest.fixture(scope="module")
def begun(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """A machine on which a quiet command was the first, and what that has said."""
    folder = tmp_path_factory.mktemp("machine")
    command = ["-q", "simulate", "demo", "-o", "room", "--rate", "0.1"]
    done = python(folder, "-c", PLANES + WATCHED, *command)
    assert list((folder / "loops").rglob("*.nbi"))
    return folder, done


@pytest.fixture(scope="module")
def warm(
    begun: tuple[Path, subprocess.CompletedProcess[str]],
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """The machine after `warm-up` has compiled the rest, and what that has said."""
    return begun[0], python(begun[0], "-c", PLANES + WATCHED, "warm-up")


@pytest.mark.timeout(600)
def test_warming_up_says_what_it_compiles_and_where_that_lies(
    warm: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, done = warm
    assert done.stderr.count(COMPILING) == 1
    assert re.search(r"compiled \d+ functions in \d+ s\n", done.stdout)
    assert f"kept in {folder / 'loops'}," in done.stdout


@pytest.mark.timeout(600)
def test_loops_use_nothing_of_numpy_that_takes_long_to_compile_and_are_compiled_once(
    warm: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    names = (warm[0] / "names.txt").read_text().split()
    assert "hypermap.perception.planes._join_blocks" in names
    assert [name for name in names if name.startswith(HEAVY)] == []
    ours = [name for name in names if name.startswith("hypermap.")]
    assert sorted(ours) == sorted(set(ours))
    assert (warm[0] / "wrong.txt").read_text() == ""


@pytest.mark.timeout(600)
def test_what_compiled_loops_use_of_numba_is_a_small_part_of_them(
    warm: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    names = (warm[0] / "names.txt").read_text().split()
    foreign = [name for name in names if not name.startswith("hypermap.")]
    assert len(foreign) < len(names) / 3


@pytest.mark.timeout(600)
def test_nothing_is_compiled_after_warming_up(
    warm: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, _ = warm
    drive = SimulatedRecording(demo_world(), camera=DEFAULT_CAMERA.every(2), rate=0.3)
    write_tum(drive, folder / "recording")
    commands = (
        ["map", "recording", "-o", "room.hmap"],
        ["rooms", "room.hmap", "-o", "rooms.hmap"],
        ["path", "room.hmap", "1,2", "2.6,3.8"],
        ["path", "room.hmap", "1,2", "2.6,3.8", "--inflation-radius", "0.3"],
        ["frontiers", "room.hmap", "1,2", "--next-views"],
        ["warm-up"],
    )
    done = python(folder, "-c", PLANES + IN_TURN, json.dumps(commands))
    assert "objects" in done.stderr
    assert COMPILING not in done.stderr
    assert "everything is compiled already" in done.stdout
    assert (folder / "warm.bin").read_bytes() == (folder / "cold.bin").read_bytes()


@pytest.mark.timeout(600)
def test_what_the_first_command_compiles_is_not_said_when_it_is_to_be_quiet(
    begun: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    assert begun[1].stderr == ""
