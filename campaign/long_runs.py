"""Long runs: memory and speed stay flat, and who asks while a map changes sees it whole.

- A mapper of each profile takes frames of a drive over and over, as many as there is time for.
- A live node maps a day of simulated clock: restarts, jumps of the clock, topics that fall silent.
- Sixteen threads ask a layer, and a server of the page, while one moves an object back and forth:
  nobody may see it twice or never.
"""

from __future__ import annotations

import dataclasses
import http.client
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import cycle
from pathlib import Path
from typing import Any, cast

import numpy as np
import shapely

from campaign.part import Budget, Finding, Result
from campaign.robot import DEPTH, DETECTIONS, Robot
from hypermap import Hypermap, SemanticLayer, SemanticObject
from hypermap.core.arrays import FloatArray
from hypermap.formats import open_map, save_map
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import RgbdFrame
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.mapper.statistics import Fate
from hypermap.simulation import SimulatedRecording, demo_world, errors_of_level
from hypermap.simulation.render import DEFAULT_CAMERA
from hypermap.viewer.live.app import MapApp
from hypermap.viewer.live.document import MapDocument
from hypermap.viewer.live.serving import listen, serving

FRAMES = 100_000  # the most that a mapper gets
GROWTH = 1.0  # MB that 10,000 frames may add, once warm
SLOWER = 1.5  # times: the last quarter of the frames beside the second
READERS = 16
DAY = 86_400  # s
_ENOUGH = 20_000  # frames, from which on growth can be told from noise
_YEARS = 4 * 10**17  # ns
_PATIENCE = 120.0  # s for one frame of the live node


def run(budget: Budget) -> Result:
    """Run each for its share of the time."""
    findings: list[str] = []
    figures: dict[str, float | str] = {}
    frames = _drive(budget.seed, rate=0.5 if budget.short else 2.0)
    runs = 0
    for name in ("default", "thesis"):
        runs += _map(name, frames, budget, 0.25, findings, figures)
    runs += _live(frames, budget, 0.25, findings, figures)
    for asked in (_ask_layer, _ask_server):
        runs += asked(budget, 0.12, findings, figures)
    found = [Finding(what, budget.seed) for what in findings]
    return Result("long_runs", runs, found, figures)


def _drive(seed: int, rate: float) -> list[RgbdFrame]:
    """Return small frames of a drive through a room, without their color."""
    errors = errors_of_level("robot")
    recording = SimulatedRecording(
        demo_world(),
        camera=DEFAULT_CAMERA.every(4),
        rate=rate,
        depth_noise=errors.depth,
        pose_noise=errors.poses,
        detector_noise=errors.detector,
        seed=seed,
    )
    return [dataclasses.replace(frame, color=None) for frame in recording.frames()]


