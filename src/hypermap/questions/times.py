"""Times in questions: "since Monday", "yesterday", "in the last 2 hours"."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta

from hypermap.core.errors import HypermapError
from hypermap.core.iso_times import time_from_iso

_DAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
_UNITS = {"minute": 60, "min": 60, "hour": 3600, "day": 86400, "week": 604800}
_SHORT = {"h": "hour", "d": "day", "w": "week"}
_NUMBERS = "an?|one|two|three|four|five|six|seven|eight|nine|ten|twelve"
_COUNT = {"a": 1, "an": 1, "twelve": 12} | {
    word: number for number, word in enumerate(_NUMBERS.split("|")[1:-1], 1)
}
_SPAN = rf"(?P<number>\d{{1,4}}|{_NUMBERS}) (?P<unit>{'|'.join(_UNITS)})s?"
_DAY = (
    r"the day before yesterday|yesterday|today|this morning|this week|last week"
    rf"|(?:on |last )?(?:{'|'.join(_DAYS)})|(?:on )?\d{{4}}-\d\d-\d\d"
)
_CLOCK = r"\d{1,2}:\d\d(?::\d\d)?(?: ?[ap]m)?|\d{1,2} ?[ap]m|noon|midnight"
_MOMENT = (
    rf"(?P<day>{_DAY})(?:[ t]+(?:at )?(?P<day_clock>{_CLOCK}))?|(?P<clock>{_CLOCK})|{_SPAN} ago"
)
_TIME = re.compile(
    rf"\b(?:(?P<how>since|after|before|until) (?:{_MOMENT})"
    rf"|(?:(?:in|within|during|over|for) )?the (?:last|past) (?:{_SPAN.replace('?P<', '?P<past_')}"
    r"|(?P<past_one>minute|hour|day|week))"
    rf"|for (?:(?:more than|at least|over) )?{_SPAN.replace('?P<', '?P<for_')}"
    rf"|(?P<bare>{_DAY}))(?![\w:-])",
    re.IGNORECASE,
)


_ISO = re.compile(
    r"(\d{4}-\d\d-\d\d[ T]\d\d:\d\d(?::\d\d(?:[.,]\d+)?)?)(?: ?(Z|UTC)|([+-]\d\d:?\d\d))?"
)

_AS_OF = re.compile(rf",?\s*\bas of (?:{_MOMENT})(?![\w:-])\s*,?", re.IGNORECASE)


@dataclass(frozen=True)
class Span:
    """A time that a question names.

    Attributes:
        text: as it stands in the question.
        since: when it begins, with its time zone; None for no beginning.
        until: when it ends; None for now.
    """

    text: str
    since: datetime | None = None
    until: datetime | None = None


def find_times(text: str, now: datetime | None = None) -> list[tuple[int, int, Span]]:
    """Return the times in a text, each with the places of its first and after its last character.

    A weekday is the last day of that name, which may be today; "last Monday" is not today.

    Args:
        text: a question; what is in quotation marks is not looked at.
        now: the time, with its zone; None for the present, in the zone of this computer.

    >>> from datetime import timezone
    >>> [(_, _, span)] = find_times(
    ...     "what is new since Friday?", datetime(2026, 11, 23, 12, tzinfo=timezone.utc)
    ... )
    >>> span.text, span.since.isoformat()
    ('since Friday', '2026-11-20T00:00:00+00:00')
    """
    clock = _Clock.at(now)
    spans = [(*found.span(), clock.span_of(found)) for found in _unquoted(_TIME, text)]
    return [(start, end, span) for start, end, span in spans if span is not None]


def without_as_of(text: str, now: datetime | None = None) -> tuple[str, datetime | None]:
    """Return a question without words such as "as of Monday", and the time; None without such.

    A day stands for its begin, as it does for `hypermap query --as-of`.

    Args:
        text: a question; what is in quotation marks is not looked at.
        now: as for `find_times`.

    >>> from datetime import timezone
    >>> noon = datetime(2026, 11, 23, 12, tzinfo=timezone.utc)
    >>> question, moment = without_as_of("as of Friday at 3 pm, where is the cup?", noon)
    >>> question, moment.isoformat()
    (' where is the cup?', '2026-11-20T15:00:00+00:00')
    """
    found = next(_unquoted(_AS_OF, text), None)
    moment = None if found is None else _Clock.at(now).moment_of(found)
    if found is None or moment is None:
        return text, None
    return f"{text[: found.start()]} {text[found.end() :]}", moment


def _unquoted(pattern: re.Pattern[str], text: str) -> Iterator[re.Match[str]]:
    """Yield where a pattern is in a text, outside of quotation marks."""
    quoted = [found.span() for found in re.finditer(r'"[^"]*"', text)]
    for found in pattern.finditer(text):
        start, end = found.span()
        if not any(first < end and start < last for first, last in quoted):
            yield found


def parse_moment(text: str, option: str, now: datetime | None = None) -> datetime:
    """Return the time that a text names: "yesterday", "2026-11-20T10:00", "2 hours ago", "7d".

    Args:
        text: a day, a time of day, both, also with a zone as in ISO 8601, or a span before now.
        option: what the text was given for, in messages.
        now: as for `find_times`.

    Raises:
        HypermapError: If it is no such time.

    >>> from datetime import timezone
    >>> parse_moment("36h", "--since", datetime(2026, 11, 23, 12, tzinfo=timezone.utc)).isoformat()
    '2026-11-22T00:00:00+00:00'
    """
    words = text.strip()
    if iso := _ISO.fullmatch(words):
        with contextlib.suppress(ValueError):  # as 2026-13-01 or 25:00
            moment = time_from_iso(f"{iso[1]}{'Z' if iso[2] else iso[3] or ''}")
            return moment if moment.tzinfo else _Clock.at(now).here(moment)
    short = re.fullmatch(r"(\d{1,4}) ?([a-z]+)", words.lower())
    if short and (unit := _SHORT.get(short[2]) or short[2].rstrip("s")) in _UNITS:
        words = f"{short[1]} {unit}s ago"
    times = find_times(f"since {words}", now)
    if len(times) == 1 and times[0][:2] == (0, len("since ") + len(words)):
        since = times[0][2].since
        if since is not None:
            return since
    raise HypermapError(
        f"{option} {text!r}: expected a time, such as yesterday, monday, 2026-11-20, "
        "2026-11-20T10:00, 10:30, '2 hours ago' or 7d"
    )


def parse_later(text: str, option: str, now: datetime | None = None) -> datetime:
    """Return a time as `parse_moment` does, but spans count from now on: "2h", "in 30 minutes".

    Raises:
        HypermapError: If it is no such time.

    >>> from datetime import timezone
    >>> parse_later("in 2 hours", "--at", datetime(2026, 11, 23, 12, tzinfo=timezone.utc)).hour
    14
    """
    begin = datetime.now().astimezone() if now is None else now
    words = re.sub(r"^in +(.*)", r"\1 ago", text.strip(), flags=re.IGNORECASE)
    moment = parse_moment(words, option, begin)
    is_span = words != text.strip() or re.fullmatch(r"\d{1,4} ?[a-z]+", text.strip().lower())
    return begin + (begin - moment) if is_span else moment


class _Clock:
    """What times mean, seen from now."""

    def __init__(self, now: datetime, is_here: bool) -> None:
        self._now, self._is_here = now, is_here

    @classmethod
    def at(cls, now: datetime | None) -> _Clock:
        """Return the clock at a time; None for the present, in the zone of this computer."""
        return cls(datetime.now().astimezone() if now is None else now, is_here=now is None)

    def moment_of(self, found: re.Match[str]) -> datetime | None:
        """Return the moment that was found; None if there is no such time."""
        try:
            return self._moment(_lowered(found))
        except (ValueError, OverflowError):  # as 2026-13-01, 25:00 or 9999-12-31
            return None

    def span_of(self, found: re.Match[str]) -> Span | None:
        """Return what was found; None if there is no such time."""
        text, parts = found[0], _lowered(found)
        if parts["past_one"]:
            return Span(text, self._before("1", parts["past_one"]))
        for kind in ("past_", "for_"):
            if parts[f"{kind}unit"]:
                return Span(text, self._before(parts[f"{kind}number"], parts[f"{kind}unit"]))
        try:
            if parts["bare"]:
                return Span(text, *self._day(parts["bare"]))
            moment = self._moment(parts)
        except (ValueError, OverflowError):  # as 2026-13-01, 25:00 or 9999-12-31
            return None
        if parts["how"] in ("before", "until"):
            return Span(text, until=moment)
        return Span(text, moment)

    def _moment(self, parts: dict[str, str]) -> datetime:
        if parts["unit"]:
            return self._before(parts["number"], parts["unit"])
        if not parts["day"]:
            return self._at(self._now.date(), _clock_of(parts["clock"]))
        begin, _ = self._day(parts["day"])
        clock = parts["day_clock"]
        return self._at(begin.date(), _clock_of(clock)) if clock else begin

    def _before(self, number: str, unit: str) -> datetime:
        count = int(number) if number.isdigit() else _COUNT[number]
        return self._now - timedelta(seconds=count * _UNITS[unit])

    def _day(self, text: str) -> tuple[datetime, datetime | None]:
        """Return when a day, or what is called like one, begins and ends; None for now."""
        today = self._now.date()
        words = text.removeprefix("on ").split()
        monday = today - timedelta(days=today.weekday())
        if words[-1] == "week":
            if words[0] == "this":
                return self._at(monday), None
            return self._at(monday - timedelta(days=7)), self._at(monday)
        if words[-1] == "morning":
            return self._at(today), self._at(today, time(12))
        if words[-1] == "today":
            return self._at(today), None
        if words[-1] == "yesterday":
            day = today - timedelta(days=2 if len(words) > 1 else 1)
        elif words[-1] in _DAYS:
            back = (today.weekday() - _DAYS.index(words[-1])) % 7
            day = today - timedelta(days=back or (7 if words[0] == "last" else 0))
        else:
            day = date.fromisoformat(words[-1])
        return self._at(day), self._at(day + timedelta(days=1))

    def _at(self, day: date, clock: time = time(0)) -> datetime:
        return self.here(datetime.combine(day, clock))

    def here(self, local: datetime) -> datetime:
        """Return a time without a zone with that of this clock."""
        # Of here, summer and winter time are known.
        return local.astimezone() if self._is_here else local.replace(tzinfo=self._now.tzinfo)


def _lowered(found: re.Match[str]) -> dict[str, str]:
    return {key: (value or "").lower() for key, value in found.groupdict().items()}


def _clock_of(text: str) -> time:
    if text in ("noon", "midnight"):
        return time(12 if text == "noon" else 0)
    hour, minute, second = (int(number) for number in [*re.findall(r"\d+", text), "0", "0"][:3])
    if text.endswith("m"):
        if not 1 <= hour <= 12:
            raise ValueError(text)
        hour = hour % 12 + (12 if text.endswith("pm") else 0)
    return time(hour, minute, second)


def are_calendar(stamps: Iterable[float | None]) -> bool:
    """Return whether any of some stamps [s] counts from 1970, not from the start of a recording."""
    return any(stamp is not None and _CALENDAR[0] <= stamp <= _CALENDAR[1] for stamp in stamps)


def time_of(stamp: float, *, short: bool = False) -> str:
    """Return a stamp [s] as people write it; where it counts from the start of a clock, so."""
    if are_calendar([stamp]):
        return minute_of(datetime.fromtimestamp(stamp).astimezone())
    return f"{stamp:.1f} s" + ("" if short else " of the recording's clock")


def minute_of(moment: datetime) -> str:
    """Return a time to the minute, with its zone."""
    return moment.strftime("%Y-%m-%d %H:%M %Z").strip()


_CALENDAR = (3e8, 2.5e11)  # [s]: from 1979, as the clocks of simulators and robots begin at 0
