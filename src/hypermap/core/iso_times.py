"""Times as ISO 8601 and RFC 3339 write them."""

from __future__ import annotations

import re
from datetime import datetime

_TIME = re.compile(
    r"(.*?\d\d:\d\d(?::\d\d)?)(?:[.,](\d+))?(?: ?([Zz])|([+-]\d\d)(?::?(\d\d))?)?", re.ASCII
)


def time_from_iso(text: str) -> datetime:
    """Return the time that a text names, without a zone if the text has none.

    What other programs write is read by all versions of Python alike: `Z` and zones without colon,
    and any number of digits of a second, of which those below a microsecond are dropped.

    Raises:
        ValueError: If it is no time.

    >>> time_from_iso("2026-11-20T10:00:00.5Z").isoformat()
    '2026-11-20T10:00:00.500000+00:00'
    >>> time_from_iso(" 2026-11-20 10:00:00,123456789+0100").isoformat()
    '2026-11-20T10:00:00.123456+01:00'
    >>> time_from_iso("2026-11-20").isoformat()
    '2026-11-20T00:00:00'
    """
    text = text.strip()
    if found := _TIME.fullmatch(text):
        begin, fraction, utc, hours, minutes = found.groups()
        text = begin
        if fraction:
            text += f".{fraction[:6]:0<6}"
        if utc:
            text += "+00:00"
        elif hours:
            text += f"{hours}:{minutes or '00'}"
    return datetime.fromisoformat(text)
