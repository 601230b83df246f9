"""A run as it is kept while a real mapper maps, and the server's answers about it."""

from __future__ import annotations

import io
import json
import logging
import shutil
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from starlette.testclient import TestClient

from hypermap.core.errors import HypermapError
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import COLORS, OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import MappedFrame, Mapper
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detectors.sources import detections_from_file
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.recordings import RecordingOptions, open_recording
from hypermap.viewer.watch.app import RunApp
from hypermap.viewer.watch.history import NoSuchStep
from hypermap.viewer.watch.objects import ObjectStates, changed_by
from hypermap.viewer.watch.observation import runs_of
from hypermap.viewer.watch.picture import picture_of
from hypermap.viewer.watch.run import ClientState, WatchedRun

from .run_tools import BLUE, CHAIR, CUP, EVIL, INTRINSICS, RED, SIZE, write_run

pytestmark = pytest.mark.xdist_group("watch_run")  # they share what takes long to make

FRAMES, CUP_FROM = 12, 6


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("recordings") / "drive", FRAMES, CUP_FROM)


class Seen:
    """What the mapper handed out, and the map."""

    def __init__(self) -> None:
        self.frames: list[MappedFrame] = []
        self.summary: list[list[tuple[int, int, float]]] = []
        self.map: Hypermap | None = None

    def objects(self) -> SemanticLayer:
        assert self.map is not None
        layer = self.map["semantic"]
        assert isinstance(layer, SemanticLayer)
        return layer


def mapped(
    drive: Path, run: WatchedRun, occupancy: OccupancyLayer | None = None, method: str = "default"
) -> Seen:
    """Map a recording, watched by a run."""
    seen = Seen()

    def watch(frame: MappedFrame, mapper: Mapper) -> None:
        seen.frames.append(frame)
        summary = mapper.evidence.summary()
        seen.summary.append([(id_, count, value) for id_, count, _, value in summary])
        run.watch(frame, mapper)

    recording = open_recording(drive, RecordingOptions(intrinsics=INTRINSICS))
    source = detections_from_file(drive / "detections.json")
    seen.map = map_recording(
        recording, source, profile(method), occupancy, run.progress, watch=watch
    )
    run.finish("saved room.hmap")
    return seen


@contextmanager
def a_run(folder: Path, **bounds: Any) -> Iterator[WatchedRun]:
    folder.mkdir(exist_ok=True)
    with closing(WatchedRun(folder, "drive", "room.hmap", FRAMES, **bounds)) as run:
        yield run


@pytest.fixture(scope="module")
def watched(
    drive: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[WatchedRun, Seen]]:
    with a_run(tmp_path_factory.mktemp("run")) as run:
        yield run, mapped(drive, run)


def step(run: WatchedRun, number: int, since: int | None = None) -> Any:
    return json.loads(run.step(number, since))


def mask_of(runs: list[int]) -> NDArray[np.bool_]:
    mask = np.zeros((SIZE[1], SIZE[0]), bool)
    for column, row, length in zip(runs[0::3], runs[1::3], runs[2::3], strict=True):
        mask[row, column : column + length] = True
    return mask


def test_each_step_tells_what_its_frame_saw(watched: tuple[WatchedRun, Seen]) -> None:
    run, seen = watched
    numbers = run.update_for(ClientState())[0]["steps"]["numbers"]
    assert numbers == list(range(1, FRAMES + 1))
    for number, frame in zip(numbers, seen.frames, strict=True):
        observation = step(run, number)["observation"]
        assert (observation["number"], observation["stamp"]) == (number, frame.observation.stamp)
        detections = observation["detections"]
        assert [found["name"] for found in detections] == [
            "chair",
            EVIL,
            *(["cup"] if number > CUP_FROM else []),
        ]
        assert detections[0]["box"] == list(CHAIR)
        by_detection = {
            thing.segment.detection: thing
            for thing in frame.observation.objects
            if thing.segment is not None
        }
        assert 0 in by_detection
        for place, found in enumerate(detections):
            thing = by_detection.get(place)
            if thing is None or thing.segment is None:
                assert (found["runs"], found["footprint"]) == ([], [])
                continue
            assert np.flatnonzero(mask_of(found["runs"])).tolist() == thing.segment.pixels.tolist()
            [[ring]] = found["footprint"]
            wanted = np.array(thing.footprint.exterior.coords)[:-1]
            np.testing.assert_allclose(ring, wanted, atol=6e-4)
        camera = observation["camera"]
        assert (camera["x"], camera["yaw"]) == (0.0, 0.0)
        assert camera["width"] == pytest.approx(2 * np.arctan(80 / 131.25), abs=1e-3)
        assert observation["observed"]


