from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.ros.mapper.synchronizer import Settled, Synchronizer

MS = 1_000_000
PERIOD = 100  # ms


def feed(synchronizer: Synchronizer, messages: list[tuple[str, int]]) -> list[Settled]:
    """Add (stream, stamp in ms); each item is its own stamp."""
    return [synchronizer.add(stream, at * MS, at) for stream, at in messages]


def matched(results: list[Settled]) -> list[tuple[int, ...]]:
    """Return (reference, partners ...) in ms, in the order in which they were given."""
    return [tuple(match.items.values()) for result in results for match in result.matches]


def lost(results: list[Settled]) -> list[str]:
    return [stream for result in results for stream in result.lost]


def test_without_other_streams_every_message_is_a_match() -> None:
    assert matched(feed(Synchronizer((), 0.02, 1), [("", 1), ("", 2)])) == [(1,), (2,)]


@pytest.mark.parametrize("first", ["", "color"])
def test_equal_stamps_match_at_once_whatever_comes_first(first: str) -> None:
    second = {"": "color", "color": ""}[first]
    results = feed(Synchronizer(("color",), 0.02, 1), [(first, 100), (second, 100)])
    assert [len(result.matches) for result in results] == [0, 1]


def test_the_nearer_of_two_messages_is_taken_though_it_comes_later() -> None:
    messages = [("color", 982), ("", 1000), ("color", 1015), ("", 1033), ("color", 1048)]
    assert matched(feed(Synchronizer(("color",), 0.02, 1), messages))[0] == (1000, 1015)


def test_a_message_goes_to_the_nearer_of_two_references() -> None:
    messages = [("", 1000), ("", 1033), ("color", 1020), ("", 1066), ("color", 1090)]
    assert matched(feed(Synchronizer(("color",), 0.05, 1), messages)) == [(1033, 1020)]


def test_no_wait_for_a_nearer_message_once_the_period_is_known() -> None:
    """Color precedes depth by 10 ms in each period of 100 ms: no color of 90 ms later is nearer."""
    synchronizer = Synchronizer(("color",), 0.02, 1)
    feed(synchronizer, [("color", 90), ("", 100), ("color", 190), ("", 200)])
    assert matched(feed(synchronizer, [("color", 290), ("", 300)])) == [(300, 290)]


def test_what_lacks_a_partner_is_lost_as_soon_as_the_stream_has_gone_past() -> None:
    results = feed(Synchronizer(("color",), 0.02, 5), [("", 100), ("", 200), ("color", 200)])
    assert lost(results[:2]) == []
    assert (lost(results), matched(results)) == (["color"], [(200, 200)])


def test_a_silent_stream_is_waited_for_no_longer_than_patience() -> None:
    results = feed(Synchronizer(("detections",), 0.02, 1), [("", 100), ("", 1000), ("", 1200)])
    assert [lost([result]) for result in results] == [[], [], ["detections"]]


def test_late_detections_find_their_image() -> None:
    messages = [("", 100), ("", 200), ("", 300), ("", 400), ("detections", 200)]
    results = feed(Synchronizer(("detections",), 0.02, 1), messages)
    assert (matched(results), lost(results)) == ([(200, 200)], ["detections"])


def test_a_jump_back_forgets_what_waits_and_starts_anew() -> None:
    synchronizer = Synchronizer(("color",), 0.02, 1)
    feed(synchronizer, [("", 5000), ("color", 4900), ("", 5100)])
    result = synchronizer.add("color", 1000 * MS, 1000)
    assert (result.has_jumped, result.forgotten, len(synchronizer)) == (True, 2, 1)
    assert matched(feed(synchronizer, [("", 1000)])) == [(1000, 1000)]


def test_what_comes_too_late_is_lost() -> None:
    results = feed(Synchronizer((), 0.02, 1), [("", 200), ("", 100), ("", 200)])
    assert (matched(results), lost(results)) == ([(200,)], ["", ""])


def test_a_repeated_stamp_is_left_out() -> None:
    results = feed(Synchronizer(("color",), 0.02, 1), [("", 100), ("", 100), ("color", 100)])
    assert matched(results) == [(100, 100)]


@st.composite
def drives(draw: st.DrawFn) -> tuple[list[tuple[str, int]], set[tuple[int, int, int]]]:
    """Frames of three streams with small offsets; streams arrive in order, but at other times."""
    count = draw(st.integers(1, 30))
    offsets = {
        name: draw(st.lists(st.integers(-18, 18), min_size=count, max_size=count))
        for name in ("color", "detections")
    }
    delays = {"": 0, "color": draw(st.integers(0, 400)), "detections": draw(st.integers(0, 400))}
    arrivals = []
    for i in range(count):
        at = 10_000 + i * PERIOD
        for name, delay in delays.items():
            stamp = at + (offsets[name][i] if name else 0)
            arrivals.append((at + delay, name, stamp))
    arrivals.sort()
    truth = {
        (at, at + offsets["color"][i], at + offsets["detections"][i])
        for i, at in enumerate(range(10_000, 10_000 + count * PERIOD, PERIOD))
    }
    return [(name, stamp) for _, name, stamp in arrivals], truth


@given(drives())
def test_regular_streams_are_matched_frame_by_frame(
    drive: tuple[list[tuple[str, int]], set[tuple[int, int, int]]],
) -> None:
    messages, truth = drive
    synchronizer = Synchronizer(("color", "detections"), 0.02, 2)
    results = feed(synchronizer, messages)
    pairs = matched(results)
    assert set(pairs) <= truth
    assert lost(results) == []
    # Only frames at the end may still wait, for a message that would show what is nearest.
    assert len(truth) - len(pairs) <= 5


@given(
    st.lists(
        st.tuples(st.sampled_from(["", "color", "detections"]), st.integers(0, 60)), max_size=200
    )
)
def test_whatever_comes_nothing_is_used_twice_or_out_of_reach(
    messages: list[tuple[str, int]],
) -> None:
    synchronizer = Synchronizer(("color", "detections"), 0.03, 0.5)
    results = feed(synchronizer, [(stream, 25 * number) for stream, number in messages])
    pairs = matched(results)
    assert all(abs(partner - row[0]) <= 30 for row in pairs for partner in row)
    forgotten = sum(result.forgotten for result in results)
    references = sum(stream == "" for stream, _ in messages)
    assert len(pairs) + len(lost(results)) + forgotten <= references
    # Between two jumps of the clock a message is used once.
    epoch: list[tuple[int, ...]] = []
    for result in results:
        epoch = [] if result.has_jumped else epoch
        epoch += [tuple(match.items.values()) for match in result.matches]
        for column in zip(*epoch, strict=True):
            assert sorted(set(column)) == list(column)


def test_memory_is_bounded() -> None:
    synchronizer = Synchronizer(("color",), 0.0, 60)
    for i in range(1000):
        synchronizer.add("", 2 * i * MS, None)
        synchronizer.add("color", (2 * i + 1) * MS, None)  # never at the same time
    assert len(synchronizer) <= 400
