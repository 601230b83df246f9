from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.perception.detections import Detections
from hypermap.perception.detectors import rle
from hypermap.perception.detectors.recorded import RecordedDetections

CUP = {"box": [1, 2, 30.5, 40], "name": "cup", "score": 0.5}


def write(path: Path, content: Any) -> Path:
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


@pytest.fixture
def recorded(tmp_path: Path) -> RecordedDetections:
    content = {"image_size": [640, 480], "frames": {"2.5": [CUP], "1305031229.729064": []}}
    return RecordedDetections.load(write(tmp_path / "detections.json", content))


def test_the_detections_of_a_real_recording_are_read(shared_data: Path) -> None:
    recorded = RecordedDetections.load(shared_data / "desk" / "detections.json")
    assert len(recorded) == 116
    assert recorded.image_size == (640, 480)
    found = [recorded.at(stamp) for stamp in recorded.stamps]
    assert sum(map(len, found)) == 392
    first = found[0]
    assert list(first.names) == ["laptop"]
    np.testing.assert_allclose(first.xyxy, [[214.96, 73.13, 428.91, 282.24]], rtol=1e-6)
    assert first.scores == pytest.approx([0.5023])
    assert first.masks is None


def test_a_stamp_that_was_rounded_is_found(recorded: RecordedDetections) -> None:
    assert list(recorded.at(2.5009).names) == ["cup"]
    assert list(recorded.at(2.4991).names) == ["cup"]
    assert len(recorded.at(1305031229.7290642)) == 0
    assert recorded.missed == 0


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "detections.json"
    path.write_text('{"frames": {"2.5": []}}', encoding="utf-8-sig")
    assert RecordedDetections.load(path).stamps == (2.5,)


def test_stamps_may_be_nanoseconds_as_in_the_lists_of_images(tmp_path: Path) -> None:
    cup = {"box": [1, 2, 3, 4], "name": "cup", "score": 0.5}
    path = tmp_path / "detections.json"
    path.write_text(json.dumps({"frames": {"1700000000250000000": [cup]}}))
    assert RecordedDetections.load(path).at(1_700_000_000.25).names == ("cup",)


def test_masks_may_be_in_the_compressed_form_in_which_programs_write_coco_results(
    tmp_path: Path,
) -> None:
    lengths = [6, 1, 40, 4, 5, 4, 5, 4, 21]  # as COCO's mask API decodes the text
    text, size = "61X13mN000`0", (9, 10)
    path = write(
        tmp_path / "detections.json",
        {"frames": {"1": [CUP | {"mask": {"size": size, "counts": text}}]}},
    )
    masks = RecordedDetections.load(path).at(1.0).masks
    assert masks is not None
    np.testing.assert_array_equal(masks[0], rle.decode(lengths, *size))


@given(st.lists(st.integers(0, 2**28), max_size=12))
def test_counts_as_text_are_those_that_were_written(counts: list[int]) -> None:
    assert rle.from_text("".join(map(_as_text, differences(counts)))) == counts


def differences(counts: list[int]) -> list[int]:
    return [count - (counts[i - 2] if i > 2 else 0) for i, count in enumerate(counts)]


def _as_text(number: int) -> str:
    """Return a number as COCO's mask API writes it, by its own description."""
    bits, number = number & 0x1F, number >> 5
    if number == (-1 if bits & 0x10 else 0):
        return chr(48 + bits)
    return chr(48 + bits + 0x20) + _as_text(number)


def test_the_nearest_of_two_close_stamps_is_taken() -> None:
    recorded = RecordedDetections()
    recorded.add(1.0008, Detections.of([[0, 0, 1, 1]], ["later"]))
    recorded.add(1.0, Detections.of([[0, 0, 1, 1]], ["sooner"]))
    assert recorded.stamps == (1.0, 1.0008)
    assert [recorded.at(stamp).names[0] for stamp in (0.9999, 1.0003, 1.0005, 1.0017)] == [
        "sooner",
        "sooner",
        "later",
        "later",
    ]


