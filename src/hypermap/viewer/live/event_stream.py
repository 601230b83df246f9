"""The event stream: server-sent events that keep windows up to date."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable

from hypermap.viewer.live.shown_map import ShownMap

_POLL, _KEEP_ALIVE = 0.15, 15.0  # seconds


async def event_stream(
    document: ShownMap, version: int, is_closing: Callable[[], bool]
) -> AsyncIterator[str]:
    """Yield the state of editing, now and after every event.

    Args:
        document: the map.
        version: the version that the window has seen; layers that changed later are listed.
        is_closing: returns true when to end.
    """
    loop = asyncio.get_running_loop()
    event_count, saves, last_sent = -1, document.saves, loop.time()
    while not is_closing():
        if event_count != document.event_count:
            event_count, current = document.event_count, document.current
            event = document.status()
            changed_in = current.changed_in
            event["layers"] = sorted(name for name in changed_in if changed_in[name] > version)
            if saves != document.saves:
                saves, event["saved"] = document.saves, True
            version, last_sent = current.version, loop.time()
            yield f"id: {version}\ndata: {json.dumps(event)}\n\n"
        elif loop.time() - last_sent > _KEEP_ALIVE:
            last_sent = loop.time()
            yield ": keep-alive\n\n"
        await asyncio.sleep(_POLL)