def test_the_objects_of_each_step_are_those_of_the_map_then(
    watched: tuple[WatchedRun, Seen],
) -> None:
    run, seen = watched
    names = []
    for number, summary in enumerate(seen.summary, start=1):
        reply = step(run, number)["objects"]
        assert reply["since"] is None
        assert [(id_, count, value) for id_, _, value, count, _ in reply["set"]] == summary
        names.append({name for _, name, *_ in reply["set"]})
    assert [("cup" in known) for known in names[:CUP_FROM]] == [False] * CUP_FROM
    assert names[-1] == {"chair", "cup"}

    saved = {thing.id: thing for thing in seen.objects().objects()}
    last = step(run, FRAMES)["objects"]["set"]
    assert {id_ for id_, *_ in last} == set(saved)
    for id_, name, existence, evidence, polygons in last:
        thing = saved[id_]
        assert (name, existence) == (thing.name, thing.existence)
        assert evidence == thing.attributes["evidence"]
        wanted = np.array(thing.footprint.exterior.coords)[:-1]
        np.testing.assert_allclose(polygons[0][0], wanted, atol=6e-4)


def test_a_step_may_be_reported_as_the_difference_to_any_other(
    watched: tuple[WatchedRun, Seen],
) -> None:
    run, _ = watched

    def whole(number: int) -> ObjectStates:
        return changed_by({}, step(run, number)["objects"])

    for since, number in [(1, 2), (9, 3), (3, 12), (7, 7)]:
        reply = step(run, number, since)["objects"]
        assert reply["since"] == since
        assert changed_by(whole(since), reply) == whole(number)
    assert step(run, 7, 7)["objects"]["set"] == []
    assert step(run, 7, 99)["objects"]["since"] is None  # there is no step 99


def test_pictures_are_those_of_the_camera_and_of_the_grid(watched: tuple[WatchedRun, Seen]) -> None:
    run, seen = watched
    with Image.open(io.BytesIO(run.picture(FRAMES))) as image:
        pixels = np.asarray(image).astype(int)
    assert pixels.shape == (SIZE[1], SIZE[0], 3)
    assert np.abs(pixels[60, 80] - RED).max() < 12
    assert np.abs(pixels[60, 28] - BLUE).max() < 12
    with Image.open(io.BytesIO(run.picture(1))) as image:
        assert np.abs(np.asarray(image)[60, 28].astype(int) - 128).max() < 12

    assert seen.map is not None
    grid = step(run, FRAMES)["observation"]["grid"]
    occupancy = seen.map["occupancy"]
    assert isinstance(occupancy, OccupancyLayer)
    assert occupancy.grid is not None
    assert occupancy.cells is not None
    with Image.open(io.BytesIO(run.grid(grid["number"]))) as image:
        shown = np.asarray(image.convert("RGB"))[::-1]  # row 0 of a picture is its top
    for value, label in [(100, "Occupied"), (-1, "Unknown")]:
        is_so = occupancy.cells == value
        assert is_so.any()
        assert (shown[is_so] == COLORS[label]).all()
        assert not (shown[~is_so] == COLORS[label]).all(axis=1).any()
    x0, y0, x1, y1 = grid["extent"]
    corners = occupancy.grid.corners()
    assert [x0, y0] == pytest.approx(corners.min(axis=0))
    assert [x1, y1] == pytest.approx(corners.max(axis=0))