def test_an_unknown_stamp_has_no_detections_and_is_counted_and_logged_once(
    recorded: RecordedDetections, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        assert [len(recorded.at(stamp)) for stamp in (2.502, 0, 1e3, 2.5)] == [0, 0, 0, 1]
    assert recorded.missed == 3
    assert [record.getMessage() for record in caplog.records] == [
        f"{recorded.path}: no entry for the image at 2.502000, the nearest is at 2.500000; this "
        "and other missing images count as images without objects"
    ]


@pytest.mark.parametrize("stamp", [1e5 - 3700.0, 1e5 + 3710.0, 1.7e9, 0.0])
def test_an_image_of_another_day_is_not_one_without_objects(stamp: float) -> None:
    recorded = RecordedDetections(path="monday.json")
    for known in (1e5, 1e5 + 100.0):
        recorded.add(known, Detections.of([[0, 0, 1, 1]], ["cup"]))
    assert len(recorded.at(1e5 - 3500.0)) == len(recorded.at(1e5 + 3690.0)) == 0
    with pytest.raises(FormatError, match=rf"^monday.json: .* image is of {stamp:.6f} s; are they"):
        recorded.at(stamp)


def test_boxes_that_are_shares_of_the_image_are_refused(tmp_path: Path) -> None:
    objects = [CUP | {"box": [0.1, 0.25, 0.5, 1]}, CUP | {"box": [0, 0, 1, 1]}]
    path = write(tmp_path / "shares.json", {"frames": {"1": objects[1:], "2": objects}})
    with pytest.raises(FormatError, match="all boxes are between 0 and 1; multiply them by"):
        RecordedDetections.load(path)
    write(path, {"frames": {"1": objects[1:]}})
    assert len(RecordedDetections.load(path)) == 1
    write(path, {"frames": {"1": objects, "2": [CUP]}})
    assert len(RecordedDetections.load(path)) == 2


def test_nothing_recorded_has_nothing_to_say() -> None:
    assert len(RecordedDetections().at(1.0)) == 0


SHAPE = (
    '{"frames": {STAMP: [{"box": [xmin, ymin, xmax, ymax], "name": "cup", "score": 0.9}]}}; '
    "docs/detectors.md shows how to convert COCO results"
)
MASK = {"size": [2, 3], "counts": [1, 2, 3]}


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"box": [3, 2, 1, 4]}, "expected xmin <= xmax and ymin <= ymax, got [3.0, 2.0, 1.0, 4.0]"),
        ({"box": [1, 4, 3, 2]}, "expected xmin <= xmax and ymin <= ymax, got [1.0, 4.0, 3.0, 2.0]"),
        ({"box": [1, 2, 3]}, "box: 3: Field required"),
        ({"box": [1, 2, 3, float("nan")]}, "box: 3: Input should be a finite number"),
        ({"box": [1, 2, float("inf"), 4]}, "box: 2: Input should be a finite number"),
        ({"box": [1, 2, 1e300, 4]}, "box: 2: Input should be less than or equal to 32768"),
        ({"box": "1 2 3 4"}, "box: Input should be a valid array"),
        ({"score": 1.01}, "score: Input should be less than or equal to 1"),
        ({"score": -0.1}, "score: Input should be greater than or equal to 0"),
        ({"score": "0.5"}, "score: Input should be a valid number"),
        ({"name": ""}, "name: String should have at least 1 character"),
        ({"name": 7}, "name: Input should be a valid string"),
        ({"mask": MASK | {"counts": [1, 2]}}, "mask: the counts add up to 3, not to 2 x 3 pixels"),
        ({"mask": MASK | {"counts": "12"}}, "mask: the counts add up to 3, not to 2 x 3 pixels"),
        (
            {"mask": MASK | {"counts": "1N"}},
            "mask: counts: 1: Input should be greater than or equal to 0",
        ),
        ({"mask": MASK | {"counts": "1X"}}, "mask: counts: the text of a mask's counts is cut off"),
        (
            {"mask": MASK | {"counts": "eJyz"}},
            "mask: counts: expected counts as COCO's mask API writes them, a list or a text",
        ),
        (
            {"mask": {"size": [1 << 40, 1], "counts": [1 << 40]}},
            "mask: size: 0: Input should be less than or equal to 16384",
        ),
    ],
)
def test_a_bad_object_is_named_by_file_frame_and_number(
    change: dict[str, Any], expected: str, tmp_path: Path
) -> None:
    path = write(tmp_path / "bad.json", {"frames": {"1": [], "12.5": [CUP, CUP | change]}})
    with pytest.raises(FormatError) as error:
        RecordedDetections.load(path)
    assert str(error.value) == f"{path}: frame 12.5: object 1: {expected}"


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("", "Invalid JSON: EOF while parsing a value at line 1 column 0"),
        ('{"frames": {', "Invalid JSON: EOF while parsing an object at line 1 column 12"),
        ("[" * 100_000, "Invalid JSON: recursion limit exceeded at line 1 column 202"),
        ([], f"Input should be an object; expected {SHAPE}"),
        ({}, f"frames: Field required; expected {SHAPE}"),
        ({"frames": [CUP]}, f"frames: Input should be an object; expected {SHAPE}"),
        (
            {"frames": {"1": [{"bbox": [1, 2, 3, 4]}]}},
            "frame 1: object 0: box: Field required; an object has box, name and score",
        ),
        ({"frames": {"1": CUP}}, "frame 1: Input should be a valid array"),
        ({"frames": {"first": []}}, "frame first: the key of a frame is its stamp in seconds"),
        ({"frames": {"nan": []}}, "frame nan: the stamp must be a finite number, got nan"),
        (
            {"frames": {"1": [], "1.0": []}},
            "frame 1.0: there is a frame with the stamp 1.0 already",
        ),
        (
            {"image_size": [0, 3], "frames": {}},
            "image_size.0: Input should be greater than or equal to 1",
        ),
        (
            {"frames": {"1": [CUP | {"mask": MASK}, CUP]}},
            "frame 1: either all objects of a frame have a mask, or none",
        ),
        (
            {"image_size": [2, 3], "frames": {"1": [CUP | {"mask": MASK}]}},
            "frame 1: expected masks of (3, 2) rows and columns, got (2, 3)",
        ),
    ],
)
def test_a_bad_file_is_one_clear_error(content: Any, expected: str, tmp_path: Path) -> None:
    path = write(tmp_path / "bad.json", content)
    with pytest.raises(FormatError) as error:
        RecordedDetections.load(path)
    assert str(error.value) == f"{path}: {expected}"


