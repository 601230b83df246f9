"""Workers: other processes that run functions, and run them again if one dies."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from types import TracebackType
from typing import Any, NamedTuple, Protocol, TypeVar

from hypermap.core.errors import HypermapError
from hypermap.fleet import terminal_signals
from hypermap.fleet.calls import answer, packed, resolve

T = TypeVar("T")

TRIES = 3
"""How often a function is begun whose process dies."""


class WorkerDied(HypermapError):
    """A function has ended each process that ran it."""

    def __init__(self) -> None:
        super().__init__(
            f"a worker process died {TRIES} times over the same work; is there enough memory for "
            "so many workers (--workers)?"
        )


class Workers(Protocol):
    """Something that runs functions elsewhere.

    Functions and what they take and return must be picklable; a function may run more than once.

    Attributes:
        count: how many run at a time.
        threads: how many threads each may use.
    """

    count: int
    threads: int

    def submit(self, function: Callable[..., T], *arguments: Any) -> Future[T]:
        """Run a function when a worker is free; `WorkerDied` if each one dies over it."""

    def close(self) -> None:
        """End all workers, and what they are doing."""


def cores() -> int:
    """Return how many cores this computer has."""
    return os.cpu_count() or 1


class _Task(NamedTuple):
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    future: Future[Any]


class Processes:
    """Workers that are processes of this computer; closed at the end of a `with`.

    They end with this process, however it ends. Ctrl-C is not for them.

    Attributes:
        count: how many there are.
        threads: how many threads each may use: the cores, divided among them.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self.threads = max(1, cores() // count)
        self._tasks: queue.SimpleQueue[_Task | None] = queue.SimpleQueue()
        self._workers = [_Worker() for _ in range(count)]
        self._is_closed = False
        self._closing = threading.Lock()  # no worker is restarted meanwhile
        self._threads = [
            threading.Thread(target=self._serve, args=[worker], daemon=True)
            for worker in self._workers
        ]
        for thread in self._threads:
            thread.start()

    def __enter__(self) -> Processes:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def pids(self) -> list[int]:
        """The process ids of the workers that are running."""
        return [worker.process.pid for worker in self._workers if worker.process.pid is not None]

    def submit(self, function: Callable[..., T], *arguments: Any) -> Future[T]:
        """Run a function when a worker is free; see `Workers.submit`."""
        future: Future[T] = Future()
        self._tasks.put(_Task(function, arguments, future))
        return future

    def close(self) -> None:
        """End all workers, and what they are doing."""
        with self._closing:
            self._is_closed = True
        for worker in self._workers:
            self._tasks.put(None)
            worker.end()
        for thread in self._threads:
            thread.join()

    def _serve(self, worker: _Worker) -> None:
        """Let a worker do one task after the other."""
        while (task := self._tasks.get()) is not None and not self._is_closed:
            if task.future.set_running_or_notify_cancel():
                self._do(worker, task)

    def _do(self, worker: _Worker, task: _Task) -> None:
        try:
            call = packed(task.function, task.arguments)
        except Exception as error:  # it cannot be pickled
            task.future.set_exception(error)
            return
        for _ in range(TRIES):
            try:
                answered = worker.answer(call)
            except (EOFError, OSError):  # it is not there any more
                with self._closing:
                    if self._is_closed:
                        break
                    worker.begin()
                continue
            resolve(task.future, answered)
            return
        task.future.set_exception(WorkerDied())


class _Worker:
    """A process, and the connection to it."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Start the process, or restart it."""
        # Threads and compiled loops do not survive a fork.
        context = multiprocessing.get_context("spawn")
        self._connection, other = context.Pipe()
        self.process: SpawnProcess = context.Process(target=_work, args=[other], daemon=True)
        with terminal_signals.left_to_this_process():
            self.process.start()
        other.close()

    def answer(self, call: bytes) -> bytes:
        """Return what the process answers to a call.

        Raises:
            OSError: If the process is not there any more; EOFError if it ended meanwhile.
        """
        self._connection.send_bytes(call)
        return self._connection.recv_bytes()

    def end(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.join()


def _work(connection: Connection) -> None:
    """Run functions until the parent process is gone."""
    terminal_signals.ignore()
    with contextlib.suppress(EOFError, OSError):
        while True:
            connection.send_bytes(answer(connection.recv_bytes()))
