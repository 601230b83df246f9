"""What windows hear of a map, as server-sent events."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable

from hypermap.viewer.live.document import MapDocument

_LISTEN, _STILL_THERE = 0.15, 15.0  # seconds


async def news_of(
    document: MapDocument, version: int, is_closing: Callable[[], bool]
) -> AsyncIterator[str]:
    """Yield how the editing stands, now and whenever something has happened.

    Args:
        document: the map.
        version: which the window has seen; layers that have changed since are named.
        is_closing: says when to end.
    """
    loop = asyncio.get_running_loop()
    beat, saves, told = -1, document.saves, loop.time()
    while not is_closing():
        if beat != document.beat:
            beat, snapshot = document.beat, document.snapshot
            news = document.status()
            since = snapshot.since
            news["layers"] = sorted(name for name in since if since[name] > version)
            if saves != document.saves:
                saves, news["saved"] = document.saves, True
            version, told = snapshot.version, loop.time()
            yield f"id: {version}\ndata: {json.dumps(news)}\n\n"
        elif loop.time() - told > _STILL_THERE:
            told = loop.time()
            yield ": still there\n\n"
        await asyncio.sleep(_LISTEN)