def test_news_tell_what_is_new_once(watched: tuple[WatchedRun, Seen]) -> None:
    run, _ = watched
    news, heard = run.update_for(ClientState())
    assert (news["state"], news["message"]) == ("saved", "saved room.hmap")
    assert (news["total"], news["done"]) == (FRAMES, FRAMES)
    assert news["counts"] == {"used": FRAMES, "skipped": 0, "unusable": 0}
    assert set(news["colors"]) == {"chair", "cup", EVIL}
    assert len(news["steps"]["stamps"]) == len(news["steps"]["places"]) == FRAMES
    assert news["steps"]["objects"][-1] == 2
    again, _ = run.update_for(heard)
    assert "colors" not in again
    assert again["steps"]["numbers"] == []
    assert again["steps"]["first"] == FRAMES
    half, _ = run.update_for(heard._replace(steps=10))
    assert half["steps"]["numbers"] == [11, 12]
    thinned, _ = run.update_for(heard._replace(thinned=1))
    assert thinned["steps"]["first"] == 0
    assert len(thinned["steps"]["numbers"]) == FRAMES


def test_of_a_long_run_every_nth_frame_is_kept_and_the_last_one(
    drive: Path, tmp_path: Path
) -> None:
    with a_run(tmp_path / "run", most_steps=4) as run:
        seen = mapped(drive, run)
        news, _ = run.update_for(ClientState())
        numbers = news["steps"]["numbers"]
        assert news["stride"] == 4
        assert numbers[-1] == FRAMES
        assert len(numbers) < 4
        for number in numbers:
            reply = step(run, number)["objects"]["set"]
            kept = [(id_, count, value) for id_, _, value, count, _ in reply]
            assert kept == seen.summary[number - 1]
        assert step(run, numbers[-1] - 1)["observation"]["number"] == numbers[-2]
        with pytest.raises(NoSuchStep):
            run.step(numbers[0] - 1, None)


def test_watching_changes_nothing_in_the_map(drive: Path, tmp_path: Path) -> None:
    recording = open_recording(drive, RecordingOptions(intrinsics=INTRINSICS))
    source = detections_from_file(drive / "detections.json")
    for method in ("default", "thesis"):
        with a_run(tmp_path / method) as run:
            seen = mapped(drive, run, method=method)
        alone = map_recording(recording, source, profile(method))["semantic"]
        assert isinstance(alone, SemanticLayer)
        one, other = seen.objects().objects(), alone.objects()
        assert [(a.id, a.name, a.existence) for a in one] == [
            (b.id, b.name, b.existence) for b in other
        ]
        assert all(a.footprint.equals_exact(b.footprint) for a, b in zip(one, other, strict=True))


def test_a_given_grid_is_drawn_once(drive: Path, tmp_path: Path) -> None:
    cells = np.zeros((40, 60), np.int8)
    grid = OccupancyLayer("floor", "map", GridGeometry(60, 40, 0.1), cells)
    with a_run(tmp_path / "run") as run:
        mapped(drive, run, grid)
        shown = [
            step(run, number)["observation"]["grid"]["number"] for number in range(1, FRAMES + 1)
        ]
    assert shown == [1] * FRAMES
    assert len(list((tmp_path / "run").glob("*.png"))) == 1


