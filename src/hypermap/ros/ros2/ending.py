"""Ends rclpy's executors, and programs with threads that hang."""

from __future__ import annotations

import os
import sys
import threading
from typing import Any

LIMIT = 2.0  # s; `ros2 launch` kills a node 10 s after Ctrl-C


def end_executor(executor: Any, runner: threading.Thread) -> bool:
    """Shut an executor down, and wait for the thread that spins it, `LIMIT` seconds for each.

    rclpy waits without limit for callbacks that run, in some versions also against its argument
    `timeout_sec`. So a thread waits in our place.

    Args:
        executor: the executor.
        runner: the thread that spins it; it may not have started.

    Returns:
        Whether both have ended.
    """
    helper = threading.Thread(target=executor.shutdown, name="shutdown", daemon=True)
    helper.start()
    helper.join(LIMIT)
    if runner.is_alive():
        runner.join(LIMIT)
    return not (helper.is_alive() or runner.is_alive())


def end_program_soon() -> None:
    """End the program if it has not ended within `LIMIT` seconds, as threads may be stuck."""

    def end() -> None:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(1)

    timer = threading.Timer(LIMIT, end)
    timer.daemon = True
    timer.start()
