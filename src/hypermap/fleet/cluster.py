"""Workers that are the nodes of a Ray cluster."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any, TypeVar

from hypermap._version import __version__
from hypermap.core.errors import HypermapError, MissingExtra
from hypermap.fleet.calls import answer, packed, resolve
from hypermap.fleet.workers import TRIES, WorkerDied

T = TypeVar("T")

LOCAL = "local"
"""The address of a cluster that is started on this computer, and ends with the program."""

_PATIENCE = 60  # s, until we say that a cluster has not begun to work
_CONNECT = 5  # s, until somebody answers at its address

_log = logging.getLogger(__name__)


class Cluster:
    """Workers of a Ray cluster; closed at the end of a `with`.

    A function that dies with its process or its node is run again elsewhere, by what is left.
    Its nodes need the same Hypermap, and recordings under the same paths.

    Attributes:
        count: how many functions run at a time.
        threads: how many threads each may use: one, as each is given one core.
    """

    def __init__(self, address: str, count: int | None = None) -> None:
        """Connect to a cluster.

        Args:
            address: HOST:PORT of a cluster of which this computer is a node, ray://HOST:PORT of
                any other, "auto" for the one that runs here, or "local" to start one.
            count: how many functions may run at a time; None for one per core of the cluster.

        Raises:
            HypermapError: If there is no such cluster, or it has another Hypermap.
            MissingExtra: If Ray is not installed.
        """
        self.threads = 1
        self._shown = f"cluster {address}"
        self._ray = _connected(address)
        self._is_closed = False
        self._running: set[Any] = set()
        self._lock = threading.Lock()
        try:
            self._answer = self._ray.remote(max_retries=0)(answer)
            self._check_version()
            cores = int(self._ray.cluster_resources().get("CPU", 1))
        except BaseException:
            self._ray.shutdown()
            raise
        self.count = max(1, cores) if count is None else count
        self._threads = ThreadPoolExecutor(self.count, "cluster")

    def __enter__(self) -> Cluster:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self.close()

    def submit(self, function: Callable[..., T], *arguments: Any) -> Future[T]:
        """Run a function when a worker is free; see `Workers.submit`."""
        future: Future[T] = Future()
        self._threads.submit(self._do, function, arguments, future)
        return future

    def close(self) -> None:
        """End what the workers are doing, and leave the cluster."""
        with self._lock:
            self._is_closed = True
            running = list(self._running)
        for each in running:
            with contextlib.suppress(Exception):  # it has ended by itself, or with its node
                self._ray.cancel(each, force=True)
        self._threads.shutdown()
        self._ray.shutdown()

    def _do(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], future: Future[Any]
    ) -> None:
        """Let a worker do a call, and another one if it dies over it."""
        if self._is_closed or not future.set_running_or_notify_cancel():
            return
        try:
            resolve(future, self._answered(packed(function, arguments)))
        except Exception as error:  # it cannot be pickled, or the cluster is gone
            future.set_exception(self._explained(error))

    def _explained(self, error: Exception) -> Exception:
        if self._is_closed:
            return WorkerDied()
        if isinstance(error, (self._ray.exceptions.RayError, ConnectionError)):
            return HypermapError(f"{self._shown}: {_first_line(error)}")
        return error

    def _answered(self, call: bytes) -> bytes:
        """Return what a worker answers to a call.

        Raises:
            WorkerDied: If each one dies over it.
        """
        known = self._ray.exceptions
        died = known.WorkerCrashedError, known.NodeDiedError, known.OutOfMemoryError
        for _ in range(TRIES):
            running = self._begun(call)
            try:
                answered: bytes = self._ray.get(running)
            except (*died, known.ObjectLostError):  # the last: its node died after it was done
                continue
            else:
                return answered
            finally:
                with self._lock:
                    self._running.remove(running)
        raise WorkerDied

    def _begun(self, call: bytes) -> Any:
        with self._lock:
            if self._is_closed:
                raise WorkerDied
            running = self._answer.remote(call)
            self._running.add(running)
        return running

    def _check_version(self) -> None:
        future: Future[str] = Future()
        asked = self._answer.remote(packed(_version, ()))
        ready, _ = self._ray.wait([asked], timeout=_PATIENCE)
        if not ready:
            _log.warning("%s has no free core so far; waiting for one", self._shown)
        try:
            resolve(future, self._ray.get(asked))
            there = future.result()
        except Exception as error:
            reason = _first_line(error)
            raise HypermapError(
                f"{self._shown}: cannot run Hypermap there; install it on each node: {reason}"
            ) from None
        if there != __version__:
            raise HypermapError(
                f"{self._shown}: it has Hypermap {there}, and this is {__version__}; install the "
                "same on each node"
            )


def _version() -> str:
    return __version__


def _connected(address: str) -> Any:
    """Return the module `ray`, connected to a cluster."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # else a started one calls home
    try:
        import ray
    except ImportError:
        raise MissingExtra("a cluster (--address)", "fleet") from None
    _check_reachable(address)
    with _kept_signals():
        try:
            ray.init(address=address, log_to_driver=False, logging_level="ERROR")
        except Exception as error:
            reason = _first_line(error)
            raise HypermapError(f"cluster {address}: cannot connect: {reason}") from None
    return ray


@contextlib.contextmanager
def _kept_signals() -> Iterator[None]:
    """Take SIGTERM back from Ray, which ends the program at once."""
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, before)


def _check_reachable(address: str) -> None:
    """Raise a HypermapError if nothing answers at a host and port; Ray would try for a minute."""
    if address in (LOCAL, "auto"):
        return
    host, colon, port = address.removeprefix("ray://").strip("/").rpartition(":")
    if not (colon and host and port.isascii() and port.isdigit() and int(port) < 65536):
        raise HypermapError(
            f"--address {address}: expected HOST:PORT, ray://HOST:PORT, auto or local"
        )
    try:
        socket.create_connection((host.strip("[]"), int(port)), _CONNECT).close()
    except (OSError, UnicodeError) as error:  # the latter for what cannot be a name
        raise HypermapError(f"cluster {address}: nobody answers there: {error}") from None


def _first_line(error: BaseException) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    if not lines:
        return type(error).__name__
    # Of an error with a traceback, the last line says what it was.
    return f"{lines[0]} {lines[-1]}" if lines[0].endswith(":") else lines[0]
