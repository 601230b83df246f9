"""Functions run in other processes."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from hypermap.core.errors import FormatError
from hypermap.fleet.workers import TRIES, Processes, WorkerDied, _Worker

pytestmark = pytest.mark.xdist_group("workers")


# Other processes do not know the functions of a test; each knows `eval` and `exec`.
BAD_INPUT = """
from hypermap.core.errors import FormatError
raise FormatError("no such line", path="list.txt", key="line 3")
"""
UNKNOWN = """
class Own(Exception): pass
raise Own("odd")
"""
DYING = """
import os, signal
from pathlib import Path
tally = Path({tally!r})
tally.open("a").write("x")
if len(tally.read_text()) <= {times}:
    os.kill(os.getpid(), signal.SIGKILL)
"""
WAITING = """
import time
from pathlib import Path
Path({begun!r}).touch()
time.sleep(600)
"""


@pytest.fixture(scope="module")
def workers() -> Iterator[Processes]:
    with Processes(2) as workers:
        yield workers


def test_results_come_back_from_other_processes(workers: Processes) -> None:
    results = [workers.submit(eval, f"2 * {number}") for number in range(20)]
    assert [future.result() for future in results] == list(range(0, 40, 2))
    assert workers.submit(os.getpid).result() in set(workers.pids) - {os.getpid()}


def test_errors_come_back_as_they_were(workers: Processes) -> None:
    with pytest.raises(FormatError, match=r"^list\.txt: line 3: no such line$") as caught:
        workers.submit(exec, BAD_INPUT).result()
    assert caught.value.key == "line 3"
    with pytest.raises(ZeroDivisionError) as bug:
        workers.submit(eval, "1 / 0").result()
    assert "division by zero" in str(bug.value.__cause__)  # where it happened there
    with pytest.raises(RuntimeError, match="odd"):
        workers.submit(exec, UNKNOWN, {}).result()


def test_what_cannot_be_sent_is_an_error_of_its_own(workers: Processes) -> None:
    with pytest.raises(Exception, match=r"pickle|local object"):
        workers.submit(lambda: 1).result()
    assert workers.submit(eval, "8").result() == 8


def test_the_work_of_a_worker_that_dies_is_done_again(workers: Processes, tmp_path: Path) -> None:
    tally = tmp_path / "tally"
    workers.submit(exec, DYING.format(tally=str(tally), times=TRIES - 1)).result()
    assert len(tally.read_text()) == TRIES


def test_work_that_kills_every_worker_is_given_up_and_others_go_on(
    workers: Processes, tmp_path: Path
) -> None:
    tally = tmp_path / "tally"
    bad = workers.submit(exec, DYING.format(tally=str(tally), times=99))
    good = [workers.submit(eval, str(number)) for number in range(5)]
    with pytest.raises(WorkerDied, match="--workers"):
        bad.result()
    assert [future.result() for future in good] == [0, 1, 2, 3, 4]
    assert len(tally.read_text()) == TRIES


def test_ctrl_c_does_not_reach_a_worker_that_is_just_starting() -> None:
    with Processes(1) as workers:
        (pid,) = workers.pids
        os.kill(pid, signal.SIGINT)
        assert workers.submit(os.getpid).result() == pid


def test_closing_ends_what_is_being_done(tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    with Processes(1) as workers:
        future = workers.submit(exec, WAITING.format(begun=str(begun)))
        while not begun.exists():
            assert not future.done()
            time.sleep(0.01)
        (pid,) = workers.pids
    assert isinstance(future.exception(), WorkerDied)
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.timeout(120)
def test_closing_ends_a_worker_that_is_just_restarted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    is_restarted, begin = threading.Event(), _Worker.begin

    def begin_slowly(worker: _Worker) -> None:
        is_restarted.set()
        time.sleep(0.1)  # closing begins meanwhile
        begin(worker)

    once = DYING.format(tally=str(tmp_path / "tally"), times=1)
    with Processes(1) as workers:
        monkeypatch.setattr(_Worker, "begin", begin_slowly)
        future = workers.submit(exec, once + WAITING.format(begun=str(tmp_path / "begun")))
        is_restarted.wait()
    assert isinstance(future.exception(), WorkerDied)
