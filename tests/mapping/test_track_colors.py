"""Colors tell objects of one class and shape apart, whatever the light of the day."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.trajectory import trajectory_of
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.evidence_buffer import SeenColor
from hypermap.mapping.frame_log import LoggedFrame, packed_frame
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.merging.moving import moved_tracks
from hypermap.mapping.moved_frames import moved_frames
from hypermap.mapping.track_arrays import PackedTables, packed_tables, unpacked_tables
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.observation import Observation, ObservedObject
from hypermap.perception.paint import Rgb, median_color, some_of

from .evidence_tools import DEFAULT, ROOM, square
from .test_mapper import boxes, frame

DAY = 86_400.0
RED, GREEN, BLUE, WHITE, BLACK = (
    *((150, 50, 45), (60, 110, 85), (47, 59, 120)),
    *((235, 235, 230), (20, 20, 22)),
)
FIXED = (((-6, 6), GREEN), ((0, 6), BLUE), ((6, 6), RED))
"""Chairs that stay."""

Chairs = Sequence[tuple[tuple[float, float], Rgb | None]]


def look(
    evidence: EvidenceMap,
    chairs: Chairs,
    stamp: float,
    gains: Sequence[float],
    first: str = "chair",
) -> None:
    """Add a frame that shows chairs at these places, of these colors in this light.

    The first one may be of another class. None: of several colors.
    """
    objects = tuple(
        ObservedObject("chair" if i else first, 1.0, square(*place), 0.1, 0.9)
        for i, (place, _) in enumerate(chairs)
    )
    evidence.update(Observation(stamp, np.eye(4), objects, ROOM))
    colors = [None if color is None else lit(color, gains) for _, color in chairs]
    evidence.add_colors(stamp, dict(zip(objects, colors, strict=True)))


def lit(color: Rgb, gains: Sequence[float]) -> Rgb:
    r, g, b = np.clip(np.multiply(color, gains), 0, 255)
    return int(r), int(g), int(b)


def two_days(
    before: Chairs, after: Chairs, gains: Sequence[float] = (1, 1, 1), fixed: Chairs = FIXED
) -> dict[int, tuple[float, float]]:
    """Return where the chairs of the first day are on the second one, by the order of the first."""
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        look(evidence, (*before, *fixed), second, (1, 1, 1))
    for second in range(40):
        look(evidence, (*after, *fixed), DAY + second, gains)
    centers = {item.id: item.footprint.centroid for item in evidence.objects()}
    return {
        number: (round(center.x, 1) + 0.0, round(center.y, 1) + 0.0)
        for number, center in centers.items()
        if number < len(before)
    }


WARM_AND_DARK = (0.9, 0.75, 0.6)


@pytest.mark.parametrize("gains", [(1, 1, 1), WARM_AND_DARK, (1.2, 1.3, 1.4)])
def test_each_of_two_equal_chairs_is_found_by_its_color(gains: Sequence[float]) -> None:
    before = (((-3, 0), RED), ((3, 0), GREEN))
    after = (((-3, -3), GREEN), ((3, -3), RED))  # the shortest ways would be the other ones
    assert two_days(before, after, gains) == {0: (3, -3), 1: (-3, -3)}


def test_chairs_whose_color_is_the_same_go_the_shortest_way() -> None:
    before = (((-3, 0), RED), ((3, 0), RED))
    after = (((-3, -3), RED), ((3, -3), RED))
    assert two_days(before, after) == {0: (-3, -3), 1: (3, -3)}


def test_a_chair_of_another_color_is_not_the_one_that_is_gone() -> None:
    assert two_days([((-3, 0), RED)], [((3, 0), GREEN)]) == {}
    assert two_days([((-3, 0), WHITE)], [((3, 0), BLACK)]) == {}


def test_a_chair_that_was_moved_is_the_same_in_the_light_of_another_day() -> None:
    assert two_days([((-3, 0), WHITE)], [((3, 0), WHITE)], WARM_AND_DARK) == {0: (3, 0)}


@pytest.mark.parametrize(("color", "places"), [(RED, {0: (-2.3, 0)}), (GREEN, {})])
def test_what_stands_in_a_part_of_an_empty_place_is_another_one_if_its_color_is(
    color: Rgb, places: dict[int, tuple[float, float]]
) -> None:
    assert two_days([((-3, 0), RED)], [((-2.3, 0), color)]) == places


@pytest.mark.parametrize(
    ("sides", "is_same"), [((RED, BLACK, RED), True), ((RED, RED, RED), False)]
)
def test_a_bench_has_the_colors_of_its_seat_and_of_its_legs(
    sides: Sequence[Rgb], is_same: bool
) -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        look(evidence, (((-3, 0), sides[second % 3]), *FIXED), second, (1, 1, 1))
    for second in range(40):
        look(evidence, (((3, 0), BLACK), *FIXED), DAY + second, (1, 1, 1))
    centers = {item.id: item.footprint.centroid for item in evidence.objects()}
    (number,) = (n for n, center in centers.items() if abs(center.x - 3) < 0.1 > abs(center.y))
    assert (number == 0) == is_same


@pytest.mark.parametrize(
    ("views", "is_same"), [((RED, None, None), True), ((RED, RED, None), False)]
)
def test_what_one_view_shows_of_a_chair_of_several_colors_is_not_its_color(
    views: Sequence[Rgb | None], is_same: bool
) -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        look(evidence, (((-3, 0), GREEN), *FIXED), second, (1, 1, 1))
    for second in range(40):
        look(evidence, (((3, 0), views[second % 3]), *FIXED), DAY + second, (1, 1, 1))
    centers = {item.id: item.footprint.centroid for item in evidence.objects()}
    (number,) = (n for n, center in centers.items() if abs(center.x - 3) < 0.1 > abs(center.y))
    assert (number == 0) == is_same


@pytest.mark.parametrize(("color", "is_same"), [(WHITE, True), (BLACK, True), (RED, False)])
def test_a_board_has_the_color_of_any_side_that_an_earlier_day_showed(
    color: Rgb, is_same: bool
) -> None:
    evidence = EvidenceMap(DEFAULT)
    for day, side in enumerate((WHITE, BLACK)):
        for second in range(4):
            look(evidence, (((-3, 0), side), *FIXED), day * DAY + second, (1, 1, 1))
    for second in range(80):
        look(evidence, (((3, 0), color), *FIXED), 2 * DAY + second, (1, 1, 1))
    centers = {item.id: item.footprint.centroid for item in evidence.objects()}
    (number,) = (n for n, center in centers.items() if abs(center.x - 3) < 0.1 > abs(center.y))
    assert (number == 0) == is_same


@pytest.mark.parametrize(("name", "is_same"), [("board", True), ("chair", False)])
def test_a_board_may_show_another_side_but_not_a_chair_beside_others_that_keep_their_colors(
    name: str, is_same: bool
) -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        look(evidence, (((-3, 0), WHITE), *FIXED), second, (1, 1, 1), name)
    for second in range(40):
        look(evidence, (((-3, -2), BLACK), *FIXED), DAY + second, (1, 1, 1), name)
    (there,) = (one for one in evidence.objects() if one.footprint.centroid.y < -1)
    assert (there.id == 0) == is_same


@pytest.mark.parametrize("shade", [0.7, 1.3])
def test_a_chair_may_stand_in_the_shade_or_in_the_light(shade: float) -> None:
    r, g, b = (int(shade * channel) for channel in RED)
    assert two_days([((-3, 0), RED)], [((3, 0), (r, g, b))]) == {0: (3, 0)}


def test_colors_say_nothing_where_the_light_of_both_days_is_not_known() -> None:
    assert two_days([((-3, 0), RED)], [((3, 0), GREEN)], fixed=FIXED[:2]) == {0: (3, 0)}


def test_an_older_color_does_not_decide_where_the_light_of_the_newest_is_not_known() -> None:
    evidence = EvidenceMap(DEFAULT)
    days = (((-3, 0), RED), *FIXED), (((-3, 0), GREEN),), (((3, 0), GREEN), *FIXED)
    for day, chairs in enumerate(days):
        for second in range(80 if day == 2 else 4):
            look(evidence, chairs, day * DAY + second, (1, 1, 1))
    centers = {item.id: item.footprint.centroid for item in evidence.objects()}
    assert centers[0].x == pytest.approx(3, abs=0.1)


colors = st.tuples(*3 * [st.integers(0, 255)])


@given(st.lists(st.none() | colors, max_size=5))
def test_a_logged_frame_keeps_the_colors_of_its_objects(kept: list[Rgb | None]) -> None:
    objects = tuple(
        ObservedObject("cup", 0.5, square(float(i)), color=color) for i, color in enumerate(kept)
    )
    logged = LoggedFrame(Observation(1.0, np.eye(4), objects, ROOM), None)
    (found,) = moved_frames([packed_frame(logged)], [np.eye(4)], 0.05, "x.hmap")
    assert [one.color for one in found.observation.objects] == kept


@given(st.lists(st.lists(st.tuples(st.floats(0, 1e9), st.none() | colors), max_size=4), max_size=3))
def test_a_table_of_tracks_keeps_their_colors(kept: list[list[tuple[float, Rgb | None]]]) -> None:
    evidence = EvidenceMap(DEFAULT)
    look(evidence, [((3.0 * i, 0), RED) for i in range(len(kept))], 0, (1, 1, 1))
    tracks = evidence.tracks()
    expected = [tuple(SeenColor(*one) for one in some) for some in kept]
    for track, some in zip(tracks.objects, expected, strict=True):
        track.buffer.colors = some
    for table in (
        unpacked_tables(packed_tables(tracks), DEFAULT)[0],
        unpacked_tables(packed_tables(EvidenceMap(DEFAULT).tracks(), [tracks]), DEFAULT)[1],
    ):
        assert [track.buffer.colors for track in table.objects] == expected


@pytest.fixture(scope="module")
def packed() -> PackedTables:
    evidence = EvidenceMap(DEFAULT)
    look(evidence, FIXED, 0, (1, 1, 1))
    return packed_tables(evidence.tracks())


def test_files_of_earlier_versions_have_no_colors(packed: PackedTables) -> None:
    older = {name: array for name, array in packed.arrays.items() if "color" not in name}
    (table,) = unpacked_tables(dataclasses.replace(packed, arrays=older), DEFAULT)
    assert [track.buffer.colors for track in table.objects] == [(), (), ()]
    assert set(packed_tables(table).arrays) == set(older)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("colors", np.array([1, 1], np.int64)),
        ("colors", np.array([1, 3, -1], np.int64)),
        ("color_values", np.zeros((2, 3), np.float16)),
        ("color_values", np.full((3, 3), -1, np.int64)),
        ("color_values", np.full((3, 3), 0.5)),
        ("color_values", np.zeros((3, 2), np.uint8)),
        ("color_stamps", np.array([0, np.nan, 0])),
    ],
)
def test_damaged_colors_are_one_error(
    packed: PackedTables, name: str, wrong: np.ndarray[tuple[int, ...], np.dtype[np.generic]]
) -> None:
    damaged = {**packed.arrays, f"track.{name}": wrong}
    with pytest.raises(ValueError):
        unpacked_tables(dataclasses.replace(packed, arrays=damaged), DEFAULT)


def test_a_logged_frame_with_a_color_too_many_is_damaged() -> None:
    objects = (ObservedObject("cup", 0.5, square(0), color=RED),)
    logged = LoggedFrame(Observation(1.0, np.eye(4), objects, ROOM), None)
    object.__setattr__(objects[0], "color", (300, 0, 0))
    with pytest.raises(FormatError, match="colors"):
        moved_frames([packed_frame(logged)], [np.eye(4)], 0.05, "x.hmap")


def test_tracks_that_are_merged_into_another_map_keep_their_colors() -> None:
    evidence = EvidenceMap(DEFAULT)
    look(evidence, FIXED, 0, (1, 1, 1))
    moved = moved_tracks(evidence.tracks(), Pose2D(1, 2, 0.3), DEFAULT)
    assert [track.buffer.colors for track in moved.objects] == [
        (SeenColor(0, color),) for _, color in FIXED
    ]


def test_a_median_color_ignores_what_is_at_the_border_of_an_object() -> None:
    image = np.full((30, 40, 3), RED, np.uint8)
    image[:, :10] = WHITE
    pixels = some_of(np.arange(30 * 40))
    assert len(pixels) <= 256
    assert median_color(image, pixels) == RED


def test_an_object_of_two_colors_has_none() -> None:
    image = np.full((30, 40, 3), RED, np.uint8)
    image[:, :15] = GREEN
    assert median_color(image, some_of(np.arange(30 * 40))) is None


def test_a_shaded_object_has_one_color() -> None:
    image = np.full((30, 40, 3), RED, np.uint8)
    image[:, :19] //= 2
    assert median_color(image, some_of(np.arange(30 * 40))) == RED


class Shots:
    """Frames of a box whose color image counts how often it is decoded."""

    def __init__(self) -> None:
        self.decoded = 0

    def frames(self, count: int, is_damaged: bool = False) -> list[RgbdFrame]:
        def decoded() -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
            self.decoded += 1
            if is_damaged:
                raise HypermapError("no picture")
            return np.full((120, 160, 3), RED, np.uint8)

        shots = [frame(i, x=0.06 * i - 0.25) for i in range(count)]
        return [dataclasses.replace(shot, color=decoded) for shot in shots]


def mapped(name: str, shots: Sequence[RgbdFrame]) -> Mapper:
    config = profile(name)
    pictures = dataclasses.replace(config.pictures, enabled=False)
    mapper = Mapper(dataclasses.replace(config, pictures=pictures), boxes)
    for shot in shots:
        assert mapper.add(shot) is not None
    return mapper


@pytest.mark.parametrize(
    ("name", "is_damaged", "decoded", "kept"),
    [("default", False, 3, [RED] * 3), ("default", True, 8, []), ("thesis", False, 0, [])],
)
def test_colors_are_decoded_until_each_object_has_a_few(
    name: str, is_damaged: bool, decoded: int, kept: list[Rgb]
) -> None:
    shots = Shots()
    mapper = mapped(name, shots.frames(8, is_damaged))
    (track,) = mapper.evidence.tracks().objects
    assert shots.decoded == decoded
    assert [color.rgb for color in track.buffer.colors] == kept


def test_a_corrected_map_has_the_colors_of_its_frames() -> None:
    mapper = mapped("default", Shots().frames(8))
    stamps, poses = mapper.logged_poses()
    poses[:, 0, 3] += 0.5
    before = mapper.evidence.tracks().objects
    mapper.correct(trajectory_of(stamps, poses))
    after = mapper.evidence.tracks().objects
    assert [track.buffer.colors for track in after] == [track.buffer.colors for track in before]
