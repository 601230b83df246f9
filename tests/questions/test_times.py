"""Times in questions, worked out with a calendar."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import HypermapError
from hypermap.questions.times import are_calendar, find_times, parse_moment

NOW = datetime(2026, 11, 23, 14, 30, tzinfo=timezone(timedelta(hours=1)))  # a Monday


@pytest.mark.parametrize(
    ("text", "since", "until"),
    [
        ("today", "2026-11-23T00:00", None),
        ("yesterday", "2026-11-22T00:00", "2026-11-23T00:00"),
        ("the day before yesterday", "2026-11-21T00:00", "2026-11-22T00:00"),
        ("this morning", "2026-11-23T00:00", "2026-11-23T12:00"),
        ("this week", "2026-11-23T00:00", None),
        ("last week", "2026-11-16T00:00", "2026-11-23T00:00"),
        ("on Friday", "2026-11-20T00:00", "2026-11-21T00:00"),
        ("on 2026-02-28", "2026-02-28T00:00", "2026-03-01T00:00"),
        ("since Monday", "2026-11-23T00:00", None),
        ("since last Monday", "2026-11-16T00:00", None),
        ("since Tuesday", "2026-11-17T00:00", None),
        ("SINCE YESTERDAY AT 3 PM", "2026-11-22T15:00", None),
        ("since friday 10:05", "2026-11-20T10:05", None),
        ("since 2026-11-20T10:00", "2026-11-20T10:00", None),
        ("since 2026-11-20T10:00:00", "2026-11-20T10:00", None),
        ("since 12 am", "2026-11-23T00:00", None),
        ("since 12:30 pm", "2026-11-23T12:30", None),
        ("since midnight", "2026-11-23T00:00", None),
        ("since an hour ago", "2026-11-23T13:30", None),
        ("before 2 days ago", None, "2026-11-21T14:30"),
        ("until noon", None, "2026-11-23T12:00"),
        ("in the last hour", "2026-11-23T13:30", None),
        ("during the past ten minutes", "2026-11-23T14:20", None),
        ("for two weeks", "2026-11-09T14:30", None),
        ("for more than 7 days", "2026-11-16T14:30", None),
    ],
)
def test_what_a_time_means(text: str, since: str | None, until: str | None) -> None:
    for question in (text, f"what did you see {text}?"):
        ((start, end, span),) = find_times(question, NOW)
        assert question[start:end] == span.text == text
        assert span.since == (since and datetime.fromisoformat(f"{since}:00+01:00"))
        assert span.until == (until and datetime.fromisoformat(f"{until}:00+01:00"))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "2 hours ago",  # which minute is that?
        "since 2026-02-30",
        "since 25:00",
        "since 13 pm",
        "since christmas",
        'the "today" sign',
        "the mondayish chair",
        "for 2 chairs",
        "for 99999 days",
    ],
)
def test_what_is_no_time(text: str) -> None:
    assert find_times(text, NOW) == []


@pytest.mark.parametrize(
    "text",
    [
        "2026-11-20T10:00:30+01:00",  # as `hypermap history` prints it
        "2026-11-20T09:00:30.000Z",
        "2026-11-20 09:00:30 UTC",
        "2026-11-20T10:00:30",
    ],
)
def test_a_time_may_have_seconds_and_a_zone(text: str) -> None:
    moment = parse_moment(text, "--since", NOW)
    assert moment == datetime(2026, 11, 20, 10, 0, 30, tzinfo=NOW.tzinfo)


@pytest.mark.parametrize("text", ["2026-11-20T10:00:00.5", "2026-11-20 10:00:00,500000000"])
def test_a_fraction_of_a_second_needs_no_zone(text: str) -> None:
    moment = parse_moment(text, "--as-of", NOW)
    assert moment == datetime(2026, 11, 20, 10, 0, 0, 500_000, tzinfo=NOW.tzinfo)
    assert parse_moment(text, "--as-of") == datetime(2026, 11, 20, 10, 0, 0, 500_000).astimezone()


def test_the_last_day_of_the_calendar_is_no_time() -> None:
    with pytest.raises(HypermapError, match="--at '9999-12-31': expected a time"):
        parse_moment("9999-12-31", "--at")


def test_a_day_with_a_zone_that_does_not_exist_is_an_error() -> None:
    with pytest.raises(HypermapError, match="--since '2026-02-30T10:00Z': expected a time"):
        parse_moment("2026-02-30T10:00Z", "--since", NOW)


def test_a_day_in_which_clocks_change_has_23_hours() -> None:
    try:
        berlin = ZoneInfo("Europe/Berlin")
    except ZoneInfoNotFoundError:
        pytest.skip("this computer knows no time zones (tzdata)")
    now = datetime(2026, 3, 30, 12, tzinfo=berlin)
    ((_, _, span),) = find_times("yesterday", now)
    assert span.since is not None
    assert span.until is not None
    assert span.until.timestamp() - span.since.timestamp() == 23 * 3600


@given(st.text(max_size=200), st.datetimes(datetime(1980, 1, 1), datetime(2100, 1, 1)))
def test_any_text_can_be_looked_at(text: str, moment: datetime) -> None:
    now = moment.replace(tzinfo=timezone.utc)
    for start, end, span in find_times(text, now):
        assert text[start:end] == span.text
        assert span.since is not None or span.until is not None


def test_stamps_of_a_calendar_are_distinguished_from_those_of_a_recording() -> None:
    assert are_calendar([None, 12.5, 1.7e9])
    assert not are_calendar([0.0, 1e6, None])
    assert not are_calendar([])
