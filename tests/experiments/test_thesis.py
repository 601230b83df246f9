"""`hypermap experiment thesis`, and the figures behind it."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.significance import signed_rank
from hypermap.experiments.drives import Mapped, SimulatedDrive, map_drive
from hypermap.experiments.figures import to_data
from hypermap.experiments.methods import OURS, PUBLISHED, methods
from hypermap.experiments.results import WorldResult
from hypermap.experiments.thesis_tables import methods_table
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.simulation import DetectorNoise, SimulatedRecording, errors_of_level
from hypermap.simulation.network import named_for_network
from hypermap.simulation.sightings import Sightings
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, World, WorldObject, load_world

from ..prepared import run

pytestmark = pytest.mark.xdist_group("thesis")  # they share what takes long to make

WORLD = """
name: studio
floor: {rectangle: [0, 0, 5, 4]}
walls: [{rectangle: [-0.05, -0.05, 5.05, 4.05]}]
objects: [{model: table, at: [3.2, 2]}, {model: chair, at: [2.2, 3.2], yaw_deg: -60}]
drive: {waypoints: [[0.5, 1], [1.2, 1.6, 30]], speed: 0.3, turn_rate_deg: 15}
"""


def hypermap(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return run(*words)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, dict, str]:
    """What the command prints, its figures and its page; the tables are in the folder named."""
    folder = tmp_path_factory.mktemp("experiment")
    (folder / "studio.yaml").write_text(WORLD, encoding="utf-8")
    (folder / "hull.yaml").write_text("evidence: {fusion: convex_hull}\n", encoding="utf-8")
    page = folder / "thesis.html"
    words = ("--worlds", folder / "studio.yaml", "--seeds", "2", "--rate", "2", "-o", page,
             "--method", folder / "hull.yaml")  # fmt: skip
    done = hypermap("experiment", "thesis", *words, "--errors", "fair", "--jobs", "2")
    assert done.returncode == 0, done.stderr
    figures = json.loads(page.with_suffix(".json").read_text(encoding="utf-8"))
    return done.stdout, figures, page.read_text(encoding="utf-8")


def test_all_methods_are_measured_on_the_same_drives(report: tuple[str, dict, str]) -> None:
    _, figures, _ = report
    (world,) = figures["worlds"]
    assert world["seeds"] == [1000, 1001]
    assert list(world["methods"]) == [
        "best shape, overlap",
        "best shape, radius",
        "convex hull, overlap",
        "convex hull, radius",
        "default",
        "hull",
    ]
    assert figures["made_with"]["methods"]["hull"]["evidence"]["fusion"] == "convex_hull"
    ours = world["methods"][OURS]
    assert ours["iou"] > 0.5
    assert set(ours["classes"]) == {"chair", "table"}
    others = [method for name, method in world["methods"].items() if name != OURS]
    assert all(0 <= method["p_iou"] <= 1 for method in others if method["p_iou"] is not None)


def test_the_figures_and_the_page_say_how_far_confidence_can_be_trusted(
    report: tuple[str, dict, str],
) -> None:
    _, figures, page = report
    ours = figures["worlds"][0]["methods"][OURS]
    assert sum(one["objects"] for one in ours["reliability"]) == pytest.approx(2 * ours["objects"])
    assert f"Expected calibration error: {ours['calibration_error']:.2f}." in page


def test_figures_say_what_bounds_recall_and_what_they_were_made_with(
    report: tuple[str, dict, str],
) -> None:
    text, figures, page = report
    bound = figures["worlds"][0]["bound"]
    assert bound["shown"] == 1 >= bound["detected"] >= bound["detected_twice"] > 0
    assert f"found by the detector at all: {bound['detected']:.2f} of the objects" in text
    assert f"{bound['detected']:.0%} of them by their class" in page
    made = figures["made_with"]
    assert made["versions"]["numpy"] == np.__version__
    assert made["errors"]["poses"]["drift"] == 0
    assert made["methods"][OURS]["evidence"]["fusion"] == "votes"


def test_a_world_in_the_figures_is_a_world_file(
    report: tuple[str, dict, str], tmp_path: Path
) -> None:
    """So an experiment with a world of one's own can be repeated from its figures alone."""
    described = report[1]["made_with"]["worlds"]["studio"]
    files = tmp_path / "studio.yaml", tmp_path / "again.yaml"
    for file, text in zip(files, (WORLD, json.dumps(described)), strict=True):
        file.write_text(text, encoding="utf-8")
    assert load_world(files[1]) == load_world(files[0])


