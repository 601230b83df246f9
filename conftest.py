"""The surroundings of all tests: none of the user's, but what is set here.

Whatever a test needs beyond this, it sets itself. So the suite says the same on every machine,
from every shell, and as a background job.
"""

from __future__ import annotations

import faulthandler
import gc
import importlib.util
import logging
import os
import shutil
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from _pytest.doctest import DoctestModule
from _pytest.faulthandler import fault_handler_stderr_fd_key

# Modules that need what is not installed everywhere already to be imported.
collect_ignore_glob = [
    "src/hypermap/ros/ros1/*",
    "src/hypermap/ros/ros2/*",
    "src/hypermap/ros/rviz/bindings.py",
    "src/hypermap/fleet/store/migrations/*",  # which Alembic runs
]
if importlib.util.find_spec("psycopg") is None:
    collect_ignore_glob.append("src/hypermap/fleet/store/*")
if importlib.util.find_spec("rerun") is None:  # whose SDK needs Python 3.11
    collect_ignore_glob.append("src/hypermap/viewer/logs/rerun_log.py")

LOGGERS = ("hypermap", "hypermap._loops", "py.warnings", "matplotlib")  # that commands set up
_LONGEST_ID = 200  # characters
_HANGS_AFTER, _ARMED_EVERY = 500.0, 60.0  # seconds
KEPT = ("PATH", "TMPDIR", "CI", "HYPERMAP_CHROMIUM", "HYPERMAP_ROS2", "HOME")
SET = {
    "LANG": "C.UTF-8",
    # Local time is never UTC, so that a test shows who takes one for the other. Needs no tzdata.
    "TZ": "IST-5:30",
    # The workers keep all cores busy; threads of linear algebra would spin, waiting for a core.
    "OPENBLAS_NUM_THREADS": "1",
}


def _leave_the_surroundings() -> None:
    """Clear the environment, and what else a process inherits; workers inherit what is left."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name in KEPT or name.startswith(("PYTEST_", "COVERAGE_"))
    }
    os.environ.clear()
    os.environ.update(kept | SET)
    time.tzset()
    os.umask(0o022)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in the background jobs of a script
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # as nohup leaves it
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


_leave_the_surroundings()


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Give the run a home folder of its own; the workers of pytest-xdist share it."""
    if not hasattr(config, "workerinput"):
        home = Path(tempfile.mkdtemp(prefix="hypermap-home-"))
        config.add_cleanup(lambda: shutil.rmtree(home, ignore_errors=True))
        os.environ["HOME"] = str(home)
    elif config.option.durations is None and not config.option.xmlpath:
        _report_what_counts(config)


def _report_what_counts(config: pytest.Config) -> None:
    """Send nothing of the set-up and the end of a test that went well: it took 4 s of a run."""
    plugins = config.pluginmanager.get_plugins()
    (interactor,) = (each for each in plugins if type(each).__name__ == "WorkerInteractor")
    send = interactor.sendevent

    def send_what_counts(name: str, **said: Any) -> None:
        report = said.get("data", {}) if name == "testreport" else {}
        if report.get("when") not in ("setup", "teardown") or report["outcome"] != "passed":
            send(name, **said)

    interactor.sendevent = send_what_counts


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Hand out tests as `--dist loadgroup` does, but quicker, and also after a crash."""
    if config.option.dist != "loadgroup":
        return None
    from xdist.scheduler import LoadGroupScheduling

    class Scheduling(LoadGroupScheduling):  # type: ignore[misc]
        def mark_test_complete(self, node: Any, item_index: int, duration: float = 0) -> None:
            """Forget what is done: all that a worker ever got would be counted after each test."""
            given = self.assigned_work[node]
            for group in [group for group, tests in given.items() if all(tests.values())]:
                del given[group]
            super().mark_test_complete(node, item_index, duration)

        def remove_node(self, node: Any) -> str | None:
            """Return the test at which a worker crashed, and let others run what it had left.

            It would run again, and crash the next worker, or wait for ever behind what is done.
            """
            given = self.assigned_work.pop(node)
            tests = ((group, *test) for group in given for test in given[group].items())
            left = [(group, test) for group, test, is_done in tests if not is_done]
            for group, test in left[1:]:
                self.workqueue.setdefault(group, {})[test] = False
            for other in self.nodes:
                self._reschedule(other)
            return left[0][1] if left else None

        def add_node_collection(self, node: Any, collection: Sequence[str]) -> None:
            """Leave out a worker that was told to end while it collected."""
            if node in self.assigned_work:
                super().add_node_collection(node, collection)

        def schedule(self) -> None:
            """Give two tests to a new worker, as to the first ones: it begins when it has two."""
            super().schedule()
            for node in self.nodes:
                self._reschedule(node)

        def _reschedule(self, node: Any) -> None:
            """Give no tests to a worker that has not collected them yet."""
            if node in self.registered_collections:
                super()._reschedule(node)

        def _assign_work_unit(self, node: Any) -> None:
            """Give tests also to a worker that has just crashed, as they come back from there."""
            with suppress(OSError):
                super()._assign_work_unit(node)

    return Scheduling(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, Any, Any]:
    """Collect tests, but no garbage meanwhile: there is little, and each worker looked for 3 s."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path: Path) -> Generator[None, Any, Any]:
    """Look for examples where there are any: to import the other modules takes seconds."""
    collectors = yield
    if file_path.suffix != ".py" or ">>> " in file_path.read_text(encoding="utf-8"):
        return collectors
    return [each for each in collectors if not isinstance(each, DoctestModule)]


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the slow tests, so that no worker is busy with one when the others are done."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