def test_another_kind_of_file_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "picture.json"
    path.write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe")
    with pytest.raises(FormatError, match=r"picture\.json: is not text in UTF-8; "):
        RecordedDetections.load(path)


@pytest.mark.parametrize("name", ["missing.json", "."])
def test_a_missing_file_and_a_folder_are_an_error(name: str, tmp_path: Path) -> None:
    with pytest.raises(FileMissing, match="there is no such file of detections"):
        RecordedDetections.load(tmp_path / name)


pixels = st.floats(-100, 5000, width=32)
objects = st.tuples(
    st.tuples(pixels, pixels),
    st.tuples(pixels, pixels),
    st.floats(0, 1, width=32),
    st.text("äñ x猫", min_size=1),
)
frames = st.dictionaries(st.floats(0, 2e9), st.lists(objects, max_size=3), max_size=4)


@given(frames)
def test_what_was_written_is_read_again_exactly(
    tmp_path_factory: pytest.TempPathFactory, drawn: dict[float, list[Any]]
) -> None:
    written = RecordedDetections((640, 480))
    for stamp, found in drawn.items():
        boxes = [[min(x), min(y), max(x), max(y)] for x, y, _, _ in found]
        names, scores = [each[3] for each in found], [each[2] for each in found]
        written.add(stamp, Detections.of(boxes, names, scores))
    path = tmp_path_factory.mktemp("recorded") / "detections.json"
    written.save(path)
    read = RecordedDetections.load(path)
    assert (read.stamps, read.image_size) == (tuple(sorted(drawn)), (640, 480))
    for stamp in read.stamps:
        ours, theirs = written.at(stamp), read.at(stamp)
        np.testing.assert_array_equal(ours.xyxy, theirs.xyxy)
        np.testing.assert_array_equal(ours.scores, theirs.scores)
        assert list(ours.names) == list(theirs.names)
    again = path.with_name("again.json")
    read.save(again)
    assert again.read_bytes() == path.read_bytes()


def test_masks_are_written_and_read_again(tmp_path: Path) -> None:
    masks = np.random.default_rng(3).random((2, 48, 64)) > 0.5
    written = RecordedDetections((64, 48))
    written.add(1.5, Detections.of([[0, 0, 64, 48]] * 2, ["cup", "cup"], masks=masks))
    written.save(tmp_path / "detections.json")
    found = RecordedDetections.load(tmp_path / "detections.json").at(1.5)
    np.testing.assert_array_equal(found.masks, masks)


@given(arrays.arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_run_lengths_turn_into_the_mask_again(mask: np.ndarray) -> None:
    counts = rle.encode(mask)
    assert sum(counts[1::2]) == mask.sum()
    np.testing.assert_array_equal(rle.decode(counts, *mask.shape), mask)


def test_detections_that_do_not_fit_are_refused() -> None:
    recorded = RecordedDetections((64, 48))
    recorded.add(1.0, Detections.of([], []))
    with pytest.raises(ValueError, match=r"a frame with the stamp 1\.0 already"):
        recorded.add(1.0, Detections.of([], []))
    masks = np.zeros((1, 64, 48), bool)
    with pytest.raises(ValueError, match=r"expected masks of \(48, 64\) rows and columns"):
        recorded.add(2.0, Detections.of([[0, 0, 1, 1]], ["cup"], masks=masks))
    assert recorded.stamps == (1.0,)


def test_a_save_that_fails_leaves_what_was_there(tmp_path: Path) -> None:
    recorded = RecordedDetections((64, 48))
    with pytest.raises(FileMissing, match="there is no such folder"):
        recorded.save(tmp_path / "missing" / "detections.json")
    (tmp_path / "folder").mkdir()
    with pytest.raises(HypermapError, match="is a folder; choose another name"):
        recorded.save(tmp_path / "folder")
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


def test_a_link_keeps_pointing_at_the_detections_that_are_replaced(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    link = tmp_path / "detections.json"
    link.symlink_to(tmp_path / "real" / "detections.json")
    RecordedDetections((64, 48)).save(link)
    assert link.is_symlink()
    assert [path.name for path in (tmp_path / "real").iterdir()] == ["detections.json"]