def test_the_table_and_the_page_show_the_figures(report: tuple[str, dict, str]) -> None:
    text, figures, page = report
    for name, method in figures["worlds"][0]["methods"].items():
        row = next(line for line in text.splitlines() if line.startswith(name))
        assert ("-" if method["iou"] is None else f"{method['iou']:.2f}") in row
        assert f"<td>{name}</td>" in page
    assert page.count("data:image/png;base64,") == 2
    assert "http" not in page  # it needs no network
    assert figures["command"] in page


def test_the_means_of_the_drives_have_intervals(report: tuple[str, dict, str]) -> None:
    _, figures, page = report
    (world,) = figures["worlds"]
    drives = [drive["methods"][OURS] for drive in world["drives"]]
    found = world["methods"][OURS]["intervals"]
    for key, values in (
        ("iou", [drive["iou"] for drive in drives]),
        ("f1_half", [drive["at"][1]["f1"] for drive in drives]),
    ):
        half = 12.706 * abs(values[0] - values[1]) / 2  # Student's t of two values
        mean = np.mean(values)
        assert found[key] == pytest.approx(
            {"mean": mean, "low": mean - half, "high": mean + half}, rel=1e-3
        )
    assert "studio: means over 2 drives, with their 95 % intervals" in page


def test_only_worlds_of_the_thesis_have_its_figures_next_to_ours(
    report: tuple[str, dict, str],
) -> None:
    text, _, page = report
    assert "thesis' IoU" not in text + page
    assert "Why our figures are not those of the thesis" not in page
    world = {"world": "lab", "objects": 1, "seeds": [3], "methods": {}}
    at = [{"precision": 1.0, "recall": 1.0, "f1": 1.0}] * 2
    for name in ("best shape, overlap", OURS):
        shown = PUBLISHED.get((name, "lab"))
        world["methods"][name] = {"iou": 0.5, "distance": 0.1, "objects": 1.0, "at": at,
                                  "published": shown and vars(shown)}  # fmt: skip
    table = methods_table(world)
    titles = [column.title for column in table.columns]
    best, ours = (dict(zip(titles, row, strict=True)) for row in table.rows)
    assert (best["thesis' IoU"], best["thesis' [m]"]) == (0.41, 0.51)
    assert ours["thesis' IoU"] is None


def test_figures_go_into_detail(report: tuple[str, dict, str]) -> None:
    _, figures, page = report
    ours = figures["worlds"][0]["methods"][OURS]
    assert [(group["words"], group["objects"]) for group in ours["groups"]["object"]] == [
        ("0 table", 2),
        ("1 chair", 2),
    ]
    assert ours["confusion"]["classes"] == ["chair", "table"]
    counts = np.array(ours["confusion"]["counts"])
    assert counts[:2].sum(axis=1).tolist() == [2, 2]
    assert np.trace(counts) == 4 * ours["at"][0]["recall"] == 4 * ours["recall_of_detected"]
    assert ours["localization"][-1] >= ours["at"][0]["recall"]
    assert len(ours["localization"]) == len(figures["localization_limits"])
    given, used = (ours["poses"][when]["ate"] for when in ("given", "used"))
    assert given == 0  # the level `fair` has exact poses,
    assert used < 0.02  # which the correction leaves about as they are
    assert page.count("data:image/svg+xml;base64,") == 4


def test_each_table_is_saved_for_a_paper(report: tuple[str, dict, str]) -> None:
    text, figures, _ = report
    (named,) = re.findall(r"tables +(.*)", text)
    folder = Path(named)
    names = {file.stem for file in folder.iterdir()}
    kinds = "methods gains class-iou recall poses by-size by-object reliability-default"
    assert {f"studio-{kind}" for kind in (*kinds.split(), "confusion-hull")} <= names
    assert {file.suffix for file in folder.iterdir()} == {".csv", ".tex"}
    with (folder / "studio-methods.csv").open(encoding="utf-8") as file:
        rows = {row["method"]: row for row in csv.DictReader(file)}
    for name, method in figures["worlds"][0]["methods"].items():
        assert rows[name]["IoU"] == ("" if method["iou"] is None else str(method["iou"]))


