"""Questions of all kinds to whatever opened, however odd it is."""

from __future__ import annotations

import contextlib
import random
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from campaign.full_map import MeanColors
from hypermap import HypermapError, LayerNotFound, OccupancyLayer, SemanticLayer, to_geojson
from hypermap.cli.change_rows import described
from hypermap.core.hypermap import Hypermap
from hypermap.core.trajectory import trajectory_of
from hypermap.formats.semantic.csv_table import to_csv
from hypermap.history import as_of, at_version
from hypermap.mapping.mapper import Mapper
from hypermap.notes import find_notes
from hypermap.questions import Query
from hypermap.questions import ask as ask_query
from hypermap.viewer.live.attached import embed_notes, file_reply
from hypermap.viewer.live.object_evidence import describe_evidence

MOST_CELLS = 1 << 20  # of grids that are asked for all of their cells


def ask_everything(hypermap: Hypermap, draw: random.Random) -> None:
    """Ask a map all questions there are, at places that its own extent suggests.

    Raises:
        Exception: What a question raises, but for HypermapError.
    """
    frames = [None, *(layer.frame_id for layer in hypermap), "nowhere"]
    for layer in hypermap:
        frame = draw.choice(frames)
        bounds = _bounds(layer)
        points = _points(bounds, draw)
        area = _area(bounds, draw)
        names = _names(layer, draw)
        for ask in (
            lambda n=layer.name, p=points, f=frame: hypermap.label_at(n, p, f),
            lambda n=layer.name, p=points, f=frame: hypermap.value_at(n, p, f),
            lambda n=layer.name, p=points[:1], f=frame: hypermap.labels_at(n, p, f),
            lambda n=layer.name, a=area, f=frame: hypermap.labels_in(n, a, f),
            lambda n=layer.name, a=area, f=frame: hypermap.values_in(n, a, f),
            lambda layer=layer: layer.extent(),
            lambda layer=layer: layer.summary(),
        ):
            with contextlib.suppress(HypermapError):
                ask()
        for name in names:
            with contextlib.suppress(HypermapError):
                hypermap.find(layer.name, name, area, frame)
            with contextlib.suppress(HypermapError):
                if not isinstance(layer, OccupancyLayer) or _is_small(layer):
                    hypermap.nearest(name, points[0], draw.choice([1, 3]), layer.name, frame)
        if isinstance(layer, SemanticLayer):
            _ask_objects(hypermap, layer, points, area, names, draw)
    with contextlib.suppress(HypermapError):
        hypermap.objects_at((0.0, 0.0), frame_id=draw.choice(frames))
    with contextlib.suppress(LayerNotFound):
        hypermap.label_at("no such layer", [(0.0, 0.0)])
    for ask_more in (_ask_notes, _ask_history, _ask_looks, _ask_mapper):
        with contextlib.suppress(HypermapError):
            ask_more(hypermap)


def _ask_notes(hypermap: Hypermap) -> None:
    find_notes(hypermap, words="tile", near=(0.0, 0.0))
    embed_notes(hypermap)
    for found in find_notes(hypermap):
        for each in found.note.attachments:
            with contextlib.suppress(HypermapError):
                file_reply(each)


def _ask_history(hypermap: Hypermap) -> None:
    if hypermap.history is None:
        return
    for time, revision in hypermap.history.dated():
        for change in revision.changes:
            described(change)
        with contextlib.suppress(HypermapError):
            at_version(hypermap, revision.version)
        with contextlib.suppress(HypermapError):
            as_of(hypermap, time + 1)


def _ask_looks(hypermap: Hypermap) -> None:
    for layer in hypermap:
        if isinstance(layer, SemanticLayer):
            for number in layer.ids[:3].tolist():
                layer.pictures(number)
    ask_query(hypermap, Query(like="red", count=3), encoder=MeanColors())


def _ask_mapper(hypermap: Hypermap) -> None:
    """Go on with a map, from poses that are a little different."""
    if hypermap.mapper_state is None:
        return
    mapper = Mapper.onto(hypermap, None)
    stamps, poses = mapper.logged_poses()
    poses[:, 0, 3] += 0.05
    try:
        trajectory = trajectory_of(stamps, poses)
    except ValueError:  # where the stamps do not rise
        return
    mapper.correct(trajectory)
    mapper.hypermap().semantic()


def _ask_objects(
    hypermap: Hypermap,
    layer: SemanticLayer,
    points: NDArray[np.float64],
    area: Any,
    names: list[Any],
    draw: random.Random,
) -> None:
    name = names[0]
    for given in (
        {"near": tuple(points[0]), "within": draw.choice([0.0, 1.0, 1e9]), "limit": 3},
        {"near": name, "area": area},
        {"inside": name, "layer": layer.name},
        {"name": name, "tags": ["x"]},
    ):
        with contextlib.suppress(HypermapError):
            hypermap.objects(**given)
    for number in layer.ids[:3]:
        with contextlib.suppress(HypermapError):
            describe_evidence(hypermap, layer.name, int(number))
    with contextlib.suppress(HypermapError):
        to_geojson(layer)
    with contextlib.suppress(HypermapError):
        to_csv(layer)


def _is_small(layer: OccupancyLayer) -> bool:
    return layer.cells is None or layer.cells.size <= MOST_CELLS


def _bounds(layer: Any) -> tuple[float, float, float, float]:
    with contextlib.suppress(HypermapError):
        bounds = layer.extent().bounds
        if len(bounds) == 4 and np.isfinite(bounds).all():
            return tuple(map(float, bounds))  # type: ignore[return-value]
    return (-1.0, -1.0, 1.0, 1.0)


def _points(bounds: tuple[float, float, float, float], draw: random.Random) -> NDArray[np.float64]:
    x0, y0, x1, y1 = bounds
    places = [(x0, y0), (x1, y1), (x0 / 2 + x1 / 2, y0 / 2 + y1 / 2), (1e9, -1e9), (0.0, 0.0)]
    places += [(draw.uniform(x0, x1), draw.uniform(y0, y1)) for _ in range(5)]
    points = np.array(places)
    finite: NDArray[np.float64] = points[np.isfinite(points).all(axis=1)]
    return finite


def _area(bounds: tuple[float, float, float, float], draw: random.Random) -> Any:
    x0, y0, x1, y1 = bounds
    x, y = draw.uniform(x0, x1), draw.uniform(y0, y1)
    reach = draw.choice([0.01, 1.0, max(x1 - x0, y1 - y0) / 3 + 0.1])
    if not np.isfinite([x, y, reach]).all():
        x, y, reach = 0.0, 0.0, 1.0
    reach = min(reach, 500.0)  # of a grid, all cells in it are the answer
    kind = draw.randrange(3)
    if kind == 0:
        return shapely.box(x - reach, y - reach, x + reach, y + reach)
    if kind == 1:
        return shapely.Point(x, y).buffer(reach)
    return shapely.Polygon([(x, y), (x + reach, y), (x, y + reach)])


def _names(layer: Any, draw: random.Random) -> list[Any]:
    if isinstance(layer, SemanticLayer):
        found = [str(name) for name in layer.names[:3]]
        return [*found, "no such name", 0, -(2**40)] if draw.random() < 0.5 else [*found, "x"]
    return ["Occupied", 100, -1, "57"] if draw.random() < 0.5 else ["Free"]
