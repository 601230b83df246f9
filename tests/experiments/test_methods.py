"""Methods that users add to an experiment: files, and entry points of packages."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.experiments.drives import SimulatedDrive, map_drive
from hypermap.experiments.installed_methods import (
    ENTRY_POINT_GROUP,
    InstalledMethod,
    installed_names,
)
from hypermap.experiments.methods import OURS, chosen_methods, named_method, settings_of
from hypermap.experiments.parallel import in_processes
from hypermap.mapping.config import MappingConfig, profile
from hypermap.mapping.stages import KeyframeConfig
from hypermap.simulation import errors_of_level
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, World, WorldObject
from hypermap.testing import assert_same_objects

from ..cli.conftest import Result
from ..cli.conftest import hypermap as hypermap
from ..installed import install_package

PACKAGE = '''
import sys

import shapely
from hypermap import SemanticObject
from hypermap.core.errors import HypermapError
from hypermap.mapping.config import profile

SLOW = profile("thesis")
NUMBER = 3


class Boxes:
    """Puts a box of one meter before the camera for each name that is detected."""

    def __init__(self, occupancy):
        self.named = {}

    def add(self, frame):
        x, y = frame.map_T_camera[:2, 3] + 2 * frame.map_T_camera[:2, 2]
        for name in frame.detections.names:
            self.named[name] = SemanticObject(name, shapely.box(x - 0.5, y - 0.5, x + 0.5, y + 0.5))

    def objects(self):
        return list(self.named.values())


def broken(occupancy):
    raise RuntimeError("no wheels")


def nothing(occupancy):
    return None


class Changes(Boxes):
    def add(self, frame):
        frame.depth[:] = 0
        frame.color[:] = 0
        frame.camera.K[:] = 1
        frame.map_T_camera[:3, 3] += 5
        frame.detections.names[:] = "nothing"
        frame.detections.xyxy[:] = 0


class Names(Boxes):
    def objects(self):
        return list(self.named)


class Fails(Boxes):
    def add(self, frame):
        raise OwnError("frame", "bad")


class Quits(Boxes):
    def add(self, frame):
        sys.exit("no GPU")


class Refuses(Boxes):
    def objects(self):
        raise HypermapError("no model")


class OwnError(Exception):  # which no other process can read
    def __init__(self, what, why):
        super().__init__(f"{why} {what}")


class Empty(Boxes):
    def objects(self):
        return None
'''
POINTS = {
    "boxes": "box_mapper:Boxes",
    "slow": "box_mapper:SLOW",
    "number": "box_mapper:NUMBER",
    "broken": "box_mapper:broken",
    "nothing": "box_mapper:nothing",
    "gone": "box_mapper:Gone",
    "changes": "box_mapper:Changes",
    "names": "box_mapper:Names",
    "fails": "box_mapper:Fails",
    "empty": "box_mapper:Empty",
    "quits": "box_mapper:Quits",
    "refuses": "box_mapper:Refuses",
}


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with methods, as pip would install it."""
    (tmp_path / "box_mapper.py").write_text(PACKAGE)
    install_package(tmp_path, "box-mapper", ENTRY_POINT_GROUP, POINTS, "1.5")
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def drive() -> SimulatedDrive:
    world = World(
        "test",
        FloorPlan((0, 0, 6, 4)),
        objects=(WorldObject("table", (3, 2)),),
        drive=DrivePlan(((0.5, 2), (0.7, 2)), speed=0.2),
    )
    return SimulatedDrive(world, 3, errors_of_level("none"), 1.0)


def test_the_methods_of_the_thesis_may_cut_out_exactly_as_pcl_does() -> None:
    exact, fast = chosen_methods("all", exact=True), chosen_methods("all")
    for name, method in exact.items():
        assert isinstance(method, MappingConfig)
        assert method.perception.method == ("enclosed" if name == OURS else "unorganised")
    assert exact[OURS] == fast[OURS]
    name = "best shape, overlap"
    world = replace(drive().world, drive=DrivePlan(((0.5, 2), (1.3, 2)), speed=0.2))
    mapped = map_drive(replace(drive(), world=world), {"exact": exact[name], "fast": fast[name]})
    (one,), (other,) = mapped.objects["exact"], mapped.objects["fast"]
    assert one.name == other.name == "table"
    assert one.footprint.intersection(other.footprint).area > 0.9 * other.footprint.area