def test_the_same_drive_gives_the_same_map_as_the_mapper() -> None:
    world = World(
        "test",
        FloorPlan((0, 0, 6, 4)),
        objects=(WorldObject("table", (3, 2)), WorldObject("plant", (3, 3.2))),
        drive=DrivePlan(((0.5, 2), (0.9, 2, 20)), speed=0.1, turn_rate_deg=10),
    )
    errors = errors_of_level("fair")
    mapped = map_drive(SimulatedDrive(world, 3, errors, 3.0), {OURS: profile("default")})
    recording = SimulatedRecording(
        world,
        rate=3.0,
        depth_noise=errors.depth,
        pose_noise=errors.poses,
        detector_noise=errors.detector,
        seed=3,
    )
    mapper = Mapper(profile("default"), detections_from_recording(), recording.occupancy())
    for frame in recording.frames():
        mapper.add(frame)
    expected = mapper.evidence.objects()
    assert expected
    assert [thing.name for thing in mapped.objects[OURS]] == [thing.name for thing in expected]
    for ours, theirs in zip(mapped.objects[OURS], expected, strict=True):
        assert ours.footprint.equals(theirs.footprint)
    assert mapped.frames == len(recording)


def test_the_network_detects_on_a_drive_by_its_own_names() -> None:
    world = named_for_network(
        World(
            "test",
            FloorPlan((0, 0, 6, 4)),
            objects=(WorldObject("chair", (2.5, 2.2), name="stool"), WorldObject("screen", (5, 2))),
            drive=DrivePlan(((0.5, 2), (0.7, 2)), speed=0.1),
        )
    )
    assert [thing.label for thing in world.objects] == ["chair", "monitor"]
    drive = SimulatedDrive(world, 3, errors_of_level("none"), 1.0, has_network=True)
    mapped = map_drive(drive, {})
    assert mapped.sightings.visible.tolist() == [mapped.frames] * 2
    assert mapped.sightings.detected[0] > 0
    blind = replace(drive, errors=replace(drive.errors, detector=DetectorNoise(miss=1.0)))
    assert map_drive(blind, {}).sightings.detected.tolist() == mapped.sightings.detected.tolist()


def test_figures_are_means_over_all_true_objects_of_all_drives() -> None:
    world = World(
        "w",
        FloorPlan((0, 0, 9, 9)),
        objects=(WorldObject("table", (2, 2)), WorldObject("cup", (5, 5))),
    )
    errors = errors_of_level("none")

    def shifted(name: str, x: float, y: float, half: tuple[float, float]) -> SemanticObject:
        return SemanticObject(name, shapely.box(x - half[0], y - half[1], x + half[0], y + half[1]))

    exact, off = shifted("table", 2, 2, (0.4, 0.7)), shifted("table", 2.5, 2, (0.2, 0.7))
    drives = [
        Mapped(
            SimulatedDrive(world, seed, errors, 1.0),
            1,
            {OURS: (exact,), "best shape, overlap": (off,)},
            Sightings(*np.array([[3, 2], [2, seed - 1], [0, 1]]), np.array([1.2, 3.0])),
        )
        for seed in (2, 1)
    ]
    result = WorldResult.of(drives)
    assert [m.drive.seed for m in result.mapped] == [1, 2]
    assert result.shape(OURS) == pytest.approx((1.0, 0.0))
    assert result.shape("best shape, overlap") == pytest.approx((0.5, 0.5))
    assert result.shape(OURS, "cup") == (None, None)
    world_data = to_data([result])["worlds"][0]
    assert world_data["bound"] == {"shown": 1.0, "detected": 0.75, "detected_twice": 0.5}
    assert [drive["detected"] for drive in world_data["drives"]] == [0.5, 1.0]
    assert world_data["drives"][0]["methods"][OURS]["at"][0]["recall"] == 0.5
    data = world_data["methods"]
    assert set(data[OURS]["average_precision"].values()) == {0.5}  # no table is beside its place
    assert data[OURS]["at"][0]["recall"] == 0.5  # the cup is missing
    # One table on two drives is one pair: one of two signs.
    assert data["best shape, overlap"]["p_iou"] == signed_rank([0.5]).p == 0.5
    gain = data["best shape, overlap"]["gain_iou"]
    assert (gain["pairs"], gain["rank_biserial"]) == (1, 1.0)
    assert [gain[key] for key in ("mean", "low", "high")] == pytest.approx([0.5] * 3)
    assert np.isclose(data["best shape, overlap"]["distance"], 0.5)


