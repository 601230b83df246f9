"""Route graphs, read as Nav2's route server does by the schema that it documents."""

from __future__ import annotations

import heapq
import itertools
import json
import math

import numpy as np
import pytest
import shapely
from scipy import ndimage

from hypermap import GridGeometry, Hypermap, HypermapError, OccupancyLayer
from hypermap.formats.nav2_routes import to_nav2_routes
from hypermap.formats.semantic.geojson import from_geojson
from hypermap.paths import PathSettings, Planner, route_graph
from hypermap.rooms import Door, Room, Rooms, with_rooms

RADIUS = 0.2


class RouteServer:
    """What the server knows of a file: nodes by id, and for each the edges that leave it."""

    def __init__(self, text):
        self.nodes, self.edges, ids = {}, {}, []
        features = json.loads(text)["features"]
        for feature in features:
            properties, geometry = feature["properties"], feature["geometry"]
            ids.append(properties["id"])
            assert type(properties["id"]) is int
            assert properties["id"] >= 0
            self.check_metadata(properties["metadata"])
            if geometry["type"] == "Point":
                assert type(properties["frame"]) is str
                self.nodes[properties["id"]] = (*geometry["coordinates"], properties["metadata"])
                self.edges[properties["id"]] = []
        for feature in features:
            properties, geometry = feature["properties"], feature["geometry"]
            if geometry["type"] == "Point":
                continue
            assert geometry["type"] == "MultiLineString"
            ((begin, end),) = geometry["coordinates"]
            assert tuple(begin) == self.nodes[properties["startid"]][:2]
            assert tuple(end) == self.nodes[properties["endid"]][:2]
            assert type(properties["cost"]) is float
            assert properties["overridable"] is True
            self.edges[properties["startid"]].append((properties["endid"], properties["cost"]))
        assert len(set(ids)) == len(ids)

    def check_metadata(self, metadata):
        """Texts, numbers and booleans, lists of these, and mappings; others are an error there."""
        for value in metadata.values():
            if isinstance(value, dict):
                self.check_metadata(value)
            else:
                each = value if isinstance(value, list) else [value]
                assert all(isinstance(item, str | int | float | bool) for item in each)

    def node(self, **metadata):
        (found,) = [
            number
            for number, (_, _, known) in self.nodes.items()
            if metadata.items() <= known.items()
        ]
        return found

    def cost(self, start, goal):
        """Return the cost of the cheapest route, by Dijkstra's algorithm."""
        done, waiting = set(), [(0.0, start)]
        while waiting:
            cost, node = heapq.heappop(waiting)
            if node == goal:
                return cost
            if node not in done:
                done.add(node)
                for following, more in self.edges[node]:
                    heapq.heappush(waiting, (cost + more, following))
        return math.inf


def a_floor(door=0.9):
    """Return two rooms, and in the left one a screen from its lower wall almost to the upper one.

    Left of the screen is a second door, out to a closet.
    """
    cells = np.full((100, 180), 100, dtype=np.int8)
    cells[10:90, 48:88] = cells[10:90, 92:172] = 0  # x from 2.4 to 4.4, and from 4.6 to 8.6
    cells[10:90, 8:44] = cells[14:32, 44:48] = 0  # the closet and its door
    half = round(door / 0.1)
    cells[30 - half : 30 + half, 88:92] = 0  # the door at y = 1.5
    cells[10:75, 66:68] = 100  # the screen up to y = 3.75
    boxes = [(2.4, 0.5, 4.5, 4.5), (4.5, 0.5, 8.6, 4.5), (0.4, 0.5, 2.4, 4.5)]
    names = ("hall", "office", "closet")
    rooms = [Room(i, names[i], shapely.box(*box), is_named=True) for i, box in enumerate(boxes)]
    doors = [
        Door((0, 1), shapely.LineString([(4.5, 1.5 - door / 2), (4.5, 1.5 + door / 2)]), door),
        Door((0, 2), shapely.LineString([(2.3, 0.7), (2.3, 1.6)]), 0.9),
    ]
    floor = Hypermap([OccupancyLayer("occupancy", "map", GridGeometry(180, 100, 0.05), cells)])
    return with_rooms(floor, Rooms("map", tuple(rooms), tuple(doors)))


