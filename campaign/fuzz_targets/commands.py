"""Commands: what a user does with a map of a stranger, beside a map of their own."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from pathlib import Path

from campaign.bad_sensors import write_good_recording
from campaign.full_map import MONDAY, full_map
from campaign.fuzz_targets.target import Target, a_map, a_small_map, draw_of, target_of_files
from campaign.mutation import mutate_archive
from hypermap import HypermapError, save_map
from hypermap.cli.main import main
from hypermap.fleet.batch.jobs import jobs_in

_BAD_INPUT = 2
# What is done with a map; `IT` is the stranger's, `OURS` our own, and `OUT` what is saved.
_COMMANDS = (
    "info IT",
    "info IT --json",
    "diff OURS IT",
    "diff IT OURS --same-frame --json",
    "diff IT OURS --same-frame --picture out.png",
    "align OURS IT",
    "align IT OURS -o OUT",
    "merge OURS IT -o OUT",
    "merge IT OURS --initial 0,0,0 -o OUT",
    "map recording --onto IT --same-place -o OUT",
    "changes IT",
    "changes IT --since 7d --json",
    "changes IT --picture out.svg",
    "history IT --export out.csv",
    "history IT --keep 1d",
    "expire IT 1 --until 2h",
    "notes IT",
    "notes IT --word tile --save-files out",
    "notes IT --write tile --place 1,1",
    "notes IT --remove 1",
    "values IT --method nearest -o OUT",
    "values samples.csv --onto IT -o OUT",
    "rooms IT -o OUT",
    "frontiers IT 1.7,1.1 --next-views",
    "path IT 1.7,1.1 sink",
    "connect OURS 1.7,1.1 IT 1.7,1.1",
    "evaluate IT OURS",
    "render IT -o out.png",
    "query IT --at 1,1",
    "ask IT 'which person is near the sink?'",
    "convert IT out.geojson",
    "convert IT out.csv",
    "convert IT out.tif --layer warmth",
    "convert IT out.mcap",
    "convert IT map.yaml --layer occupancy",
)
_JOBS = """
profile: default
jobs:
- recording: "monday"
  name: "first"
  detector: "yolo.onnx"
  config: settings.yaml
  options: {depth_scale: 5000.0, intrinsics: [525.0, 525.0, 319.5, 239.5], every: 2}
- recording: tuesday
  objects: false
"""
_SAMPLES = "x,y,value,stamp\n0.5,0.5,19.5,1\n1,1,20,2\n2,2.5,21,3\n2,1,22,4\n1,2,20,5\n3,1,19,6\n"


def commands(folder: Path) -> Target:
    """An archive, with which each of the commands is run in turn."""
    ours, made = folder / "ours.hmap", full_map(1, MONDAY + 86_400)
    save_map(made, ours)
    kept, work, corpus = ours.read_bytes(), folder / "work", []
    work.mkdir()
    write_good_recording(work / "recording")
    for example in (full_map(), a_map(), a_small_map()):
        save_map(example, folder / "example.hmap")
        corpus.append((folder / "example.hmap").read_bytes())

    for words in _COMMANDS:  # else the campaign would try nothing
        files = {"it.hmap": corpus[0], "ours.hmap": kept, "samples.csv": _SAMPLES.encode()}
        if not _run(shlex.split(words), work, files):
            raise RuntimeError(f"hypermap {words}: refused, though nothing is spoiled")

    def ask(data: bytes) -> None:
        files = {"it.hmap": data, "ours.hmap": kept, "samples.csv": _SAMPLES.encode()}
        done = [
            _run(shlex.split(words), work, files) for words in draw_of(data).sample(_COMMANDS, 3)
        ]
        if not any(done):
            raise HypermapError("the commands said what was wrong")

    return Target(ask, corpus, mutate_archive)


def _run(words: Sequence[str], work: Path, files: dict[str, bytes]) -> bool:
    """Run a command in a folder with some files, and return whether it did what it was to do.

    Raises:
        AssertionError: If it ends with another code than those for done and for bad input.
    """
    for path in work.iterdir():
        if path.is_file():
            path.unlink()
    for name, content in files.items():
        (work / name).write_bytes(content)
    paths = {"IT": "it.hmap", "OURS": "ours.hmap", "OUT": "saved.hmap"}
    named = [paths.get(word, word) for word in words]
    os.chdir(work)
    try:
        main(named)
    except SystemExit as ended:
        if ended.code not in (None, 0, _BAD_INPUT):
            raise AssertionError(f"{words[0]} ended with {ended.code}") from None
        return not ended.code
    raise AssertionError("it did not end")


def job_files(folder: Path) -> Target:
    """Files for `hypermap batch`: the jobs, whose recordings are not there, and their settings."""
    parts = {"jobs.yaml": _JOBS.encode(), "settings.yaml": b"evidence:\n  loss: 0.2\n"}
    return target_of_files(parts, lambda place, _: jobs_in(place / "jobs.yaml"), folder)
