from __future__ import annotations

from pathlib import Path

import pytest

from hypermap.core.errors import FileMissing, FormatError
from hypermap.recordings import open_recording

from .shots import make_shots, write_seven_scenes, write_tum

LOOKED_FOR = (
    "looked for a TUM RGB-D folder (rgb.txt, depth.txt, groundtruth.txt), a 7-Scenes folder "
    "(frame-000000.color.jpg or .png, .depth.png, .pose.txt, ...), a ScanNet or Open3D folder "
    "(depth/0.png, color/0.jpg, pose/0.txt or trajectory.log, ...), a Replica folder "
    "(results/depth000000.png, traj.txt, ...), a ROS 1 bag (NAME.bag, or a folder of its parts "
    "NAME_0.bag, NAME_1.bag, ...) or a ROS 2 bag (a folder with metadata.yaml, NAME.db3 or "
    "NAME.mcap); docs/recordings.md shows how to convert others"
)


@pytest.mark.parametrize(
    ("files", "kind"),
    [
        (["depth.txt", "rgb.txt", "groundtruth.txt"], "TUM RGB-D"),
        (["rgb.txt"], "TUM RGB-D"),
        (["frame-000007.depth.png"], "7-Scenes"),
        (["frame-000007.pose.txt"], "7-Scenes"),
        (["results/depth000000.png"], "Replica"),
        (["depth/0.png"], "numbered images"),
        (["metadata.yaml", "x_0.db3"], "ROS 2 bag"),
        (["x_0.mcap"], "ROS 2 bag"),
        (["x_0.bag", "x_1.bag"], "ROS 1 bag"),
    ],
)
def test_a_folder_is_recognised_by_what_lies_in_it(
    tmp_path: Path, files: list[str], kind: str
) -> None:
    for name in files:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    info = open_recording(tmp_path).info()
    assert info.format == kind
    assert info.missing  # the files are empty


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("a.bag", "ROS 1 bag"),
        ("a.bag.active", "ROS 1 bag"),
        ("a.db3", "ROS 2 bag"),
        ("a.mcap", "ROS 2 bag"),
    ],
)
def test_a_file_is_recognised_by_its_ending(tmp_path: Path, name: str, kind: str) -> None:
    (tmp_path / name).touch()
    assert open_recording(tmp_path / name).info().format == kind


def test_nothing_at_all_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileMissing) as caught:
        open_recording(tmp_path / "nowhere")
    assert str(caught.value) == f"{tmp_path}/nowhere: there is no such file or folder"


@pytest.mark.parametrize("name", ["map.pdf", "README", "frame-000000.depth.png"])
def test_a_foreign_file_is_an_error_that_lists_what_was_looked_for(
    tmp_path: Path, name: str
) -> None:
    (tmp_path / name).write_text("something else")
    with pytest.raises(FormatError) as caught:
        open_recording(tmp_path / name)
    assert str(caught.value) == f"{tmp_path / name}: no recording found; {LOOKED_FOR}"


@pytest.mark.parametrize(
    ("file", "named", "hint"),
    [
        ("seq.zip", "", "unpack seq.zip first"),
        ("seq.tar.gz", "seq.tar.gz", "unpack seq.tar.gz first"),
        ("bag_0.db3.zstd", "", "unpack bag_0.db3.zstd first"),
        ("office.hmap", "office.hmap", "this is a map, which --onto continues with a recording"),
        (
            "depth/frame_00001.png",
            "",
            "the files in depth, such as frame_00001.png, are not PNG images named by the number "
            "of their frame, such as 0.png",
        ),
        (
            "depth/0.npy",
            "",
            "the files in depth, such as 0.npy, are not PNG images named by the number of their "
            "frame, such as 0.png",
        ),
    ],
)
def test_what_may_be_wrong_with_a_foreign_folder_is_said(
    tmp_path: Path, file: str, named: str, hint: str
) -> None:
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).touch()
    with pytest.raises(FormatError) as caught:
        open_recording(tmp_path / named)
    assert str(caught.value) == f"{tmp_path / named}: no recording found; {hint}; {LOOKED_FOR}"


def test_a_folder_of_recordings_names_them(tmp_path: Path) -> None:
    (tmp_path / "notes").mkdir()
    write_seven_scenes(tmp_path / "seq-01", make_shots(1))
    write_tum(tmp_path / "seq-02", make_shots(1))
    with pytest.raises(FormatError) as caught:
        open_recording(tmp_path)
    assert str(caught.value) == (
        f"{tmp_path}: there is a recording one folder down (seq-01, seq-02); name it, as "
        f"{tmp_path}/seq-01"
    )
