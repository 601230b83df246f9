"""The poses in folders of the TUM RGB-D format: trajectories and their headers."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import numpy as np
import pytest

from hypermap.core.errors import FormatError
from hypermap.recordings.tum import read_trajectory

from .tum_tools import opened


def test_lost_poses_that_are_nan_are_left_out_and_counted(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = folder / "groundtruth.txt"
    header, first, *others = path.read_text().splitlines()
    lost = [f"{float(first.split()[0]) - ago} nan nan nan nan nan nan NaN" for ago in (2, 1)]
    path.write_text("\n".join([header, *lost, first, *others]))
    said = "2 poses of groundtruth.txt left out: NaN, as of lost tracking"
    assert opened(folder).info().notes[0] == said
    with caplog.at_level(logging.WARNING):
        assert len([*opened(folder).frames()])
    assert said in caplog.text
    path.write_text("\n".join([header, *lost]))
    with pytest.raises(FormatError, match=r"all poses in it are NaN \(2\), so tracking never"):
        read_trajectory(path, 1.0)


def test_poses_out_of_order_and_repeated_are_sorted_out_and_noted(folder: Path) -> None:
    path = folder / "groundtruth.txt"
    lines = path.read_text().splitlines()[1:]
    path.write_text("\n".join([*lines[::-1], lines[0]]))
    assert opened(folder).info().notes == (
        "the stamps of groundtruth.txt were out of order and have been sorted",
        "1 pose of groundtruth.txt left out: with the stamp of another",
    )


def test_commas_may_separate_the_numbers_of_poses(folder: Path) -> None:
    before = [frame.map_T_camera for frame in opened(folder).frames()]
    path = folder / "groundtruth.txt"
    path.write_text(path.read_text().replace(" ", ", "))
    after = [frame.map_T_camera for frame in opened(folder).frames()]
    np.testing.assert_array_equal(after, before)


EUROC = (
    "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
    "q_RS_z []"
)


def as_euroc(folder: Path, header: str, others: str = "", since: float = 0.0) -> Path:
    """Rewrite the poses of a folder as EuRoC has them, w first, with stamps since some time [s]."""
    path = folder / "groundtruth.txt"
    rows = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    lines = (
        ",".join((f"{(float(row[0]) - since) * 1e9:.0f}", *row[1:4], row[7], *row[4:7])) + others
        for row in rows
    )
    path.write_text("\n".join((header, *lines)))
    return path


@pytest.mark.parametrize(("more", "others"), [("", ""), (", v_RS_R_x [m s^-1]", ",0.5")])
def test_the_header_of_a_trajectory_tells_its_columns_as_in_euroc(
    folder: Path, more: str, others: str
) -> None:
    before = [frame.map_T_camera for frame in opened(folder).frames()]
    path = as_euroc(folder, EUROC + more, others)
    after = [frame.map_T_camera for frame in opened(folder).frames()]
    np.testing.assert_allclose(after, before, atol=1e-6)
    (note,) = read_trajectory(path, 1.0)[1]
    assert "its header names the columns timestamp [ns], p_RS_R_x [m]" in note
    assert note.endswith("; 1 column more left out") == bool(more)


def test_the_header_of_a_trajectory_tells_the_unit_of_its_stamps(folder: Path) -> None:
    path = folder / "groundtruth.txt"
    whole = read_trajectory(path, 1.0)[0].stamps
    as_euroc(folder, EUROC, since=whole[0] - 5.0)  # since the start of a computer
    stamps = read_trajectory(path, 1.0)[0].stamps
    assert stamps == pytest.approx(whole - whole[0] + 5.0, abs=1e-6)


def test_the_units_of_a_header_may_be_spelled_out(folder: Path) -> None:
    path = folder / "groundtruth.txt"
    known, _ = read_trajectory(path, 1.0)
    header = "# timestamp [sec], x [meters], y [Meters], z [meter], qx, qy, qz, qw\n"
    path.write_text(header + path.read_text())
    trajectory, notes = read_trajectory(path, 1.0)
    np.testing.assert_array_equal(trajectory.stamps, known.stamps)
    np.testing.assert_array_equal(trajectory.positions, known.positions)
    assert notes == ()


@pytest.mark.parametrize(
    ("header", "others", "message"),
    [
        (EUROC, ",0.5", "line 2: expected 8 numbers, as its header says, found 9"),
        (
            EUROC.replace("_x [m]", "_x [mm]"),
            "",
            "header: the column 'p_RS_R_x [mm]' has the unit 'mm', known are: m",
        ),
        (EUROC.replace("[ns]", "[min]"), "", "'timestamp [min]' has the unit 'min', known are: s"),
    ],
)
def test_a_header_that_does_not_fit_is_an_error(
    folder: Path, header: str, others: str, message: str
) -> None:
    path = as_euroc(folder, header, others)
    with pytest.raises(FormatError, match=re.escape(message)):
        read_trajectory(path, 1.0)


def test_stamps_since_the_start_of_a_computer_are_of_one_unit(folder: Path) -> None:
    """Counted in ns, they pass after 100 s what would be ms since 1970."""
    path, stamps = folder / "groundtruth.txt", np.arange(95e9, 105e9, 1e8)
    path.write_text("\n".join(f"{stamp:.0f} {stamp / 1e9} 0 1 0 0 0 1" for stamp in stamps))
    trajectory, notes = read_trajectory(path, 1.0)
    np.testing.assert_allclose(trajectory.stamps, stamps)
    assert notes == ()


def test_poses_of_another_convention_are_read_on_request(folder: Path) -> None:
    true = [frame.map_T_camera for frame in opened(folder).frames()]
    path = folder / "groundtruth.txt"
    rows = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    path.write_text("\n".join(" ".join((*row[:4], row[7], *row[4:7])) for row in rows))
    read = opened(folder, pose_convention="w-first").frames()
    for frame, pose in zip(read, true, strict=True):
        np.testing.assert_allclose(frame.map_T_camera, pose, atol=1e-9)
