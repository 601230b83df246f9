"""What is fuzzed: each place where bytes of strangers come in, and examples of what is right."""

from __future__ import annotations

import asyncio
import contextlib
import importlib
import io
import itertools
import json
import logging
import random
import shutil
import socket
import threading
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import numpy as np

from campaign.in_process_port import InProcessPort
from campaign.mutation import (
    Mutator,
    joined,
    mutate_archive,
    mutate_bytes,
    mutate_parts,
    mutate_png,
    mutate_text,
    parted,
)
from campaign.questions import ask_everything
from hypermap import (
    HypermapError,
    SemanticLayer,
    SemanticObject,
    open_map,
    save_map,
    to_geojson,
)
from hypermap.console.commands import Console, Leave
from hypermap.console.places import parse_area, parse_point
from hypermap.core.evidence import EvidenceTable
from hypermap.core.hypermap import Hypermap
from hypermap.formats.any_file import open_any
from hypermap.formats.columns.footprints import footprint_from_wkt
from hypermap.formats.config import CONFIG_NAME
from hypermap.formats.grid.pgm import dump_trinary
from hypermap.formats.hmap import _write_map  # the files of an archive, without the archive
from hypermap.formats.semantic.evidence_file import dump_evidence, parse_evidence
from hypermap.formats.semantic.parquet_files import dump_parquet
from hypermap.formats.semantic.yaml_files import dump_objects
from hypermap.perception.detectors.recorded import RecordedDetections
from hypermap.recordings.open import open_recording
from hypermap.recordings.options import RecordingOptions
from hypermap.testing import square


@dataclass(frozen=True)
class Target:
    """A place where bytes come in.

    Attributes:
        ask: takes the bytes. What it raises but HypermapError is a finding.
        corpus: examples of what is right.
        mutate: spoils an example.
    """

    ask: Callable[[bytes], object]
    corpus: Sequence[bytes]
    mutate: Mutator


Maker = Callable[[Path], Target]


def _tests(module: str) -> Any:
    """Return a module of the tests, whose builders make examples."""
    return importlib.import_module(f"tests.{module}")


def _draw(data: bytes) -> random.Random:
    """Return luck that the same bytes have again."""
    return random.Random(data[:4096])


# Maps


def _map() -> Hypermap:
    """Return a map with a turned layer, a hole, evidence, and names that are no plain words."""
    made: Hypermap = _tests("viewer.seen_map").seen_map(is_turned=True)
    layer = made["semantic"]
    assert isinstance(layer, SemanticLayer)
    return made


def _evidence() -> EvidenceTable:
    table: EvidenceTable = _tests("viewer.seen_map").evidence()
    return table


def _layer() -> SemanticLayer:
    layer = _tests("viewer.live_tools").a_map()["things"]
    assert isinstance(layer, SemanticLayer)
    return layer


