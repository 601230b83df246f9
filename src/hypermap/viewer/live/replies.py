"""HTTP responses: JSON, and errors."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse

from hypermap.core.errors import LayerNotFound, ObjectNotFound
from hypermap.viewer.live.json_text import json_bytes
from hypermap.viewer.live.request_errors import Refused


def json_reply(value: Any) -> Response:
    """Return a value as JSON that browsers do not cache."""
    return json_reply_of(json_bytes(value))


def json_reply_of(content: bytes) -> Response:
    """Return encoded JSON."""
    headers = {"Cache-Control": "no-store"}
    return Response(content, media_type="application/json", headers=headers)


def event_reply(events: AsyncIterator[str] | AsyncIterator[bytes]) -> Response:
    """Return server-sent events; a web server in between hands on each one at once, as nginx."""
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return StreamingResponse(events, media_type="text/event-stream", headers=headers)


def refuse(_: Request, error: Exception) -> Response:
    """Respond to a refused request with the reason."""
    if isinstance(error, Refused):
        answer = {"error": str(error), "reason": error.reason, **error.others}
        return JSONResponse(answer, error.status)
    is_missing = isinstance(error, LayerNotFound | ObjectNotFound)
    status = 404 if is_missing else 400
    return JSONResponse({"error": str(error)}, status)


def refuse_http(_: Request, error: Exception) -> Response:
    """Respond to a request without a route."""
    assert isinstance(error, HTTPException)
    return JSONResponse({"error": error.detail}, error.status_code)


def let_go(_request: Request, _error: Exception) -> Response:
    """Respond to a client that broke off while it sent something, and does not hear this."""
    return Response(status_code=400)


def fail(_: Request, error: Exception) -> Response:
    """Respond to a bug in a plug-in or this program; the terminal shows the traceback."""
    return JSONResponse({"error": f"internal server error: {error!r}"[:500]}, 500)
