"""Logs for Rerun and Foxglove, read back with the readers of those two."""

from __future__ import annotations

import contextlib
import io
import itertools
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import mcap.reader
import numpy as np
import pytest
import shapely
from mcap_protobuf.decoder import DecoderFactory
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from hypermap.colors import class_colors
from hypermap.core.errors import HypermapError, MissingExtra
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.mapping.alignment import Aligner
from hypermap.mapping.config import profile
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detectors import sources
from hypermap.simulation import SimulatedRecording, demo_world
from hypermap.testing.builders import occupancy_from_text, square
from hypermap.viewer.logs.log import LoggedMapping, open_log

from ..ros.foxglove_client import Client

pytestmark = pytest.mark.xdist_group("logs")  # they share what takes long to make

rerun_chunk = pytest.importorskip("rerun.chunk", reason="Rerun needs Python 3.11")
FRAMES = 3
ROOM = """
????
?#.?
?..?
????
"""


def small_map() -> Hypermap:
    """A grid of half a meter a cell; a chair and a table in a frame that is turned and moved."""
    grid = occupancy_from_text(ROOM, 0.5, Pose2D(-1.0, 2.0, 0.0))
    objects = SemanticLayer("things", "desk", [square("chair", 1, 0), square("table", 3, 0, 2.0)])
    turned = Transform("map", "desk", Pose2D(5.0, 1.0, np.pi / 2))
    return Hypermap([grid, objects], FrameTree([turned]))


class FirstFrames:
    """The beginning of a simulated drive, the same every time."""

    def __init__(self) -> None:
        self.drive = SimulatedRecording(demo_world(), rate=0.5, seed=3)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.drive, name)

    def __len__(self) -> int:
        return FRAMES

    def frames(self, on_bad: Any = None) -> Iterator[Any]:
        return itertools.islice(self.drive.frames(), FRAMES)

    def mapped_frames(self) -> list[Any]:
        """The frames with their poses as they are corrected by the map."""
        aligner = Aligner(self.drive.occupancy(), profile("default").alignment)
        return [aligner.align(frame) for frame in self.frames()]


def log_mapping(path: Path) -> Hypermap:
    log = open_log(str(path), "demo")
    source = sources.detections_from_recording()
    made = map_recording(FirstFrames(), source, profile("default"), watch=LoggedMapping(log))
    log.close()
    return made


def log_map(path: Path) -> Path:
    log = open_log(str(path), "small")
    log.add_map(small_map())
    log.close()
    return path


def messages(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Return the times [ns] and messages of each topic of an MCAP file."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with path.open("rb") as stream:
        reader = mcap.reader.make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, decoded))
    return found


def columns(path: Path, entity: str) -> dict[str, list[Any]]:
    """Return what Rerun's reader finds of an entity: the rows of each of its columns."""
    found: dict[str, list[Any]] = {}
    for chunk in rerun_chunk.RrdReader(path).store().stream():
        if chunk.entity_path == entity:
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                found.setdefault(name.split(":")[-1], []).extend(batch[name].to_pylist())
    return found


def area_of_triangles(corners: NDArray[np.float64]) -> float:
    return sum(shapely.Polygon(three[:, :2]).area for three in corners.reshape(-1, 3, 3))


@pytest.fixture(scope="module")
def mcap_of_mapping(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Hypermap]:
    path = tmp_path_factory.mktemp("mcap") / "demo.mcap"
    made = log_mapping(path)
    return messages(path), made


