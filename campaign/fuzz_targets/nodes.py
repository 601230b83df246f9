"""The map server: its services, its topics and its console."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from campaign.fuzz_targets.target import Target, a_map, a_small_map, of_tests
from campaign.in_process_port import InProcessPort
from campaign.mutation import MOST_BYTES, mutate_bytes, mutate_text
from hypermap import save_map
from hypermap.console.commands import Console, Leave
from hypermap.ros import typestore
from hypermap.ros.messages.semantic_messages import semantic_map
from hypermap.ros.messages.to_messages import occupancy_grid
from hypermap.ros.server.map_server import MapServer


def ros_messages(folder: Path) -> Target:
    """Requests to the map server's services and messages on its topics, as CDR."""
    server = _Server(folder)

    def ask(data: bytes) -> None:
        if data:
            server.hear(data[0], data[1:])

    examples = list(_examples(server.ways))
    kinds = {number: type(message) for number, message in examples}
    corpus = [bytes([number]) + typestore.encode(message) for number, message in examples]

    def mutate(data: bytes, draw: random.Random) -> bytes:
        kind = kinds.get(data[0] % len(server.ways)) if data else None
        if kind is None or draw.random() < 0.15:
            return mutate_bytes(data, draw)
        try:
            message = typestore.decode(data[1:], kind)
            for _ in range(draw.choice([1, 1, 2, 3])):
                _change_a_field(message, draw)
            return (data[:1] + typestore.encode(message))[:MOST_BYTES]
        except Exception:  # it is spoiled already, or cannot be said in this type
            return mutate_bytes(data, draw)

    return Target(ask, corpus, mutate)


_FLOATS = [math.nan, math.inf, -math.inf, 1e308, -1e308, 1e9, -1e9, 1e-320, 0.0, 1e12]
_INTEGERS = [0, 1, -1, 2, 127, 255, 65535, 2**31 - 1, -(2**31), 2**32 - 1, 2**63 - 1]
_TEXTS = [
    "",
    "x",
    "things",
    "map",
    "\0",
    "a" * 400,
    "../x",
    "/dev/null",
    "Ä\u202e",
    "POLYGON EMPTY",
]


def _change_a_field(message: Any, draw: random.Random) -> None:
    """Give one field of a message, or of a message in it, another value."""
    names = [each.name for each in dataclasses.fields(message) if each.name[:2] != "__"]
    name = draw.choice(names)
    value = getattr(message, name)
    if dataclasses.is_dataclass(value):
        _change_a_field(value, draw)
    elif isinstance(value, list) and value and dataclasses.is_dataclass(value[0]):
        if draw.random() < 0.7:
            _change_a_field(draw.choice(value), draw)
        else:
            setattr(message, name, draw.choice([[], value[:1], value * 2, value[::-1], value * 50]))
    elif isinstance(value, np.ndarray):
        odd = np.array(draw.choice(_FLOATS if value.dtype.kind == "f" else _INTEGERS))
        values = [value[:-1], np.repeat(value, 2), np.full_like(value, odd.astype(value.dtype))]
        setattr(message, name, draw.choice(values))
    elif isinstance(value, (str, list)):
        text = draw.choice(_TEXTS)
        setattr(message, name, text if isinstance(value, str) else [text] * draw.choice([0, 1, 9]))
    elif isinstance(value, float):
        setattr(message, name, draw.choice([*_FLOATS, -value, value * 1000]))
    else:
        setattr(message, name, draw.choice([*_INTEGERS, value + 1]))


class _Server:
    """A map server that restarts after each change of its map.

    Attributes:
        ways: to reach it: "service" or "topic", and the name.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / "map.hmap"
        made = a_small_map()
        for layer in made:
            layer.settings.update(subscribe_mode=True, publish_global_topics=True)
        save_map(made, self._path)
        self._maps = folder / "maps"
        self._maps.mkdir()
        self._start()
        self.ways = [("service", name) for name in sorted(self._port.services)]
        self.ways += [("topic", name) for name in sorted(self._port.topics)]

    def _start(self) -> None:
        self._port = InProcessPort(console=False, map_directory=str(self._maps))
        # The port in this process neither spins nor shuts down, and takes arguments loosely.
        node = MapServer(self._port, self._path)  # type: ignore[arg-type]
        node.configure()
        node.activate()

    def hear(self, number: int, data: bytes) -> None:
        """Take a request or a message by one of the ways."""
        kind, name = self.ways[number % len(self.ways)]
        heard: dict[str, Callable[[bytes], Any]]
        heard = {**self._port.services} if kind == "service" else {**self._port.topics}
        try:
            heard[name](data)
        finally:
            if kind == "topic" or name in ("clear", "load_map", "store_map"):
                self._start()


def _examples(ways: list[tuple[str, str]]) -> Iterator[tuple[int, Any]]:
    """Yield an example for each way: its number, and a message."""
    types = _CdrTypes()
    requests = _requests(types)
    for number, (kind, name) in enumerate(ways):
        if kind == "topic":
            yield number, _example_of(name, types)
        elif name in requests:
            type_name, fields = requests[name]
            request = typestore.request_class(f"hypermap_msgs/{type_name}")()
            for key, value in fields.items():
                if hasattr(request, key):
                    setattr(request, key, value)
            yield number, request


def _requests(types: _CdrTypes) -> dict[str, tuple[str, dict[str, Any]]]:
    """Return the type of each service, and what a request may say."""
    message = of_tests("ros.message_builder")
    area = message.area(types, message.SQUARE, "map")
    point = {"layer": "things", "location": types.stamped_point(8.0, 5.0)}
    by_area, by_name = {"layer": "things", "area": area}, {"layer": "things", "name": "cup"}
    return {
        "get_string_at_point": ("GetStringAtPoint", point),
        "get_int_at_point": ("GetIntAtPoint", point),
        "get_strings_by_area": ("GetStringsByArea", by_area),
        "get_ints_by_area": ("GetIntsByArea", by_area),
        "get_locations_by_string": ("GetLocationsByString", {**by_area, **by_name}),
        "get_semantic_by_area": ("GetSemanticByArea", by_area),
        "get_semantic_by_string": ("GetSemanticByString", by_name),
        "load_map": ("LoadMap", {"filename": "x.hmap"}),
        "store_map": ("StoreMap", {"filename": "x.hmap"}),
        "get_layers_at_point": ("GetLayersAtPoint", {}),
        "get_hits_in_areas": ("GetHitsInAreas", {}),
        "find_objects": ("FindObjects", {}),
    }


class _CdrTypes:
    """The message classes that need no ROS."""

    def message(self, type_name: str) -> type[Any]:
        return typestore.message_class(type_name)

    def sent(self, message: Any) -> Any:
        return message

    def stamp(self, nanoseconds: int) -> Any:
        return typestore.stamp(nanoseconds)

    def stamped_point(self, x: float, y: float) -> Any:
        message = self.message("geometry_msgs/PointStamped")()
        message.header.frame_id = "map"
        message.point.x, message.point.y = x, y
        return message


def _example_of(topic: str, types: _CdrTypes) -> Any:
    """Return a message for a topic of the map server."""
    made = a_small_map()
    objects = semantic_map(made.semantic("things"), types, 0)
    if topic == "/map":
        return occupancy_grid(made.occupancy(), types, 0)
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


def console(_: Path) -> Target:
    """Lines at the map server's console, and the options of `hypermap query`."""
    hypermap = a_map()
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
