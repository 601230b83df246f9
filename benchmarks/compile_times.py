"""What each loop costs to compile that a command needs: CPU seconds, the most expensive first.

Nothing is taken from what was compiled before, and nothing is kept.

    python benchmarks/compile_times.py demo -o FOLDER
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections import Counter
from typing import Any

with tempfile.TemporaryDirectory() as folder:
    os.environ["NUMBA_CACHE_DIR"] = folder  # read when numba is imported

    from numba.core import event

    from hypermap.cli.main import main

    class Times(event.Listener):
        """Adds up for each function what it takes without those that it calls."""

        def __init__(self) -> None:
            self.seconds: Counter[str] = Counter()
            self.compiled: Counter[str] = Counter()
            self._begun: list[list[float]] = []  # when, and the seconds of what is called

        def on_start(self, event: Any) -> None:  # noqa: ARG002
            """Remember when."""
            self._begun.append([time.process_time(), 0.0])

        def on_end(self, event: Any) -> None:
            """Add what it took."""
            began, called = self._begun.pop()
            seconds = time.process_time() - began
            function = event.data["dispatcher"].py_func
            name = f"{function.__module__}.{function.__name__}"
            self.seconds[name] += seconds - called
            self.compiled[name] += 1
            if self._begun:
                self._begun[-1][1] += seconds

    times = Times()
    event.register("numba:compile", times)  # type: ignore[no-untyped-call]
    try:
        main(sys.argv[1:])
    finally:
        print(f"\n{times.seconds.total():.2f} s for {times.compiled.total()} functions")
        for name, seconds in times.seconds.most_common():
            print(f"{seconds:7.3f}  {times.compiled[name]:2d} x  {name}")