def _folder_of_map(folder: Path) -> dict[str, bytes]:
    """Return the files of a map that lies in a folder."""
    folder.mkdir()
    save_map(_map(), folder / "map.yaml")
    files = {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
    shutil.rmtree(folder)
    return files


def _open_and_ask(path: Path, data: bytes, *, saves: bool = False) -> None:
    hypermap = open_any(path)
    ask_everything(hypermap, _draw(data))
    if saves:  # what opened can be saved, and opened again
        again = path.with_name("again.hmap")
        save_map(hypermap, again)
        open_map(again)


def _file_target(name: str, corpus: Sequence[bytes], mutate: Mutator, folder: Path) -> Target:
    path = folder / name

    def ask(data: bytes) -> None:
        path.write_bytes(data)
        _open_and_ask(path, data, saves=True)

    return Target(ask, corpus, mutate)


def archive(folder: Path) -> Target:
    """A whole map in an archive, of which all questions are asked."""
    corpus = []
    for number, (made, form) in enumerate(
        ((_map(), "auto"), (_map(), "parquet"), (_tests("viewer.live_tools").a_map(), "yaml"))
    ):
        path = folder / f"{number}.hmap"
        save_map(made, path, form)  # type: ignore[arg-type]
        corpus.append(path.read_bytes())
    return _file_target("map.hmap", corpus, mutate_archive, folder)


def _files_target(parts: dict[str, bytes], name: str, folder: Path) -> Target:
    """Return a target of several files in a folder, of which each is spoiled in turn."""

    def ask(data: bytes) -> None:
        place = folder / "files"
        write_parts(place, data)
        _open_and_ask(place / name, data)

    return Target(ask, [joined(parts)], mutate_parts)


def write_parts(place: Path, data: bytes) -> None:
    """Write the files of `joined` into an empty folder, but none beside it."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    for name, content in parted(data).items():
        with contextlib.suppress(OSError, ValueError):
            path = place / name
            if ".." not in path.parts and path.is_relative_to(place) and path != place:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)


def config(folder: Path) -> Target:
    """A map in a folder: the configuration and all that it names."""
    return _files_target(_folder_of_map(folder / "made"), "map.yaml", folder)


def map_server(folder: Path) -> Target:
    """A map of ROS: YAML and a PGM picture."""
    layer = _tests("viewer.live_tools").a_map().layers[0]
    return _files_target(dump_trinary(layer, "map"), "map.yaml", folder)


def png(folder: Path) -> Target:
    """The picture of an occupancy layer, in each of the kinds that are read."""
    from PIL import Image

    parts = _folder_of_map(folder / "made")
    described = next(c for n, c in parts.items() if n.endswith(".yaml") and b"image:" in c)
    corpus = [next(content for name, content in parts.items() if name.endswith(".png"))]
    gray = np.arange(48, dtype=np.uint8).reshape(6, 8) * 5
    for mode, kind in (("L", "PNG"), ("LA", "PNG"), ("P", "PNG"), ("1", "PNG"), ("RGBA", "PNG")):
        written = io.BytesIO()
        Image.fromarray(gray).convert(mode).save(written, kind)
        corpus.append(written.getvalue())
    for kind in ("PPM", "BMP", "GIF", "TGA", "TIFF", "JPEG"):
        written = io.BytesIO()
        Image.fromarray(gray).save(written, kind)
        corpus.append(written.getvalue())
    path = folder / "map.yaml"
    path.write_bytes(
        b"image: picture\n"
        + b"\n".join(line for line in described.splitlines() if not line.startswith(b"image:"))
    )

    def ask(data: bytes) -> None:
        (folder / "picture").write_bytes(data)
        _open_and_ask(path, data)

    return Target(ask, corpus, mutate_png)


def semantic_yaml(folder: Path) -> Target:
    """A list of objects in YAML."""
    corpus = [dump_objects(_layer()), dump_objects(_map().semantic("semantic"))]
    return _file_target("objects.yaml", corpus, mutate_text, folder)


def geojson(folder: Path) -> Target:
    """Objects in GeoJSON."""
    return _file_target("objects.geojson", [to_geojson(_layer()).encode()], mutate_text, folder)


def geoparquet(folder: Path) -> Target:
    """Objects in GeoParquet."""
    corpus = [dump_parquet(_layer().table, "map")]
    return _file_target("objects.parquet", corpus, mutate_bytes, folder)


def wkt(_: Path) -> Target:
    """A shape as text, in a file and at the console."""
    texts = [item.footprint.wkt for item in _layer()]
    texts += ["POLYGON((0 0, 1 0, 1 1))", "MULTIPOLYGON(((0 0,1 0,1 1,0 0)),((5 5,6 5,6 6,5 5)))"]
    texts += ["1,2,3,4", "0,0,1,0,1,1", "POLYGON Z((0 0 0,1 0 0,1 1 0,0 0 0))", "POINT(1 2)"]

    def ask(data: bytes) -> None:
        text = data.decode(errors="surrogateescape")
        hypermap = Hypermap([SemanticLayer("semantic", "map", [square("cup", 0, 0)])])
        with contextlib.suppress(ValueError, TypeError):  # as they say
            shape = footprint_from_wkt(text)
            hypermap.semantic("semantic").add(SemanticObject("thing", shape))
            ask_everything(hypermap, _draw(data))
        with contextlib.suppress(HypermapError):
            parse_point(text, "--at")
        area = parse_area(text, "--in")
        hypermap.labels_in("semantic", area)
        hypermap.objects(inside=area, near=area)

    return Target(ask, [text.encode() for text in texts], mutate_text)


def evidence(folder: Path) -> Target:
    """What objects were made of, alone and behind the objects of a map."""
    packed = dump_evidence(_evidence())
    members = _write_map(_map(), CONFIG_NAME, "auto")
    name = next(name for name, content in members.items() if content == packed)
    path = folder / "map.hmap"

    def ask(data: bytes) -> None:
        with contextlib.suppress(HypermapError):
            parse_evidence(data, "evidence")
        with zipfile.ZipFile(path, "w") as archive:
            for member, content in {**members, name: data}.items():
                archive.writestr(member, content)
        _open_and_ask(path, data, saves=True)

    return Target(ask, [packed], _mutate_packed)


def _mutate_packed(data: bytes, draw: random.Random) -> bytes:
    """Spoil what is within gzip, or the gzip itself."""
    import gzip

    if data[:2] == b"\x1f\x8b" and draw.random() < 0.8:
        with contextlib.suppress(OSError, EOFError, ValueError):
            return gzip.compress(mutate_text(gzip.decompress(data), draw), mtime=0)
    return mutate_text(data, draw) if data[:1] == b"{" else mutate_bytes(data, draw)


# Recordings


def _read_recording(path: Path) -> None:
    recording = open_recording(path, RecordingOptions(intrinsics=(26.0, 27.0, 15.5, 11.25)))
    recording.info()
    with contextlib.suppress(HypermapError):
        recording.occupancy()
    len(recording)
    problems: list[HypermapError] = []
    for frame in itertools.islice(recording.frames(lambda _, e: problems.append(e)), 3):
        with contextlib.suppress(HypermapError):
            frame.color  # noqa: B018 - is decoded when it is asked for


def _recording_folder(kind: str, folder: Path) -> Target:
    shots = _tests("recordings.shots")
    made = getattr(shots, f"write_{kind}")(folder / "made", shots.make_shots(3))
    parts = {str(p.relative_to(made)): p.read_bytes() for p in made.rglob("*") if p.is_file()}

    def ask(data: bytes) -> None:
        write_parts(folder / "files", data)
        _read_recording(folder / "files")

    return Target(ask, [joined(parts)], mutate_parts)


def _bag(kind: str, folder: Path) -> Target:
    builder, shots = _tests("recordings.bag_builder"), _tests("recordings.shots")
    (folder / "made").mkdir()
    made = builder.write_bag(folder / "made", kind, shots.make_shots(2))
    if made.is_file():
        path = folder / "files.bag"

        def ask(data: bytes) -> None:
            path.write_bytes(data)
            _read_recording(path)

        return Target(ask, [made.read_bytes()], mutate_bytes)
    parts = {p.name: p.read_bytes() for p in sorted(made.iterdir())}

    def ask_folder(data: bytes) -> None:
        write_parts(folder / "files", data)
        _read_recording(folder / "files")

    return Target(ask_folder, [joined(parts)], mutate_parts)


# What detectors say


def detections(folder: Path) -> Target:
    """Recorded detections."""
    path = folder / "detections.json"
    box = {"box": [1.0, 2.0, 5.5, 6.0], "name": "cup", "score": 0.5}
    masked = {**box, "mask": {"size": [4, 6], "counts": [5, 3, 16]}}
    corpus = [
        {"image_size": [640, 480], "frames": {"1.5": [box, box], "2.5": []}},
        {"image_size": [6, 4], "frames": {"1.25": [masked, masked]}},
        {"frames": {"1.25": [masked]}},
    ]

    def ask(data: bytes) -> None:
        path.write_bytes(data)
        recorded = RecordedDetections.load(path)
        for stamp in recorded.stamps[:3]:
            recorded.at(stamp)
        recorded.save(folder / "again.json")

    return Target(ask, [json.dumps(each).encode() for each in corpus], mutate_text)


def onnx(folder: Path) -> Target:
    """The notes that stand in a network: names of classes, sizes, what it is for."""
    import onnx as library
    from onnx import helper, numpy_helper

    from hypermap.perception.detectors.load import load_detector

    table = np.array([[[23.2, 23.2, 40.8, 40.8, 0.2, 0]]], np.float32)
    graph = helper.make_graph(
        [helper.make_node("Identity", ["found"], ["output0"])],
        "network",
        [helper.make_tensor_value_info("images", library.TensorProto.FLOAT, (1, 3, "h", "w"))],
        [helper.make_tensor_value_info("output0", library.TensorProto.FLOAT, None)],
        [numpy_helper.from_array(table, "found")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path = folder / "network.onnx"
    notes = {"names": "{0: 'chair', 1: 'cup'}", "task": "detect", "imgsz": "[64, 64]"}
    notes |= {"stride": "32", "end2end": "True"}
    image = np.zeros((48, 64, 3), np.uint8)

    def ask(data: bytes) -> None:
        given = {name: content.decode(errors="replace") for name, content in parted(data).items()}
        helper.set_model_props(model, given)
        path.write_bytes(model.SerializeToString())
        load_detector(path, threads=1).detect(image)

    corpus = [joined({name: text.encode() for name, text in notes.items()})]
    return Target(ask, corpus, mutate_parts)


# Nodes and servers


def ros_messages(folder: Path) -> Target:
    """Requests to the map server's services and messages on its topics, as CDR."""
    from hypermap.ros import typestore
    from hypermap.ros.server.map_server import MapServer

    path = folder / "map.hmap"
    made = _tests("viewer.live_tools").a_map()
    for layer in made:
        layer.settings.update(subscribe_mode=True, publish_global_topics=True)
    save_map(made, path)
    (folder / "maps").mkdir()
    port = InProcessPort({"console": False, "map_directory": str(folder / "maps")})

    def server() -> None:
        port.services.clear()
        port.topics.clear()
        node = MapServer(port, path)  # type: ignore[arg-type]
        node.configure()
        node.activate()

    server()
    ways: list[tuple[str, str]] = [("service", name) for name in sorted(port.services)]
    ways += [("topic", name) for name in sorted(port.topics)]

    def ask(data: bytes) -> None:
        if not data:
            return
        kind, name = ways[data[0] % len(ways)]
        try:
            (port.services if kind == "service" else port.topics)[name](data[1:])
        finally:
            if kind == "topic" or name in ("clear", "load_map", "store_map"):
                server()  # the map as it was

    message = _tests("ros.message_builder")
    types = _CdrTypes()
    layer_point = {"layer": "things", "location": types.stamped_point(8.0, 5.0)}
    area = message.area(types, message.SQUARE, "map")
    requests = {
        "get_string_at_point": ("hypermap_msgs/GetStringAtPoint", layer_point),
        "get_int_at_point": ("hypermap_msgs/GetIntAtPoint", layer_point),
        "get_strings_by_area": (
            "hypermap_msgs/GetStringsByArea",
            {"layer": "things", "area": area},
        ),
        "get_ints_by_area": ("hypermap_msgs/GetIntsByArea", {"layer": "things", "area": area}),
        "get_locations_by_string": (
            "hypermap_msgs/GetLocationsByString",
            {"layer": "things", "name": "cup", "area": area},
        ),
        "get_semantic_by_area": ("hypermap_msgs/GetSemanticByArea", {"area": area}),
        "get_semantic_by_string": ("hypermap_msgs/GetSemanticByString", {"name": "cup"}),
        "load_map": ("hypermap_msgs/LoadMap", {"filename": "x.hmap"}),
        "store_map": ("hypermap_msgs/StoreMap", {"filename": "x.hmap"}),
        "get_layers_at_point": ("hypermap_msgs/GetLayersAtPoint", {}),
        "get_hits_in_areas": ("hypermap_msgs/GetHitsInAreas", {}),
        "find_objects": ("hypermap_msgs/FindObjects", {}),
    }
    corpus = []
    for number, (kind, name) in enumerate(ways):
        if kind == "service" and name in requests:
            type_name, fields = requests[name]
            known = typestore.request_class(type_name)()
            for key, value in fields.items():
                if hasattr(known, key):
                    setattr(known, key, value)
            corpus.append(bytes([number]) + typestore.encode(known))
        elif kind == "topic":
            corpus.append(bytes([number]) + typestore.encode(_example_of(name, types)))
    return Target(ask, corpus, mutate_bytes)


class _CdrTypes:
    """The message classes that need no ROS."""

    def message(self, type_name: str) -> type[Any]:
        from hypermap.ros.typestore import message_class

        return message_class(type_name)

    def sent(self, message: Any) -> Any:
        return message

    def stamp(self, nanoseconds: int) -> Any:
        from hypermap.ros.typestore import stamp

        return stamp(nanoseconds)

    def stamped_point(self, x: float, y: float) -> Any:
        message = self.message("geometry_msgs/PointStamped")()
        message.header.frame_id = "map"
        message.point.x, message.point.y = x, y
        return message


def _example_of(topic: str, types: _CdrTypes) -> Any:
    """Return a message for a topic of the map server."""
    from hypermap.ros.messages.semantic_messages import semantic_map
    from hypermap.ros.messages.to_messages import occupancy_grid

    made = _tests("viewer.live_tools").a_map()
    objects = semantic_map(made["things"], types, 0)
    if topic == "/map":
        return occupancy_grid(made.layers[0], types, 0)
    if topic == "/semantic_map":
        return objects
    if "semmap" in topic or "semantic" in topic:
        update = types.message("hypermap_msgs/SemanticMapUpdate")()
        update.to_add, update.to_modify = list(objects.objects)[:1], np.array([1], np.uint32)
        update.updates, update.to_delete = list(objects.objects)[1:2], np.array([2], np.uint32)
        return update
    grid = types.message("map_msgs/OccupancyGridUpdate")(x=0, y=0, width=2, height=1)
    grid.data = np.array([100, 0], np.int8)
    return grid


def sensor_messages(_: Path) -> Target:
    """Images, clouds, intrinsics, grids, transforms and detections, as CDR."""
    from hypermap.recordings.messages.camera import camera_of_info
    from hypermap.recordings.messages.clouds import fit_camera, points_of_cloud
    from hypermap.recordings.messages.compressed_depth import depth_of_compressed
    from hypermap.recordings.messages.detections import detections_of
    from hypermap.recordings.messages.images import (
        color_of_compressed,
        color_of_image,
        depth_of_image,
    )
    from hypermap.recordings.messages.occupancy import occupancy_of_grid
    from hypermap.recordings.messages.transforms import TransformLog
    from hypermap.ros import typestore

    def transforms(message: Any) -> None:
        log = TransformLog()
        log.add(message, is_static=False)
        frames, _ = log.frames(max_gap=1.0)
        frames.motion("map", "camera").at([1.0])

    builder, shots = _tests("recordings.bag_builder"), _tests("recordings.shots")
    shot, store = shots.make_shots(1)[0], builder.type_store("db3")
    depth, color = shot.depth_mm[:6, :8], shot.color[:6, :8]
    png = builder.picture(color)
    box = {"bounding_boxes": [{"probability": 0.5, "xmax": 5, "ymax": 6, "class_id": "cup"}]}
    xyz = np.ones((4, 4, 4), np.float32)
    fields = [{"name": n, "offset": 4 * i, "datatype": 7, "count": 1} for i, n in enumerate("xyz")]
    cloud = {"height": 4, "width": 4, "fields": fields, "point_step": 16, "row_step": 64}
    cloud |= {"data": xyz.view(np.uint8).ravel(), "header": builder.header(shot.stamp)}
    pose = {"header": builder.header(shot.stamp, "map"), "child_frame_id": "camera"}
    pose |= {"transform": {"rotation": {"w": 1.0}}}
    entries: list[tuple[Callable[[Any], object], str, dict[str, Any]]] = [
        (lambda m: depth_of_image(m, 1000.0), builder.IMAGE, builder.image(depth, "16UC1", 1)),
        (color_of_image, builder.IMAGE, builder.image(color, "rgb8", 1)),
        (color_of_image, builder.IMAGE, builder.image(color[..., 0], "bayer_rggb8", 1)),
        (color_of_compressed, builder.COMPRESSED, builder.compressed(png, "png", 1)),
        (
            lambda m: depth_of_compressed(m, 1000.0),
            builder.COMPRESSED,
            builder.compressed_depth(depth, 1),
        ),
        (lambda m: fit_camera(points_of_cloud(m)[0]), builder.CLOUD, cloud),
        (lambda m: camera_of_info(m, 32, 24, True), builder.CAMERA_INFO, builder.camera_info(1)),
        (occupancy_of_grid, builder.GRID, builder.grid([0, 100, -1, 0, 0, 5])),
        (detections_of, builder.DARKNET, box),
        (detections_of, builder.VISION, {}),
        (transforms, builder.TF, {"transforms": [pose]}),
    ]
    corpus = [
        bytes([number]) + bytes(store.serialize_cdr(builder.build(store, name, values), name))
        for number, (_, name, values) in enumerate(entries)
    ]

    def ask(data: bytes) -> None:
        if not data:
            return
        read, name, _ = entries[data[0] % len(entries)]
        message = typestore.decode(data[1:], typestore.message_class(name.replace("/msg/", "/")))
        read(message)

    return Target(ask, corpus, mutate_bytes)


def console(folder: Path) -> Target:
    """Lines at the map server's console, and the options of `hypermap query`."""
    hypermap = _map()
    path = folder / "map.hmap"
    save_map(hypermap, path)
    lines = [
        "help query",
        "getString semantic 1 2",
        "getStrings occupancy 0 0 1 0 1 1",
        "getCoords semantic chair",
        'getCoordsArea semantic "cup" 0 0 9 0 9 9',
        "query --at 3,-2",
        "query --name cup --nearest --from 1,1",
        "query --name chair --near sink --within 2",
        'query --name "potted plant" --layer semantic -k 3',
        "query --in 0,0,3,3 --frame map",
        'query --in "POLYGON((0 0, 4 0, 4 4))"',
        "republish",
        "getLayerCount",
    ]

    def ask(data: bytes) -> None:
        line = data.decode(errors="surrogateescape")
        if line.lstrip("\"'\\ \t").startswith(("load", "save")):  # names files of this machine
            return
        with contextlib.suppress(Leave):
            Console(hypermap).run(line).encode(errors="surrogateescape")

    return Target(ask, [line.encode() for line in lines], mutate_text)


def http(folder: Path) -> Target:
    """Requests to the page's server, of a visitor who knows the token."""
    from hypermap.viewer.live.app import MapApp
    from hypermap.viewer.live.document import MapDocument

    path = folder / "map.hmap"
    save_map(_map(), path)
    saved = path.read_bytes()
    square = [[0, 0], [4, 0], [4, 4]]
    get = {
        "/": {},
        "/api/map": {},
        "/api/tiles/occupancy/2/1/1.png": {"v": "1"},
        "/api/shapes/semantic": {"bbox": "0,0,9,9", "resolution": "0.01", "name": "cup"},
        "/api/at": {"x": "1", "y": "2", "frame": "map"},
        "/api/area.csv": {"polygon": "0,0,4,0,4,4"},
        "/api/area.geojson": {"polygon": "0,0,4,0,4,4"},
        "/api/find": {"name": "cup", "near": "chair", "within": "2", "limit": "3"},
        "/api/objects/semantic/1/evidence": {},
        "/api/objects/semantic/1": {"if_there": "1"},
    }
    add = {"op": "add", "layer": "semantic", "name": "new", "polygon": square}
    post = {
        "/api/area": {"polygon": square, "frame": "map"},
        "/api/edit": {"version": 0, "operations": [add]},
        "/api/undo": {"version": 0},
        "/api/redo": {"version": 0},
        "/api/save": {"path": "other", "overwrite": True},
        "/api/reload": {},
    }
    operations: list[dict[str, Any]] = [
        {"op": "add_layer", "layer": "rooms"},
        {"op": "add", "layer": "semantic", "like": 1, "polygon": square},
        {
            "op": "add",
            "layer": "semantic",
            "name": "two",
            "polygons": [[square], [[[7, 7], [8, 7], [8, 8]]]],
        },
        {"op": "update", "layer": "semantic", "id": 1, "name": "x", "tags": ["a"]},
        {"op": "update", "layer": "semantic", "id": 1, "polygon": square},
        {"op": "remove", "layer": "semantic", "id": 1},
        {"op": "merge", "layer": "semantic", "id": 1, "others": [2]},
    ]
    corpus = [
        f"GET {way}?{urlencode(values)}\nhost: 127.0.0.1\n\n".encode()
        for way, values in get.items()
    ]
    bodies = [
        *post.items(),
        *(("/api/edit", {"version": 0, "operations": [o]}) for o in operations),
    ]
    corpus += [
        f"POST {way}\nhost: 127.0.0.1\ncontent-type: application/json\n\n".encode()
        + json.dumps(body).encode()
        for way, body in bodies
    ]
    head = b"host: 127.0.0.1\norigin: http://127.0.0.1\nsec-fetch-site: none\n\n"
    corpus.append(b"GET /\n" + head)
    corpus.append(b"POST /api/save\ncookie: hypermap-80=x\n" + head + b"{}")
    corpus.append(b"GET /api/events?v=1\nlast-event-id: 123\nhost: 127.0.0.1\n\n")
    state: dict[str, Any] = {}

    def server() -> None:
        path.write_bytes(saved)
        for other in folder.iterdir():
            if other != path:
                shutil.rmtree(other) if other.is_dir() else other.unlink()
        state["app"] = MapApp(MapDocument(path, True))

    server()

    def ask(data: bytes) -> None:
        head, _, body = data.partition(b"\n\n")
        first, *lines = head.split(b"\n")
        method, _, target = first.partition(b" ")
        way, _, query = target.partition(b"?")
        app = state["app"]
        headers = [(b"x-hypermap-token", app.token.encode())]
        for line in lines:
            name, _, value = line.partition(b":")
            headers.append((name.strip().lower(), value.strip()))
        scope = {
            "type": "http",
            "asgi": {"version": "3.0"},
            "http_version": "1.1",
            "method": method.decode("latin-1"),
            "scheme": "http",
            "path": way.decode(errors="replace"),
            "raw_path": way,
            "query_string": query,
            "headers": headers,
            "client": ("127.0.0.1", 1),
            "server": ("127.0.0.1", 80),
            "root_path": "",
        }
        status = asyncio.run(_answer(app.app, scope, body))
        if status >= 500:
            raise AssertionError(f"answered {status}")
        if method == b"POST":
            server()

    return Target(ask, corpus, _mutate_request)


def _mutate_request(data: bytes, draw: random.Random) -> bytes:
    """Spoil the body of a request as the text that it is, or its head."""
    head, mark, body = data.partition(b"\n\n")
    if body and draw.random() < 0.7:
        return head + mark + mutate_text(body, draw)
    if draw.random() < 0.7:
        return mutate_text(head, draw) + mark + body
    return mutate_text(data, draw)


async def _answer(app: Any, scope: dict[str, Any], body: bytes) -> int:
    """Return the status of an answer; raises what the application raises."""
    statuses: list[int] = []
    messages = [{"type": "http.request", "body": body, "more_body": False}]

    async def receive() -> dict[str, Any]:
        return messages.pop(0) if messages else {"type": "http.disconnect"}

    async def send(message: Any) -> None:
        if message["type"] == "http.response.start":
            statuses.append(int(message["status"]))

    await app(scope, receive, send)
    return statuses[0]


class _Heard(logging.Handler):
    """Keeps what a logger is told of errors."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)


def websocket(_: Path) -> Target:
    """What a client says to the door before Foxglove's server: any bytes, over a socket."""
    from hypermap.web.gate import Gate

    behind = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        while True:
            connection, _ = behind.accept()
            with contextlib.suppress(OSError), connection:
                connection.settimeout(5)
                connection.recv(1 << 16)
                connection.sendall(b"HTTP/1.1 101 Switching Protocols\r\n\r\n")

    threading.Thread(target=serve, daemon=True).start()
    gate = Gate("127.0.0.1", 0, behind.getsockname())
    heard = _Heard()
    logging.getLogger("asyncio").addHandler(heard)
    port = str(gate.port).encode()
    head = b"GET / HTTP/1.1\r\nHost: 127.0.0.1:" + port + b"\r\nUpgrade: websocket\r\n"
    head += b"Connection: Upgrade\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n"
    corpus = [
        head + b"Origin: " + origin + b"\r\n\r\n"
        for origin in (b"https://app.foxglove.dev", b"http://127.0.0.1:8080", b"http://evil.org")
    ]

    def ask(data: bytes) -> None:
        with socket.create_connection(("127.0.0.1", gate.port), timeout=5) as client:
            client.settimeout(5)
            with contextlib.suppress(ConnectionError):
                client.sendall(data)
                client.shutdown(socket.SHUT_WR)
                while client.recv(1 << 16):
                    pass
        if heard.records:
            record = heard.records.pop()
            raise AssertionError(record.getMessage()) from (
                record.exc_info[1] if record.exc_info else None
            )

    return Target(ask, corpus, mutate_text)


TARGETS: dict[str, Maker] = {
    "archive": archive,
    "config": config,
    "map_server": map_server,
    "png": png,
    "semantic_yaml": semantic_yaml,
    "wkt": wkt,
    "geojson": geojson,
    "geoparquet": geoparquet,
    "evidence": evidence,
    "tum": partial(_recording_folder, "tum"),
    "seven_scenes": partial(_recording_folder, "seven_scenes"),
    "ros1_bag": partial(_bag, "ros1"),
    "ros2_db3": partial(_bag, "db3"),
    "ros2_mcap": partial(_bag, "mcap"),
    "detections": detections,
    "onnx": onnx,
    "ros_messages": ros_messages,
    "sensor_messages": sensor_messages,
    "console": console,
    "http": http,
    "websocket": websocket,
}
