"""Times that other programs write are read alike by all versions of Python."""

from datetime import datetime, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.iso_times import time_from_iso

ZONES = st.timedeltas(timedelta(hours=-23), timedelta(hours=23)).map(
    lambda offset: timezone(timedelta(minutes=offset // timedelta(minutes=1)))
)


@given(st.datetimes(timezones=st.none() | ZONES), st.sampled_from("T "))
def test_a_time_is_read_as_it_was_written(moment: datetime, separator: str) -> None:
    assert time_from_iso(moment.isoformat(separator)) == moment


@pytest.mark.parametrize(
    "text",
    [
        "2026-11-20T09:00:00.25Z",
        "2026-11-20t09:00:00.250000z",
        "2026-11-20 10:00:00,250+0100",
        "2026-11-20T10:00:00.250000000+01",
        "2026-11-20T09:00:00.25 Z",
    ],
)
def test_forms_of_other_programs_name_the_same_time(text: str) -> None:
    expected = datetime(2026, 11, 20, 9, microsecond=250_000, tzinfo=timezone.utc)

    assert time_from_iso(text) == expected


@pytest.mark.parametrize("text", ["", "now", "2026-13-01", "2026-11-20T25:00Z", "10:00", "1e3"])
def test_what_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(ValueError):
        time_from_iso(text)
