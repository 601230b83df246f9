"""Answers in HTTP: JSON, and what is said where there is none."""

from __future__ import annotations

from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from hypermap.core.errors import LayerNotFound, ObjectNotFound
from hypermap.viewer.live.json_text import json_bytes
from hypermap.viewer.live.refusals import Refused


def json_reply(value: Any) -> Response:
    """Return a value as JSON that no browser keeps."""
    return json_reply_of(json_bytes(value))


def json_reply_of(content: bytes) -> Response:
    """Return JSON that is there already."""
    headers = {"Cache-Control": "no-store"}
    return Response(content, media_type="application/json", headers=headers)


def refuse(_: Request, error: Exception) -> Response:
    """Answer what cannot be done with the reason."""
    if isinstance(error, Refused):
        told = {"error": str(error), "reason": error.reason, **error.others}
        return JSONResponse(told, error.status)
    status = 404 if isinstance(error, LayerNotFound | ObjectNotFound) else 400
    return JSONResponse({"error": str(error)}, status)


def refuse_http(_: Request, error: Exception) -> Response:
    """Answer what there is no route for."""
    assert isinstance(error, HTTPException)
    return JSONResponse({"error": error.detail}, error.status_code)


def fail(_: Request, error: Exception) -> Response:
    """Answer where a plug-in, or this program, does not work; the terminal shows where."""
    return JSONResponse({"error": f"the server failed at this: {error!r}"[:500]}, 500)