@pytest.fixture(scope="module")
def rrd_of_mapping(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rrd") / "demo.rrd"
    log_mapping(path)
    return path


def test_the_grid_lies_in_foxglove_where_it_lies_in_the_map(tmp_path: Path) -> None:
    found = messages(log_map(tmp_path / "small.mcap"))
    ((time, grid),) = found["/map/occupancy"]
    assert time == 0
    assert grid.frame_id == "map"
    assert (grid.pose.position.x, grid.pose.position.y) == (-0.5, 2.5)  # without unknown cells
    assert (grid.cell_size.x, grid.column_count) == (0.5, 2)
    cells = np.frombuffer(grid.data, np.uint8).reshape(2, 2, 4)
    assert cells[1, 0, :3].max() < 130  # occupied: darker, and above
    assert cells[0].min() == 255
    assert cells[1, 1].min() == 255


def test_objects_lie_in_foxglove_where_they_lie_in_the_map(tmp_path: Path) -> None:
    found = messages(log_map(tmp_path / "small.mcap"))
    ((_, update),) = found["/map/things"]
    (entity,) = update.entities
    corners = np.array([(p.x, p.y, p.z) for p in entity.triangles[0].points])
    assert area_of_triangles(corners) == pytest.approx(1 + 4)
    # The frame "desk" lies at (5, 1) and is turned to the left, so (1, 0) there is (5, 2) here.
    assert corners[:, :2].min(axis=0) == pytest.approx([4, 1.5])
    assert corners[:, :2].max(axis=0) == pytest.approx([6, 5])
    places = {text.text: text.pose.position for text in entity.texts}
    assert (places["chair"].x, places["chair"].y) == pytest.approx((5, 2))
    assert (places["table"].x, places["table"].y) == pytest.approx((5, 4))
    color = entity.triangles[0].colors[0]
    assert (color.r, color.g, color.b) == pytest.approx(
        class_colors(["chair", "table"])["chair"], abs=1 / 255
    )
    ((_, frames),) = found["/tf"]
    (transform,) = frames.transforms
    assert (transform.parent_frame_id, transform.child_frame_id) == ("map", "desk")
    assert (transform.rotation.z, transform.rotation.w) == pytest.approx((0.5**0.5, 0.5**0.5))


def test_foxglove_gets_what_each_frame_showed(mcap_of_mapping: tuple[Any, Hypermap]) -> None:
    found, _ = mcap_of_mapping
    frames = FirstFrames().mapped_frames()
    assert [time for time, _ in found["/camera/color"]] == [round(1e9 * f.stamp) for f in frames]
    for i, frame in enumerate(frames):
        color = np.asarray(Image.open(io.BytesIO(found["/camera/color"][i][1].data)))
        assert np.abs(color.astype(int) - frame.color).mean() < 6
        depth = np.frombuffer(found["/camera/depth"][i][1].data, "<u2").reshape(frame.depth.shape)
        known = np.isfinite(frame.depth)
        assert np.array_equal(depth > 0, known)
        assert np.abs(depth[known] / 1000 - frame.depth[known]).max() <= 0.0005 + 1e-6
        (transform,) = found["/tf"][i][1].transforms
        assert (transform.parent_frame_id, transform.child_frame_id) == ("map", "camera")
        turn = transform.rotation
        rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
        assert rotation == pytest.approx(frame.map_T_camera[:3, :3], abs=1e-9)
        boxes = found["/camera/detections"][i][1].points
        corners = [[b.points[0].x, b.points[0].y, b.points[2].x, b.points[2].y] for b in boxes]
        expected = frame.detections.xyxy[frame.detections.scores >= 0]
        assert np.array(corners).reshape(-1, 4) == pytest.approx(expected, abs=1e-3)


def test_foxglove_sees_the_map_grow(mcap_of_mapping: tuple[Any, Hypermap]) -> None:
    found, made = mcap_of_mapping
    assert len(found["/map/semantic"]) == FRAMES
    counts = [len(update.entities[0].texts) for _, update in found["/map/semantic"]]
    assert counts == sorted(counts)
    last = found["/map/semantic"][-1][1].entities[0]
    layer = made["semantic"]
    assert isinstance(layer, SemanticLayer)
    assert sorted(text.text for text in last.texts) == sorted(layer.names)
    corners = np.array([(p.x, p.y, p.z) for p in last.triangles[0].points]).reshape(-1, 3)
    assert area_of_triangles(corners) == pytest.approx(
        sum(thing.footprint.area for thing in layer.objects()), rel=1e-4
    )
    seen, area = found["/seen"][0][1].entities
    assert seen.texts
    assert shapely.Polygon([(p.x, p.y) for p in area.lines[0].points]).area > 1


def test_foxglove_looks_on_over_a_websocket() -> None:
    from hypermap.viewer.logs.foxglove_log import FoxgloveLog

    log = FoxgloveLog(None, "small", port=0)
    assert log.url is not None
    with contextlib.closing(log), Client(log.url) as client:
        log.add_map(small_map())  # makes the channels known
        client.subscribe("/map/occupancy")

        def heard() -> bool:
            log.add_map(small_map(), stamp=5.0)
            return bool(client.messages)

        client.wait(heard, "the map")
    assert client.stamps[0] == 5_000_000_000
    assert b"map" in client.messages[0][1]


def test_the_grid_lies_in_rerun_where_it_lies_in_the_map(tmp_path: Path) -> None:
    grid = columns(log_map(tmp_path / "small.rrd"), "/map/occupancy")
    assert grid["cell_size"] == [[0.5]]
    assert grid["translation"] == [[[-0.5, 2.5, 0.0]]]
    ((image,),) = grid["data"]
    pixels = np.array(image, np.uint8).reshape(2, 2, 3)
    assert pixels[0, 0].max() < 130  # an image's first row is the upper one
    assert pixels[1].min() == pixels[0, 1].min() == 255


def test_objects_lie_in_rerun_where_they_lie_in_the_map(tmp_path: Path) -> None:
    path = log_map(tmp_path / "small.rrd")
    ((*corners,),) = columns(path, "/map/things/fills")["vertex_positions"]
    assert area_of_triangles(np.array(corners)) == pytest.approx(1 + 4)
    names = columns(path, "/map/things/names")
    assert names["labels"] == [["chair", "table"]]
    assert np.array(names["positions"][0])[:, :2] == pytest.approx(np.array([[5, 2], [5, 4]]))
    assert columns(path, "/map/frames/desk")["translation"] == [[[5.0, 1.0, 0.0]]]


def test_rerun_gets_what_each_frame_showed(rrd_of_mapping: Path) -> None:
    frames = FirstFrames().mapped_frames()
    detections = columns(rrd_of_mapping, "/camera/image/detections")
    assert [len(labels) for labels in detections["labels"]] == [len(f.detections) for f in frames]
    poses = columns(rrd_of_mapping, "/camera")["translation"]
    for (place,), frame in zip(poses, frames, strict=True):
        assert place == pytest.approx(frame.map_T_camera[:3, 3])
    ((blob,), *_) = columns(rrd_of_mapping, "/camera/image/color")["blob"]
    color = np.asarray(Image.open(io.BytesIO(bytes(blob))))
    assert np.abs(color.astype(int) - frames[0].color).mean() < 6
    depth = columns(rrd_of_mapping, "/camera/image/depth")
    assert depth["meter"][0] == [1000.0]
    ((first,), *_) = depth["buffer"]
    in_millimetres = np.frombuffer(bytes(first), "<u2").reshape(frames[0].depth.shape)
    known = np.isfinite(frames[0].depth)
    assert np.abs(in_millimetres[known] / 1000 - frames[0].depth[known]).max() <= 0.0005 + 1e-6
    assert len(columns(rrd_of_mapping, "/map/semantic/names")["positions"]) == FRAMES


def test_no_website_looks_on_at_foxgloves_log() -> None:
    pytest.importorskip("foxglove")
    from hypermap.viewer.logs.foxglove_log import FoxgloveLog

    log = FoxgloveLog(None, "lab", port=0)
    with contextlib.closing(log):
        assert log.url is not None
        address = urlsplit(log.url)
        assert address.hostname is not None
        assert address.port is not None
        with socket.create_connection((address.hostname, address.port), timeout=120) as one:
            one.sendall(f"GET / HTTP/1.1\r\nHost: {address.netloc}\r\n".encode())
            one.sendall(b"Origin: https://evil.example\r\n\r\n")
            assert one.recv(12) == b"HTTP/1.1 403"


def test_a_log_of_unknown_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(HypermapError, match=r"lab\.txt: a log is a file ending with \.rrd"):
        open_log(str(tmp_path / "lab.txt"), "lab")


@pytest.mark.parametrize("name", ["map.mcap", "map.rrd"])
def test_a_log_that_cannot_be_written_is_an_error(tmp_path: Path, name: str) -> None:
    with pytest.raises(HypermapError, match="missing: there is no such folder to save in"):
        open_log(str(tmp_path / "missing" / name), "lab")


FULL_DISK = """
import resource, signal, sys
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.testing import square
from hypermap.viewer.logs.log import open_log
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
log = open_log(sys.argv[1], "lab")
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.RLIM_INFINITY))
cups = [square("cup", 0.001 * number**2, 0) for number in range(2000)]
log.add_map(Hypermap([SemanticLayer("objects", "map", cups)]))
try:
    log.close()
except HypermapError as error:
    print(error)
"""


@pytest.mark.parametrize("name", ["map.mcap", "map.rrd"])
def test_a_full_disk_is_said_and_leaves_the_old_log(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"old")
    command = [sys.executable, "-c", FULL_DISK, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert f"{path}: the log could not be written; is the disk full? (" in done.stdout
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("library", "target"), [("rerun", "map.rrd"), ("foxglove", "map.mcap")])
def test_a_missing_library_names_its_extra(
    library: str, target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in [name for name in sys.modules if name.startswith("hypermap.viewer.logs.")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingExtra, match=rf"pip install 'hypermap\[{library}\]'"):
        open_log(str(tmp_path / target), "lab")