def test_methods_differ_as_they_are_named() -> None:
    known = methods()
    assert list(known)[-1] == OURS
    assert {name for name, _ in PUBLISHED} <= set(known)
    for name, config in known.items():
        if name != OURS:
            shape, association = name.split(", ")
            assert config.evidence.fusion == shape.replace(" ", "_")
            assert config.evidence.association == {"overlap": "jaccard"}.get(association, "radius")
            assert config.perception.method == "organised"


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="children are listed in /proc")
def test_sigterm_ends_all_its_processes(tmp_path: Path) -> None:
    words = ["thesis", "--worlds", "lab", "--rate", "30", "--jobs", "2", "-o", tmp_path / "t.html"]
    with subprocess.Popen(
        [sys.executable, "-m", "hypermap", "experiment", *map(str, words)],
        stderr=subprocess.DEVNULL,
    ) as process:
        listed = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        children: list[str] = []
        while not [child for child in children if "spawn_main" in _command_line(child)]:
            assert process.poll() is None
            time.sleep(0.1)
            children = listed.read_text().split()
        process.terminate()
        try:
            assert process.wait(240) == 143
        finally:
            process.kill()
        end = time.monotonic() + 240
        while any("spawn_main" in _command_line(child) for child in children):
            assert time.monotonic() < end, "a drive goes on without anyone who waits for it"
            time.sleep(0.1)
    assert list(tmp_path.iterdir()) == []


def _command_line(process: str) -> str:
    """Return the words of a process; nothing once it has ended."""
    try:
        return Path(f"/proc/{process}/cmdline").read_text().replace("\0", " ")
    except OSError:
        return ""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["thesiss"], "there is no experiment 'thesiss'; did you mean 'thesis'?"),
        (["thesis", "--worlds", "labb"], "there is no world 'labb'; did you mean 'lab'?"),
        (["thesis", "--errors", "bad"], "there is no level of errors 'bad'"),
        (["days", "--method", "m.yaml"], "--method: the experiment `days` does not have it"),
        (["thesis", "--parts", "rays"], "--parts: the experiment `thesis` does not have it"),
        (
            ["ablation", "--methods", "best"],
            "--methods: the experiment `ablation` does not have it",
        ),
        (["ablation", "--pcl"], "--pcl: the experiment `ablation` does not have it"),
        (["days", "--network"], "--network: the experiment `days` does not have it"),
        (["thesis", "--drives", "3"], "--drives: the experiment `thesis` does not have it"),
        (
            ["thesis", "--worlds", "lab,floor,lab"],
            "--worlds: lab and lab have the same name 'lab'; change the key",
        ),
        (["thesis", "-o", "no/where.html"], "does not exist; create it first"),
        (["thesis", "-o", "report.pdf"], "report.pdf: a report is saved as .html"),
        (["thesis", "--method", "no.yaml"], "no.yaml: there is no such configuration file"),
        (["thesis", "--method", "mine"], "--method mine: no such method is installed; known"),
        (
            ["ablation", "--parts", "wheels"],
            "has no part 'wheels' that can be left out; it has:",
        ),
        (["ablation", "--method", "a.yaml", "--method", "b.yaml"], "is of one method; give one"),
    ],
)
def test_what_cannot_be_done_is_said(
    words: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = hypermap("experiment", *words)
    assert done.returncode == 2
    assert message in done.stderr
    assert list(tmp_path.iterdir()) == []