def _memory() -> float:
    """Return what this process holds in memory, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def _growth(memory: FloatArray) -> float:
    """Return by how much memory grows with 10,000 frames, once warm, MB."""
    warm = np.arange(len(memory) // 4, len(memory))
    return float(1e4 * np.polyfit(warm, memory[warm], 1)[0])


# A mapper


def _map(
    name: str,
    frames: list[RgbdFrame],
    budget: Budget,
    share: float,
    findings: list[str],
    figures: dict[str, float | str],
) -> int:
    """Map the drive over and over, with poses that err anew; return how many frames that were."""
    rng = np.random.default_rng(budget.seed)
    mapper = Mapper(profile(name), detections_from_recording())
    most = 2 * len(frames) if budget.short else FRAMES
    end = time.monotonic() + share * budget.seconds
    # Whole from the beginning, so that what is written down does not grow.
    ends, memory, count = np.full(most, np.nan), np.full(most, np.nan), 0
    for i, frame in enumerate(cycle(frames)):
        if i == most or (not budget.short and time.monotonic() > end):
            break
        pose = frame.map_T_camera.copy()
        pose[:2, 3] += rng.normal(0, 0.02, 2)
        mapper.add(dataclasses.replace(frame, stamp=float(i), map_T_camera=pose))
        ends[i], memory[i], count = time.monotonic(), _memory(), i + 1
    if mapper.counts.frames != count or mapper.counts.unusable:
        findings.append(f"mapper, {name}: {count} frames were given, {mapper.counts}")
    objects = len(mapper.hypermap().semantic())
    if not objects:
        findings.append(f"mapper, {name}: no objects after {count} frames")
    growth = _growth(memory[:count])
    quarter = count // 4
    early, late = (np.median(np.diff(ends)[k * quarter :][: quarter - 1]) for k in (1, 3))
    figures[f"{name}: frames"], figures[f"{name}: objects"] = count, objects
    figures[f"{name}: ms a frame, early and late"] = f"{1e3 * early:.1f}, {1e3 * late:.1f}"
    figures[f"{name}: MB per 10,000 frames"] = round(growth, 2)
    if count >= _ENOUGH and growth > GROWTH:
        findings.append(f"mapper, {name}: {growth:.1f} MB more with each 10,000 frames")
    if count >= _ENOUGH and late > SLOWER * early:
        findings.append(f"mapper, {name}: {late / early:.1f} times slower at the end")
    return count


# A live node


def _live(
    frames: list[RgbdFrame],
    budget: Budget,
    share: float,
    findings: list[str],
    figures: dict[str, float | str],
) -> int:
    """Let a node live for a day of its clock; return how many frames that were."""
    rng = np.random.default_rng(budget.seed)
    saved = budget.folder / "live.hmap"
    saved.unlink(missing_ok=True)
    robot = Robot(save_to=str(saved), save_every=0.0, patience=0.5)
    day = _Day(robot, SemanticMapper(cast(Any, robot)))
    end = time.monotonic() + share * budget.seconds
    most = 2 * len(frames) if budget.short else FRAMES
    clock, gone, start = 1_600_000_000 * 10**9, 0.0, time.monotonic()
    events = ["restart", "jump", "without detections", "without depth", "other clock"]
    memory, count = np.full(most, np.nan), 0
    day.begin()
    for i, frame in enumerate(cycle(frames)):
        if i == most or (not budget.short and time.monotonic() > end):
            break
        before, gone = gone, (i + 1) / most  # of the day
        if not budget.short:  # which ends with the time that there is, or with the frames
            gone = max(gone, min(1.0, (time.monotonic() - start) / (end - start)))
        clock += round((gone - before) * DAY * 1e9)
        event = events[i // 7 % len(events)] if i % 7 == 6 else ""
        if event == "restart":
            objects = len(day.node)
            day.end()
            kept = len(open_map(saved).semantic())
            if kept != objects:
                findings.append(f"live: {objects} objects at the end, {kept} in the saved map")
            day.begin()
        elif event == "jump":
            clock -= round(rng.uniform(2, 3600) * 1e9)
        elif event == "other clock":
            robot.show(frame, clock + _YEARS, DEPTH)
            clock += 10**9
        if event == "without detections":
            robot.show(frame, clock, DEPTH)
        elif event == "without depth":
            robot.show(frame, clock, DETECTIONS)
        else:
            day.map(frame, clock)
        robot.tick()
        memory[i], count = _memory(), i + 1
    objects = len(day.node)
    day.end()
    saved.unlink(missing_ok=True)
    Path(f"{saved}.bak").unlink(missing_ok=True)
    if day.lost:
        findings.append(f"live: {len(day.lost)} whole frames were not mapped: {day.lost[:3]}")
    if robot.levels["error"]:
        findings.append(f"live: {robot.levels['error']} errors were logged")
    if not objects:
        findings.append("live: no objects at the end")
    figures["live: frames mapped"], figures["live: restarts"] = day.mapped, day.lives - 1
    figures["live: hours of its clock"] = round(24 * gone, 1)
    growth = _growth(memory[:count])
    figures["live: MB per 10,000 frames"] = round(growth, 2)
    if count >= _ENOUGH and growth > GROWTH:
        findings.append(f"live: {growth:.1f} MB more with each 10,000 frames")
    return count


@dataclasses.dataclass
class _Day:
    """A node, its restarts, and what became of the frames that it was shown whole."""

    robot: Robot
    node: SemanticMapper
    lives: int = 0
    mapped: int = 0
    lost: list[str] = dataclasses.field(default_factory=list)

    def begin(self) -> None:
        self.node.configure()
        self.node.activate()
        self.lives += 1

    def end(self) -> None:
        self.node.deactivate()
        self.node.cleanup()

    def map(self, frame: RgbdFrame, stamp: int) -> None:
        """Show a frame whole, and wait until the node has mapped it."""
        before = self._mapped()
        self.robot.show(frame, stamp)
        limit = time.monotonic() + _PATIENCE
        while self._mapped() == before and time.monotonic() < limit:
            time.sleep(0.001)
        if self._mapped() == before:
            self.lost.append(f"at {stamp}")
        self.mapped += 1

    def _mapped(self) -> int:
        report = self.node.report()
        totals = {} if report is None else report.totals
        return totals.get(Fate.MAPPED, 0) + totals.get(Fate.STILL, 0)


# Readers and a writer


HERE, THERE = shapely.box(0, 0, 1, 1), shapely.box(50, 50, 51, 51)
EVERYWHERE = shapely.box(-10, -10, 100, 100)


def _map_of_one_cup() -> Hypermap:
    """Return a map of many chairs and the one cup that is moved."""
    chairs = [SemanticObject("chair", shapely.box(x, 5, x + 0.5, 6)) for x in range(60)]
    return Hypermap([SemanticLayer("things", "map", [SemanticObject("cup", HERE), *chairs])])


def _ask_layer(
    budget: Budget, share: float, findings: list[str], figures: dict[str, float | str]
) -> int:
    """Let threads ask a map in this process; return how many questions that were."""
    asked = _map_of_one_cup()
    layer = asked.semantic()
    cup = int(layer.ids[layer.names == "cup"][0])

    def is_seen() -> Iterator[int]:
        yield sum(found.object.name == "cup" for found in asked.objects())
        yield len(layer.find("cup"))
        yield list(layer.names).count("cup")
        yield list(layer.values_in(EVERYWHERE).values).count(cup)
        yield len(asked.objects("cup", area=EVERYWHERE))
        yield len(asked.nearest("cup", [0.0, 0.0], k=3))

    def move(where: Any) -> None:
        layer.update(cup, SemanticObject("cup", where))

    return _readers("layer", lambda: is_seen, move, budget, share, findings, figures)


def _ask_server(
    budget: Budget, share: float, findings: list[str], figures: dict[str, float | str]
) -> int:
    """Let clients ask a server of the page; return how many questions that were."""
    path = budget.folder / "readers.hmap"
    save_map(_map_of_one_cup(), path)
    app = MapApp(MapDocument(path, True))
    listening = listen("127.0.0.1", 0)
    with serving(app, listening):
        port = listening.getsockname()[1]
        with _client(port, app.token or "") as get:
            info = get("GET", "/api/map")
            found = get("GET", "/api/find?name=cup")
            (row,) = found["rows"]

            def move(where: Any) -> None:
                corners = [list(corner) for corner in where.exterior.coords[:-1]]
                change = {"op": "update", "layer": "things", "id": row["id"], "polygon": corners}
                body = {"version": info["version"], "operations": [change]}
                info["version"] = get("POST", "/api/edit", body)["version"]

            def reader() -> Callable[[], Iterator[int]]:
                ask = clients.enter_context(_client(port, app.token or ""))

                def is_seen() -> Iterator[int]:
                    yield ask("GET", "/api/find?name=cup")["total"]
                    box = "bbox=-10,-10,100,100&resolution=0.1&name=cup"
                    yield len(ask("GET", f"/api/shapes/things?{box}")["features"])

                return is_seen

            with ExitStack() as clients:
                count = _readers("server", reader, move, budget, share, findings, figures)
    path.unlink()
    return count


@contextmanager
def _client(port: int, token: str) -> Iterator[Callable[..., Any]]:
    """Yield a function that asks the server over a connection of its own."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=_PATIENCE)

    def ask(method: str, path: str, body: Any = None) -> Any:
        headers = {"X-Hypermap-Token": token, "Content-Type": "application/json"}
        connection.request(method, path, None if body is None else json.dumps(body), headers)
        answer = connection.getresponse()
        content = answer.read()
        if answer.status != 200:
            raise RuntimeError(f"{method} {path}: {answer.status} {content[:200]!r}")
        return json.loads(content)

    try:
        yield ask
    finally:
        connection.close()