def test_a_file_is_a_method_with_its_name_and_what_differs(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("profile: thesis\nevidence: {loss: 0.4}\n")
    methods = chosen_methods("default", [str(file)])
    assert list(methods) == ["default", "mine"]
    mine = methods["mine"]
    assert isinstance(mine, MappingConfig)
    assert mine.evidence.loss == 0.4
    assert mine.perception == profile("thesis").perception
    file.write_text("")
    assert named_method(str(file)) == ("mine", profile("default"))


@pytest.mark.usefixtures("installed")
def test_a_package_brings_code_or_a_configuration() -> None:
    assert installed_names() == sorted(POINTS)
    methods = chosen_methods("default", ["boxes", "slow"])
    assert methods["slow"] == profile("thesis")
    boxes = methods["boxes"]
    assert boxes == InstalledMethod("boxes", "box_mapper:Boxes", "1.5")
    assert settings_of(boxes) == {"name": "boxes", "source": "box_mapper:Boxes", "version": "1.5"}
    mapped = map_drive(drive(), methods)
    assert [thing.name for thing in mapped.objects["boxes"]] == ["table"]
    (found,) = mapped.objects["boxes"]
    assert found.footprint.centroid.coords[0] == pytest.approx((2.7, 2), abs=0.1)


def test_the_help_lists_what_is_installed(installed: Path) -> None:
    code = "from hypermap.cli.main import main; main(['experiment', '--help'])"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONPATH": str(installed), "COLUMNS": "100"},
    )
    assert "Installed methods: boxes, broken, changes, empty, fails, gone, names," in done.stdout


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("boxs", "--method boxs: no such method is installed; did you mean 'boxes'?; a config"),
        (
            "number",
            "method 'number' (box_mapper:NUMBER): expected a MappingConfig, or a class",
        ),
        ("gone", "method 'gone' (box_mapper:Gone): cannot be loaded: AttributeError: "),
    ],
)
@pytest.mark.usefixtures("installed")
def test_what_is_no_method_is_said(word: str, message: str) -> None:
    with pytest.raises(HypermapError) as error:
        named_method(word)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("broken", "broken): cannot start on world test, seed 3: RuntimeError: no wheels (line 2"),
        ("nothing", "nothing): its NoneType has no method add()"),
        ("fails", "Fails): add() failed at 0 s on world test, seed 3: OwnError: bad frame (line"),
        ("empty", "Empty): objects() failed on world test, seed 3: TypeError: 'NoneType' object"),
        ("names", "Names): objects() must give SemanticObjects, gave str"),
        ("quits", "Quits): add() failed at 0 s on world test, seed 3: SystemExit: no GPU (line"),
        ("refuses", "Refuses): objects() failed on world test, seed 3: HypermapError: no model"),
    ],
)
@pytest.mark.usefixtures("installed")
def test_a_method_that_does_not_work_is_named_and_the_others_are_mapped(
    word: str, message: str
) -> None:
    mapped = map_drive(drive(), dict([named_method(word), named_method("boxes")]))
    assert list(mapped.objects) == ["boxes"]
    assert list(mapped.failed) == [word]
    assert mapped.failed[word].startswith(f"method '{word}' (box_mapper:{message}")


@pytest.mark.usefixtures("installed")
def test_what_a_signal_ends_is_no_fault_of_a_method(monkeypatch: pytest.MonkeyPatch) -> None:
    def end(run: object, frame: object) -> None:
        raise SystemExit(143)  # as at SIGTERM

    methods = dict([named_method("boxes")])
    monkeypatch.setattr(sys.modules["box_mapper"].Boxes, "add", end)
    with pytest.raises(SystemExit):
        map_drive(drive(), methods)


