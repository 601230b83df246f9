"""Work in several processes at once."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from hypermap.core.errors import HypermapError
from hypermap.fleet import terminal_signals

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_processes(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int
) -> Iterator[Result]:
    """Yield what becomes of each item, in the order in which they are done.

    Args:
        work: done to each item; can be pickled, as items and results.
        items: what there is to do.
        jobs: how many are worked on at the same time, each in a process of its own; 1 for here.

    Raises:
        HypermapError: If such a process dies.
    """
    if jobs == 1:
        yield from map(work, items)
        return
    # A forked process would inherit the threads of the compiled loops in an unknown state.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, initializer=terminal_signals.ignore) as pool:

        def start(item: Item) -> Future[Result]:
            with terminal_signals.left_to_this_process():
                return pool.submit(work, item)

        try:
            # Signals come to the main thread. One that came amid the start of a process would leave
            # a pool that never ends.
            with ThreadPoolExecutor(1) as starter:
                starting = [starter.submit(start, item) for item in items]
            for done in as_completed([future.result() for future in starting]):
                yield done.result()
        except BrokenProcessPool as error:
            raise HypermapError(
                "a process died over a drive, for want of memory or by a fault of a library; with "
                "--jobs 1 there is only this one"
            ) from error
        except BaseException:  # Ctrl-C or SIGTERM, of which they need not hear
            pool.shutdown(wait=False, cancel_futures=True)
            for child in multiprocessing.active_children():
                child.terminate()
            raise