@pytest.fixture(scope="module")
def floor():
    return a_floor()


@pytest.fixture(scope="module")
def server(floor):
    return RouteServer(to_nav2_routes(route_graph(Planner(floor, PathSettings(RADIUS)))))


def test_rooms_and_doors_are_nodes_with_what_is_known_of_them(server):
    kinds = [known["type"] for _, _, known in server.nodes.values()]
    assert (kinds.count("room"), kinds.count("door")) == (3, 2)
    x, y, office = server.nodes[server.node(type="room", name="office")]
    assert shapely.box(4.6, 0.5, 8.6, 4.5).contains(shapely.Point(x, y))
    assert office["area"] == pytest.approx(4.1 * 4)
    assert set(office["outline"]["x_values"]) == {4.5, 8.6}
    x, y, door = server.nodes[server.node(type="door", rooms=[0, 1])]
    assert math.dist((x, y), (4.5, 1.5)) < 0.08  # up to a cell
    assert (door["names"], door["width"]) == (["hall", "office"], 0.9)


def test_routes_are_as_long_as_the_shortest_paths_over_the_same_doors(floor, server):
    planner = Planner(floor, PathSettings(RADIUS))
    for one, other in itertools.combinations(("hall", "office", "closet"), 2):
        shortest = planner.path(one, other).length
        cost = server.cost(server.node(name=one), server.node(name=other))
        # A route leads over the middle of each door, a path may pass beside it.
        assert shortest - 0.2 <= cost <= 1.1 * shortest


def test_a_route_turns_at_a_screen(server):
    turns = [(x, y) for x, y, known in server.nodes.values() if known["type"] == "turn"]
    assert any(math.dist(turn, (3.35, 3.95)) < 0.3 for turn in turns)


def test_edges_are_straight_ways_on_which_the_robot_fits(floor, server):
    layer = floor.occupancy()
    far = ndimage.distance_transform_edt(layer.cells == 0) * layer.grid.resolution
    for start, edges in server.edges.items():
        for end, cost in edges:
            (x0, y0, _), (x1, y1, _) = server.nodes[start], server.nodes[end]
            assert cost == pytest.approx(math.dist((x0, y0), (x1, y1)), abs=1e-5)
            along = np.linspace([x0, y0], [x1, y1], int(cost / 0.01) + 2)
            col, row = np.floor(along / layer.grid.resolution).astype(int).T
            assert far[row, col].min() > RADIUS


def test_every_edge_leads_back(server):
    for start, edges in server.edges.items():
        assert all((start, cost) in server.edges[end] for end, cost in edges)


def test_a_door_too_narrow_for_the_robot_has_no_node():
    graph = route_graph(Planner(a_floor(door=0.5), PathSettings(0.3)))
    assert [door.rooms for door in graph.too_narrow] == [(0, 1)]
    server = RouteServer(to_nav2_routes(graph))
    assert server.cost(server.node(name="hall"), server.node(name="office")) == math.inf
    assert server.cost(server.node(name="hall"), server.node(name="closet")) < math.inf


def test_a_map_without_rooms_has_no_routes():
    layer = OccupancyLayer("occupancy", "map", GridGeometry(4, 4, 1.0), np.zeros((4, 4), np.int8))
    with pytest.raises(HypermapError, match="the map has no rooms; `hypermap rooms MAP -o OUT`"):
        route_graph(Planner(Hypermap([layer])))


def test_a_route_graph_is_not_taken_for_objects(floor):
    text = to_nav2_routes(route_graph(Planner(floor)))
    with pytest.raises(HypermapError, match="is a Nav2 route graph, which has no objects"):
        from_geojson(text, frame_id="map")