@pytest.mark.usefixtures("installed")
def test_an_experiment_saves_the_figures_of_methods_that_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hypermap: Callable[..., Result]
) -> None:
    monkeypatch.chdir(tmp_path)
    few = ["--worlds", "demo", "--seeds", "1", "--rate", "0.1", "--jobs", "1"]
    methods = ["--methods", "default", "--method", "quits"]
    result = hypermap("experiment", "thesis", *few, *methods)
    assert result.code == 2
    why = "method 'quits' (box_mapper:Quits): add() failed at 0 s on world demo, seed 1000: "
    assert f"error: {why}" in result.err
    data = json.loads(Path("thesis.json").read_text())
    assert list(data["worlds"][0]["methods"]) == ["default"]
    assert data["failed"]["quits"].startswith(why)
    assert Path("thesis.html").exists()


def test_of_two_packages_with_a_method_of_one_name_none_is_taken(installed: Path) -> None:
    install_package(installed, "other", ENTRY_POINT_GROUP, {"boxes": "other:Boxes"})
    with pytest.raises(HypermapError, match=r"other:Boxes of other.* have the same name 'boxes'"):
        named_method("boxes")


def test_what_a_method_maps_does_not_depend_on_other_methods() -> None:
    other = profile("default")
    sparse = replace(other, keyframes=KeyframeConfig(min_distance=9.0, look_again=0.0))
    mapped = map_drive(drive(), {"other": other, "sparse": sparse})
    alone = map_drive(drive(), {"sparse": sparse})
    assert mapped.poses["sparse"] == alone.poses["sparse"]
    assert [mapped.poses[name][0].poses for name in ("other", "sparse")] == [2, 1]


@pytest.mark.usefixtures("installed")
def test_a_method_that_changes_its_frames_changes_no_other_methods() -> None:
    after = {"default": profile("default")} | dict([named_method("boxes")])
    alone = map_drive(drive(), after)
    mapped = map_drive(drive(), dict([named_method("changes")]) | after)
    for name in after:
        assert_same_objects(mapped.objects[name], alone.objects[name])
    assert mapped.poses["default"] == alone.poses["default"]


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        (None, FileMissing, "mine.yaml: there is no such configuration file"),
        ("- a\n", FormatError, "mine.yaml: expected keys and values, found "),
        (
            "profile: thesiss\n",
            FormatError,
            "mine.yaml: profile: there is no profile 'thesiss';",
        ),
        ("evidence: {lose: 1}\n", FormatError, "mine.yaml: evidence.lose: unknown key; did you m"),
    ],
)
def test_a_file_that_is_no_method_is_an_error_that_names_it(
    text: str | None,
    error: type[HypermapError],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    if text is not None:
        Path("mine.yaml").write_text(text)
    with pytest.raises(error) as raised:
        named_method("mine.yaml")
    assert str(raised.value).startswith(message)


def test_two_methods_have_two_names(tmp_path: Path) -> None:
    file = tmp_path / "default.yaml"
    file.write_text("")
    for words in ("all", "best"):  # nor is one taken for ours
        with pytest.raises(HypermapError, match="a method 'default' already; rename it"):
            chosen_methods(words, [str(file)])


def test_ctrl_c_at_a_terminal_is_left_to_the_process_that_has_started_the_others():
    interrupted = "__import__('signal').raise_signal(2) or 'goes on'"
    waiting = "int(2 in __import__('signal').pthread_sigmask(0, []))"  # from its start on
    assert sorted(in_processes(eval, [f"{interrupted}, {waiting}"] * 2, 2)) == [("goes on", 1)] * 2


def test_a_process_that_dies_is_an_error() -> None:
    with pytest.raises(HypermapError, match="a process died over a drive, for want of memory"):
        list(in_processes(os._exit, [3, 3], 2))
