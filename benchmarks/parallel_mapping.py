"""Measure mapping with several processes, and how far it can go: `--workers` of `hypermap map`.

    python benchmarks/parallel_mapping.py RECORDING MODEL.onnx [ROUNDS]

One process with one thread, and 1 and 2 workers with one thread each, take turns. Then workers
that only sleep, as long as looking at a frame takes, stand for those of a cluster: what
they return is sent as by real ones, and mapped. Where Ray is installed, the same is done by a
cluster on this computer that is told of more cores than there are.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import pickle
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from hypermap.fleet.ahead import LookedAtAhead
from hypermap.fleet.cluster import Cluster
from hypermap.fleet.looking import Look, look_at
from hypermap.fleet.workers import Processes
from hypermap.mapping.config import chosen_config
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detectors.origin import DetectionOrigin
from hypermap.perception.recording import PendingFrame
from hypermap.recordings import open_recording

READY = "[__import__('time').sleep(0.5), __import__('hypermap.fleet.looking')][0]"
"""What each worker of Ray does first, which takes seconds: it imports the program."""
CONFIG = chosen_config("default", has_network=True)


class Sleeping:
    """Workers that sleep instead of looking, and return what was seen before, pickled."""

    def __init__(self, count: int, seconds: float, seen: dict[float, bytes]) -> None:
        self.count, self.threads = count, 1
        self._seconds, self._seen = seconds, seen
        self._threads = ThreadPoolExecutor(count)

    def submit(self, _function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Return what was seen of a frame after a while."""
        return self._threads.submit(self._look, arguments[0])

    def _look(self, pending: PendingFrame) -> Any:
        time.sleep(self._seconds)
        return pickle.loads(self._seen[pending.stamp])

    def close(self) -> None:
        """End the threads."""
        self._threads.shutdown()


class SleepingOnRay:
    """Workers of a Ray cluster that sleep instead of looking, and return what was seen before."""

    def __init__(self, cluster: Cluster, seconds: float, folder: Path) -> None:
        self.count, self.threads = cluster.count, cluster.threads
        self._cluster, self._seconds, self._folder = cluster, seconds, folder

    def submit(self, _function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Return what was seen of a frame after a while."""
        path, seconds = str(self._folder / repr(arguments[0].stamp)), self._seconds
        load = f"__import__('pickle').load(open({path!r}, 'rb'))"
        code = f"[__import__('time').sleep({seconds!r}), {load}][1]"
        return self._cluster.submit(eval, code)


def run(recording: str, origin: DetectionOrigin, workers: Any) -> tuple[float, float]:
    """Map a recording; return the seconds of wall and of this process's CPU from frame 5 on."""
    source = origin.open(threads=1)
    opened = open_recording(recording)
    ahead = None if workers is None else LookedAtAhead(opened, workers, origin)
    began: list[tuple[float, float]] = []

    def count(progress: Any) -> None:
        if progress.done == 5:
            began.append((time.monotonic(), time.process_time()))

    map_recording(ahead or opened, source, CONFIG, ahead=ahead, on_progress=count)
    return time.monotonic() - began[0][0], time.process_time() - began[0][1]


def children() -> float:
    """Return the CPU seconds of the processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main(recording: str, model: str, rounds: int = 3) -> None:
    """Print the figures."""
    origin = DetectionOrigin(model)
    os.cpu_count = lambda: 1  # type: ignore[assignment]  # one thread for each network
    frames = len(open_recording(recording))
    found: dict[str, list[tuple[float, float]]] = {}
    for _ in range(rounds):
        found.setdefault("one process", []).append(run(recording, origin, None))
        for count in (1, 2):
            with Processes(count) as workers:
                found.setdefault(f"{count} workers", []).append(run(recording, origin, workers))
                peak = max(
                    workers.submit(eval, "__import__('resource').getrusage(0).ru_maxrss").result()
                    for _ in range(count)
                )
            print(f"{count} workers: {peak / 1024:.0f} MiB at most in a worker", flush=True)
    print(f"load {os.getloadavg()[0]:.0f}, {frames} frames")
    for name, times in found.items():
        wall, cpu = (statistics.median(column) for column in zip(*times, strict=True))
        print(f"{name}: {wall:.1f} s wall, {1e3 * cpu / frames:.1f} ms CPU/frame in the mapper")
    simulate(recording, origin)


def simulate(recording: str, origin: DetectionOrigin) -> None:
    """Map with workers that sleep, and compare with Amdahl's law."""
    look = Look(origin, CONFIG.perception, CONFIG.occupancy, False, False, 1)
    seen, looking = {}, []
    for pending in open_recording(recording).pending():
        began = time.process_time()
        looked = look_at(pending, look, True)
        looking.append(time.process_time() - began)
        seen[pending.stamp] = pickle.dumps(looked, protocol=5)
    parallel = statistics.median(looking)
    size = statistics.mean(map(len, seen.values()))
    print(f"looking at a frame: {1e3 * parallel:.1f} ms CPU; {size / 1e6:.2f} MB returned")
    alone = Sleeping(64, 0.0, seen)
    _, serial = run(recording, origin, alone)
    serial /= len(seen) - 5
    print(f"mapping one that was looked at: {1e3 * serial:.1f} ms CPU")

    def tell(what: str, count: int, workers: Any) -> None:
        law = (parallel + serial) / max(serial, (parallel + serial) / (count + 1), parallel / count)
        wall, _ = run(recording, origin, workers)
        rate = (len(seen) - 5) / wall
        speedup = rate * (parallel + serial)
        print(f"{count} {what}: {rate:.1f} frames/s, x{speedup:.1f}; law {law:.1f}", flush=True)

    for count in (1, 2, 4, 8, 16, 100):
        tell("workers", count, Sleeping(count, parallel, seen))
    if importlib.util.find_spec("ray") is None:
        print("Ray is not installed")
        return
    with tempfile.TemporaryDirectory() as folder:
        for stamp, looked in seen.items():
            (Path(folder) / repr(stamp)).write_bytes(looked)
        for count in (1, 2, 4, 8, 16):
            with a_cluster(count) as cluster:
                tell("workers of Ray", count, SleepingOnRay(cluster, parallel, Path(folder)))


@contextlib.contextmanager
def a_cluster(count: int) -> Iterator[Cluster]:
    """Start a Ray cluster on this computer, said to have so many cores, with all workers ready."""
    start = ["start", "--head", f"--num-cpus={count}", "--port=0", "--disable-usage-stats"]
    ray = [sys.executable, "-m", "ray.scripts.scripts"]
    subprocess.run([*ray, *start], check=True, stdout=subprocess.DEVNULL)
    try:
        with Cluster("auto") as cluster:
            for each in [cluster.submit(eval, READY) for _ in range(4 * count)]:
                each.result()
            yield cluster
    finally:
        subprocess.run([*ray, "stop", "--force"], check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else 3)
