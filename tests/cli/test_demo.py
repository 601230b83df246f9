from __future__ import annotations

import pytest
from PIL import Image

from hypermap.core.frames import Pose2D
from hypermap.formats import open_map

from .conftest import assert_one_error


@pytest.fixture
def short_demo(monkeypatch):
    """The demo's own steps on a recording of few frames, so that the test takes little time."""
    import hypermap.simulation
    from hypermap.simulation import SimulatedRecording

    monkeypatch.setattr(
        hypermap.simulation,
        "SimulatedRecording",
        lambda world, **options: SimulatedRecording(world, rate=0.25, **options),
        raising=False,
    )


def test_the_demo_makes_a_map_and_compares_it(hypermap, short_demo, tmp_path):
    folder = tmp_path / "a new folder"
    result = hypermap("demo", "--folder", folder)
    assert result.code == 0, result.err
    assert "driving through a simulated room" in result.err
    quoted = f"'{folder}/room.hmap'"  # has a space, and is for a shell
    commands = (f"hypermap view {quoted}", f"hypermap query {quoted} --name cup --nearest")
    for words in ("in the room", "found", "off by", "chair", *commands):
        assert words in result.out
    assert str(folder / "room.png") in result.out
    made, truth = open_map(folder / "room.hmap"), open_map(folder / "truth.hmap")
    assert [layer.name for layer in made.layers] == ["occupancy", "semantic"]
    assert made.frames.lookup(truth.base_frame, made.base_frame) == Pose2D()
    with Image.open(folder / "room.png") as image:
        assert image.width > 1000


def test_the_kept_recording_gives_the_same_map(hypermap, short_demo, tmp_path):
    assert hypermap("demo", "--folder", tmp_path, "--keep-recording").code == 0
    again = tmp_path / "again.hmap"
    assert hypermap("map", tmp_path / "recording", "-o", again).code == 0
    first, second = (open_map(path)["semantic"] for path in (tmp_path / "room.hmap", again))
    assert sorted(first.names) == sorted(second.names)


def test_the_detector_that_errs_maps_the_room_too(hypermap, short_demo, tmp_path):
    result = hypermap("demo", "--folder", tmp_path, "--noisy")
    assert result.code == 0, result.err
    assert len(open_map(tmp_path / "room.hmap")["semantic"].names) > 5


def test_a_file_in_place_of_the_folder_is_said_so(hypermap, tmp_path):
    (tmp_path / "demo").write_text("precious")
    assert_one_error(
        hypermap("demo", "--folder", tmp_path / "demo"), "this is a file; name a folder"
    )
    assert (tmp_path / "demo").read_text() == "precious"