def test_a_full_disk_ends_what_is_kept_and_not_the_mapping(
    drive: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with a_run(tmp_path / "run") as run:
        shutil.rmtree(tmp_path / "run")
        with caplog.at_level(logging.WARNING):
            seen = mapped(drive, run)
        assert len(seen.objects()) == 2
        assert len(seen.frames) == FRAMES
        assert run.update_for(ClientState())[0]["steps"]["numbers"] == []
    assert sum("cannot be recorded" in text for text in caplog.messages) == 1


def frame_of(width: int, height: int, **parts: Any) -> RgbdFrame:
    camera = Camera.from_intrinsics(width, width, width / 2, height / 2, width, height)
    depth = np.full((height, width), 2.0, np.float32)
    return replace(RgbdFrame(1.0, depth, camera, np.eye(4)), **parts)


def test_a_large_image_is_made_smaller_and_segments_with_it() -> None:
    color = np.zeros((960, 1280, 3), np.uint8)
    color[:, 640:] = 200
    picture = picture_of(frame_of(1280, 960, color=color))
    assert (picture.width, picture.height, picture.reduced_by) == (640, 480, 2)
    with Image.open(io.BytesIO(picture.content)) as image:
        pixels = np.asarray(image)
    assert pixels[100, 300].max() < 8
    assert pixels[100, 340].min() > 190
    columns, rows = np.meshgrid(np.arange(10, 15), np.arange(4, 8))
    square = (rows * 1280 + columns).ravel()
    assert runs_of(square, (960, 1280), 2) == [5, 2, 3, 5, 3, 3]
    assert runs_of(np.array([1]), (960, 1280), 2) == []


def test_depth_is_shown_where_there_is_no_color_and_where_that_is_broken(
    caplog: pytest.LogCaptureFixture,
) -> None:
    depth = np.full((60, 80), 0.5, np.float32)
    depth[:, 40:] = 6.0
    depth[:30] = np.nan

    def broken() -> NDArray[np.uint8]:
        raise HypermapError("color.png: cannot be read")

    for frame in (frame_of(80, 60, depth=depth), frame_of(80, 60, depth=depth, color=broken)):
        picture = picture_of(frame)
        assert picture.kind == "depth"
        with Image.open(io.BytesIO(picture.content)) as image:
            pixels = np.asarray(image).astype(int)
        assert pixels[10].max() < 25  # no return is black
        near, far = pixels[50, 10], pixels[50, 70]
        assert near.min() > 200 > 120 > far.max() > 45
    assert "color.png: cannot be read" in caplog.text


# The server


@pytest.fixture
def client(watched: tuple[WatchedRun, Seen]) -> Iterator[TestClient]:
    app = RunApp(watched[0])
    app.is_closing = True  # so that news end after the first
    with TestClient(app.app, base_url="http://127.0.0.1") as client:
        assert client.get("/api/run").status_code == 403
        client.get("/", params={"token": app.token})
        yield client


def test_the_server_answers_what_the_page_asks(
    client: TestClient, watched: tuple[WatchedRun, Seen]
) -> None:
    run, _ = watched
    info = client.get("/api/run").json()
    assert (info["recording"], info["output"]) == ("drive", "room.hmap")
    answer = client.get("/api/steps/8", params={"since": 7})
    assert answer.content == run.step(8, 7)
    picture = client.get("/api/pictures/8.jpg", params={"run": info["id"]})
    assert picture.content == run.picture(8)
    assert picture.headers["Content-Type"] == "image/jpeg"
    assert "immutable" in picture.headers["Cache-Control"]
    number = answer.json()["observation"]["grid"]["number"]
    grid = client.get(f"/api/grids/{number}.png")
    assert grid.content == run.grid(number)
    assert grid.headers["Cache-Control"] == "no-store"  # it may be another run's later
    news = client.get("/api/events")
    assert news.headers["Content-Type"].startswith("text/event-stream")
    assert news.headers["X-Accel-Buffering"] == "no"  # of nginx
    reply = json.loads(news.text.removeprefix("data: "))
    assert reply["run"] == info["id"]
    assert reply["steps"]["numbers"] == list(range(1, FRAMES + 1))


@pytest.mark.parametrize(
    ("path", "status", "reason"),
    [
        ("/api/steps/0", 404, "there is no step 0"),
        ("/api/steps/x", 400, "number: a whole number is expected"),
        ("/api/steps/1?since=x", 400, "since: a whole number is expected"),
        ("/api/pictures/99.jpg", 404, "there is no 99.jpg"),
        ("/api/grids/99.png", 404, "there is no 99.png"),
        ("/api/pictures/..%2F1.jpg", 404, ""),
        ("/page/secret.txt", 404, "there is no page"),
    ],
)
def test_what_is_not_there_is_said_so(
    client: TestClient, path: str, status: int, reason: str
) -> None:
    answer = client.get(path)
    assert answer.status_code == status
    assert reason in answer.json()["error"]


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Origin": "http://evil.example"},
        {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "cors"},
    ],
)
def test_other_sites_are_kept_out(client: TestClient, headers: dict[str, str]) -> None:
    for path in ("/api/run", "/api/steps/1", "/api/pictures/1.jpg", "/api/events"):
        assert client.get(path, headers=headers).status_code == 403


def test_the_cup_is_boxed_where_it_is(watched: tuple[WatchedRun, Seen]) -> None:
    found = {d["name"]: d for d in step(watched[0], FRAMES)["observation"]["detections"]}
    assert found["cup"]["box"] == list(CUP)
    rows, columns = np.nonzero(mask_of(found["cup"]["runs"]))
    assert columns.min() >= CUP[0]
    assert columns.max() < CUP[2]
    assert len(rows) > 200
