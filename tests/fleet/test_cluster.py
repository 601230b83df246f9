"""Workers of a real Ray cluster: two nodes on this computer."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hypermap.cli.main import main
from hypermap.core.errors import FormatError
from hypermap.fleet.cluster import Cluster, _first_line
from hypermap.fleet.workers import TRIES, WorkerDied

from ..cli.conftest import write_drive
from ..roscore import free_port

pytestmark = pytest.mark.xdist_group("workers")

BAD_INPUT = """
from hypermap.core.errors import FormatError
raise FormatError("no such line", path="list.txt", key="line 3")
"""
DYING = """
import os, signal
from pathlib import Path
tally = Path({tally!r})
tally.open("a").write("x")
if len(tally.read_text()) <= {times}:
    os.kill(os.getpid(), signal.SIGKILL)
"""
HOLDING = """
import os, time
from pathlib import Path
with Path({place!r}).open("a") as place:
    place.write(f"{{os.getppid()}} {{os.getpid()}}\\n")
while not Path({go!r}).exists():
    time.sleep(0.01)
"""


def lines(path: Path) -> int:
    return len(path.read_text().splitlines()) if path.exists() else 0


def wait_for(is_so: Callable[[], bool]) -> None:
    end = time.monotonic() + 240
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.02)


def run(*arguments: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert not ended.value.code


class Nodes:
    """A cluster of nodes with one core each; the processes of a node are a group."""

    def __init__(self, folder: Path) -> None:
        self._port = free_port()
        self.address = f"127.0.0.1:{self._port}"
        self.groups: list[int] = []
        self._folder = folder

    def begin(self) -> None:
        head = ["--head", f"--port={self._port}", "--include-dashboard=false"]
        self.start(*head, f"--temp-dir={self._folder}")

    def start(self, *options: str) -> None:
        command = [sys.executable, "-m", "ray.scripts.scripts", "start", "--num-cpus=1"]
        started = subprocess.Popen(
            [*command, "--disable-usage-stats", "--object-store-memory=80000000", *options],
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        self.groups.append(started.pid)
        assert started.wait(240) == 0

    def add(self) -> None:
        self.start(f"--address={self.address}")

    def kill(self, group: int) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(group, signal.SIGKILL)

    def end(self) -> None:
        for group in self.groups:
            self.kill(group)


@pytest.fixture(scope="module")
def nodes() -> Iterator[Nodes]:
    pytest.importorskip("ray", reason="Ray is missing (pip install 'hypermap[fleet]')")
    with tempfile.TemporaryDirectory(prefix="ray-", dir="/tmp") as folder:  # sockets: a short path
        started = Nodes(Path(folder))
        try:
            started.begin()
            started.add()
            yield started
        finally:
            started.end()


@pytest.fixture
def cluster(nodes: Nodes) -> Iterator[Cluster]:
    with Cluster(nodes.address) as connected:
        yield connected


def test_results_and_errors_come_back_from_the_nodes(cluster: Cluster, tmp_path: Path) -> None:
    assert (cluster.count, cluster.threads) == (2, 1)
    results = [cluster.submit(eval, f"2 * {number}") for number in range(20)]
    assert [future.result() for future in results] == list(range(0, 40, 2))
    with pytest.raises(FormatError, match=r"^list\.txt: line 3: no such line$"):
        cluster.submit(exec, BAD_INPUT).result()
    with pytest.raises(Exception, match=r"pickle|local object"):
        cluster.submit(lambda: 1).result()
    tally = tmp_path / "tally"
    cluster.submit(exec, DYING.format(tally=str(tally), times=TRIES - 1)).result()
    assert len(tally.read_text()) == TRIES
    with pytest.raises(WorkerDied):
        cluster.submit(exec, DYING.format(tally=str(tally), times=99)).result()
    assert len(tally.read_text()) == 2 * TRIES


def test_an_error_with_a_traceback_is_said_by_its_first_and_last_line() -> None:
    traceback = "Initialization failure from server:\nTraceback:\n  a line\nRuntimeError: no port\n"
    assert _first_line(Exception(traceback)) == (
        "Initialization failure from server: RuntimeError: no port"
    )
    assert _first_line(Exception("no cluster\nmore of it")) == "no cluster"


def test_closing_ends_what_is_being_done(nodes: Nodes, tmp_path: Path) -> None:
    before = signal.getsignal(signal.SIGTERM)
    held = tmp_path / "held"
    with Cluster(nodes.address, 1) as cluster:
        assert signal.getsignal(signal.SIGTERM) is before
        code = HOLDING.format(place=str(held), go=str(tmp_path / "never"))
        running, waiting = cluster.submit(exec, code), cluster.submit(exec, code)
        wait_for(lambda: lines(held) == 1)
    assert isinstance(running.exception(), WorkerDied)
    assert waiting.cancel()
    assert lines(held) == 1


def test_maps_of_a_cluster_are_those_of_one_process(nodes: Nodes, tmp_path: Path) -> None:
    drive = tmp_path / "recordings" / "monday"
    drive.parent.mkdir()
    write_drive(drive, frames=6)
    run("map", str(drive), "-o", str(tmp_path / "alone.hmap"))
    cluster = ["--address", nodes.address]
    run("map", str(drive), "-o", str(tmp_path / "cluster.hmap"), *cluster)
    run("batch", str(drive.parent), "-o", str(tmp_path), *cluster)
    alone = (tmp_path / "alone.hmap").read_bytes()
    assert (tmp_path / "cluster.hmap").read_bytes() == alone
    assert (tmp_path / "monday.hmap").read_bytes() == alone


def test_the_work_of_a_node_that_dies_is_done_by_another(
    nodes: Nodes, cluster: Cluster, tmp_path: Path
) -> None:
    places, go = [tmp_path / "0", tmp_path / "1"], tmp_path / "go"
    held = [cluster.submit(exec, HOLDING.format(place=str(place), go=str(go))) for place in places]
    wait_for(lambda: [lines(place) for place in places] == [1, 1])
    second = nodes.groups[1]
    at = [tuple(map(int, place.read_text().split())) for place in places]
    (lost,) = (number for number, (node, _) in enumerate(at) if os.getpgid(node) == second)
    nodes.kill(second)
    os.kill(at[lost][1], signal.SIGKILL)  # a worker is of another group than its node
    go.touch()
    for future in held:
        assert future.result(240) is None
    assert [lines(places[lost]), lines(places[1 - lost])] == [2, 1]


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("127.0.0.1:1", "nobody answers there"),
        ("no..name:1", "nobody answers there"),
        ("nowhere", "expected HOST:PORT"),
        ("host:99999", "expected HOST:PORT"),
    ],
)
def test_an_address_without_a_cluster_is_one_clear_line(
    address: str, reason: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip("ray", reason="Ray is missing (pip install 'hypermap[fleet]')")
    write_drive(tmp_path / "monday", frames=2)
    with pytest.raises(SystemExit, match="2"):
        main(["batch", str(tmp_path), "-o", str(tmp_path / "out"), "--address", address])
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert reason in said[0]
