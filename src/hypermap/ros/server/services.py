"""The services of the map server and their handlers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial

from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.ros.port import Closable, Message, Port, Value
from hypermap.ros.server.ask import Ask
from hypermap.ros.server.changes import Changes
from hypermap.ros.server.current_map import CurrentMap, KeptOpen
from hypermap.ros.server.health import Tally
from hypermap.ros.server.layer_topics import global_layers
from hypermap.ros.server.map_files import MapFiles
from hypermap.ros.server.nav2_loading import SERVICE, TYPE, Nav2Loading
from hypermap.ros.server.note_queries import NoteQueries
from hypermap.ros.server.object_queries import ObjectQueries
from hypermap.ros.server.plans import Plans
from hypermap.ros.server.queries import Queries
from hypermap.ros.server.requests import Requests
from hypermap.ros.server.room_queries import RoomQueries
from hypermap.ros.topic_names import topic_name

GLOBAL_STATIC_MAP = "/static_map"
Handler = Callable[[Message], Message]


class Services:
    """The part that offers all services; those of a layer come and go with it."""

    def __init__(
        self,
        port: Port,
        current: CurrentMap,
        requests: Requests,
        plans: Plans,
        files: MapFiles,
        tally: Tally,
        changes: Changes,
    ) -> None:
        self._port = port
        self._tally = tally
        self._open: KeptOpen[Closable] = KeptOpen()
        self._queries = Queries(port, current, requests)
        self._layers: dict[str, str] = {}  # of the services that return a grid
        self._fixed: dict[str, tuple[str, Handler]] = {
            **_of_2019(self._queries),
            **_of_objects(port, current, requests),
            **_of_rooms(RoomQueries(port, current)),
            **_of_notes(NoteQueries(port, current, requests)),
            "get_changes": ("hypermap_msgs/GetChanges", changes.get_changes),
            "make_plan": ("nav_msgs/GetPlan", plans.make_plan),
            "load_map": ("hypermap_msgs/LoadMap", files.load),
            "store_map": ("hypermap_msgs/StoreMap", files.store),
            "clear": ("std_srvs/Trigger", files.clear),
        }
        nav2 = Nav2Loading(port, files)
        if nav2.is_possible:
            self._fixed[SERVICE] = TYPE, nav2.load

    def set(self, values: Mapping[str, Value]) -> None:
        """Take parameters: there are none."""

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:
        """Offer the services of a map; those that were there before stay without a gap."""
        if changed is not None:
            return
        wanted = {name: self._opener(name, *entry) for name, entry in self._fixed.items()}
        self._layers = _static_maps(hypermap)
        for name in self._layers:
            handler = partial(self._static_map, name)
            wanted[name] = self._opener(name, "nav_msgs/GetMap", handler)
        self._open.keep(wanted)

    def close(self) -> None:
        """Offer nothing any more."""
        self._open.close()

    def _opener(self, name: str, type_name: str, handler: Handler) -> Callable[[], Closable]:
        failed = partial(failed_response, self._port, type_name)
        return partial(self._port.service, name, type_name, self._counted(handler), failed)

    def _counted(self, handler: Handler) -> Handler:
        def handle(request: Message) -> Message:
            try:
                answer = handler(request)
            except Exception:
                self._tally.count(is_answered=False)
                raise
            self._tally.count(is_answered=True)
            return answer

        return handle

    def _static_map(self, service: str, request: Message) -> Message:  # noqa: ARG002 - it is empty
        return self._queries.static_map(self._layers.get(service, service))


def failed_response(port: Port, type_name: str, text: str) -> Message:
    """Return the response that reports an error as well as its type can.

    Types of ours have `success` and `message`; a string is empty, a number -1, a list empty. The
    `result` of nav2's is 255, an undefined failure.
    """
    response = port.response(type_name)()
    for field, value in (("message", text), ("value", -1), ("result", 255)):
        if hasattr(response, field):
            setattr(response, field, value)
    return response


def _static_maps(hypermap: Hypermap) -> dict[str, str]:
    """Return the names of the services that return a grid, each with its layer's name."""
    layers = [layer for layer in hypermap if isinstance(layer, OccupancyLayer)]
    services = {topic_name(layer.name, "static_map"): layer.name for layer in reversed(layers)}
    for layer in global_layers(hypermap):
        if isinstance(layer, OccupancyLayer):
            services[GLOBAL_STATIC_MAP] = layer.name
    return services


def _of_2019(queries: Queries) -> dict[str, tuple[str, Handler]]:
    """Return the services of the first version, by their names: type and handler."""
    return {
        "get_string_at_point": ("hypermap_msgs/GetStringAtPoint", queries.string_at_point),
        "get_int_at_point": ("hypermap_msgs/GetIntAtPoint", queries.int_at_point),
        "get_strings_by_area": ("hypermap_msgs/GetStringsByArea", queries.strings_by_area),
        "get_ints_by_area": ("hypermap_msgs/GetIntsByArea", queries.ints_by_area),
        "get_locations_by_string": (
            "hypermap_msgs/GetLocationsByString",
            queries.locations_by_string,
        ),
        "get_locations_by_int": ("hypermap_msgs/GetLocationsByInt", queries.locations_by_int),
        "get_semantic_by_area": ("hypermap_msgs/GetSemanticByArea", queries.semantic_by_area),
        "get_semantic_by_string": (
            "hypermap_msgs/GetSemanticByString",
            queries.semantic_by_string,
        ),
    }


def _of_objects(
    port: Port, current: CurrentMap, requests: Requests
) -> dict[str, tuple[str, Handler]]:
    """Return the services that answer queries across layers."""
    objects = ObjectQueries(port, current, requests)
    return {
        "get_layers_at_point": ("hypermap_msgs/GetLayersAtPoint", objects.layers_at_point),
        "get_hits_in_areas": ("hypermap_msgs/GetHitsInAreas", objects.hits_in_areas),
        "find_objects": ("hypermap_msgs/FindObjects", objects.find_objects),
        "ask": ("hypermap_msgs/Ask", Ask(port, current, requests).answer),
    }


def _of_rooms(rooms: RoomQueries) -> dict[str, tuple[str, Handler]]:
    return {
        "find_rooms": ("hypermap_msgs/FindRooms", rooms.find_rooms),
        "get_room_of": ("hypermap_msgs/GetRoomOf", rooms.room_of),
        "get_rooms_with": ("hypermap_msgs/GetRoomsWith", rooms.rooms_with),
        "is_room_reachable": ("hypermap_msgs/IsRoomReachable", rooms.is_reachable),
    }


def _of_notes(notes: NoteQueries) -> dict[str, tuple[str, Handler]]:
    return {
        "find_notes": ("hypermap_msgs/FindNotes", notes.find),
        "add_note": ("hypermap_msgs/AddNote", notes.add),
    }
