"""Calls of functions, and what came of them, as bytes that go to workers and back."""

from __future__ import annotations

import pickle
import traceback
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from hypermap.core.errors import HypermapError


def packed(function: Callable[..., Any], arguments: tuple[Any, ...]) -> bytes:
    """Return a call as bytes; raises what pickle raises where something cannot be pickled."""
    return pickle.dumps((function, arguments), protocol=5)


def answer(call: bytes) -> bytes:
    """Do a call, and return its result or its exception as bytes."""
    try:
        function, arguments = pickle.loads(call)
        return pickle.dumps((True, function(*arguments), ""), protocol=5)
    except Exception as error:
        trace = "" if isinstance(error, HypermapError) else traceback.format_exc()
        try:
            pickle.loads(failed := pickle.dumps((False, error, trace)))
        except Exception:  # it does not travel
            return pickle.dumps((False, RuntimeError(repr(error)), trace))
        return failed


def resolve(future: Future[Any], answered: bytes) -> None:
    """Let a future have the result, or the exception, that a worker has answered."""
    try:
        is_done, result, trace = pickle.loads(answered)
    except Exception as error:  # a class that only the worker knows
        future.set_exception(error)
        return
    if is_done:
        future.set_result(result)
        return
    if trace:
        result.__cause__ = RuntimeError(f"in a worker:\n{trace}")
    future.set_exception(result)