def pytest_collection_finish() -> None:
    """Keep all tests and modules out of garbage collections, which take a third of a second.

    Some are asked for by tests, others come by themselves: after so many new objects, not after
    700, as tests make and drop many, and looking for them took up to a fifteenth of the time. What
    is garbage already stays, as to look for that took half a second of each worker.
    """
    gc.freeze()
    gc.set_threshold(10_000)


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Name a long parameter by its length: workers exchange all names, which were 20 MB."""
    if isinstance(val, str | bytes) and len(val) > _LONGEST_ID:
        return f"{argname}-of-{len(val)}"
    return None


_armed: list[float] = []  # when the watchdog began to wait


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, Any, Any]:
    """Show where each thread stands if a test hangs, also where its timeout cannot end it.

    pytest's own `faulthandler_timeout` starts and ends a thread for each test, which takes as long
    as a small test.
    """
    now = time.monotonic()
    file = item.config.stash.get(fault_handler_stderr_fd_key, None)  # None: -p no:faulthandler
    if file is not None and (not _armed or now - _armed[0] > _ARMED_EVERY):
        _armed[:] = [now]
        faulthandler.dump_traceback_later(_HANGS_AFTER, file=file)
    return (yield)


def pytest_sessionfinish() -> None:
    """Wait for no test any more."""
    faulthandler.cancel_dump_traceback_later()
    _armed.clear()


@contextmanager
def _loggers_restored() -> Iterator[None]:
    loggers = [logging.getLogger(name) for name in LOGGERS]
    before = [(logger, logger.level, list(logger.handlers)) for logger in loggers]
    try:
        yield
    finally:
        for logger, level, handlers in before:
            logger.setLevel(level)
            logger.handlers = handlers


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: pytest.FixtureDef[Any]) -> Generator[None, Any, Any]:
    """Restore what is logged after a module's or a session's fixture, which no one test owns."""
    if fixturedef.scope == "function":
        return (yield)
    with _loggers_restored():
        return (yield)


@pytest.fixture(autouse=True)
def _what_a_test_changes_ends_with_it() -> Iterator[None]:
    """Restore the environment, the working folder and what is logged after each test."""
    environment, folder = dict(os.environ), Path.cwd()
    with _loggers_restored():
        yield
    os.chdir(folder)
    if dict(os.environ) != environment:
        os.environ.clear()
        os.environ.update(environment)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Say in one line how many tests were skipped, and how to have them."""
    reasons = Counter(
        str(report.longrepr[2]).removeprefix("Skipped: ")
        for report in terminalreporter.stats.get("skipped", [])
    )
    if reasons:
        parts = (f"{count}: {reason}" for reason, count in reasons.most_common())
        terminalreporter.write_line(f"{reasons.total()} skipped, of which {'; '.join(parts)}")