def _readers(
    name: str,
    reader: Callable[[], Callable[[], Iterator[int]]],
    move: Callable[[Any], None],
    budget: Budget,
    share: float,
    findings: list[str],
    figures: dict[str, float | str],
) -> int:
    """Let readers count the cup while it is moved; return how many questions that were."""
    ends = threading.Event()
    counts, odd = [0] * READERS, []

    def ask(i: int, is_seen: Callable[[], Iterator[int]]) -> None:
        try:
            while not ends.is_set():
                for seen in is_seen():
                    counts[i] += 1
                    if seen != 1:
                        odd.append(f"seen {seen} times")
        except Exception as error:
            odd.append(f"{type(error).__name__}: {error}")

    seen = [reader() for _ in range(READERS)]
    threads = [threading.Thread(target=ask, args=pair) for pair in enumerate(seen)]
    for thread in threads:
        thread.start()
    moves, end = 0, time.monotonic() + share * budget.seconds
    try:
        while (moves < 40 or not all(counts)) if budget.short else time.monotonic() < end:
            if odd:
                break
            move(THERE if moves % 2 == 0 else HERE)
            moves += 1
    except Exception as error:
        odd.append(f"the writer: {type(error).__name__}: {error}")
    ends.set()
    for thread in threads:
        thread.join(_PATIENCE)
    if odd:
        findings.append(f"{name}: the object that is moved: {odd[0]} ({len(odd)} of these)")
    figures[f"{name}: questions"], figures[f"{name}: moves"] = sum(counts), moves
    return sum(counts)
