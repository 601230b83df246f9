"""Ask maps from eight threads while every geometry that callers have is prepared.

GEOS ends the program where two threads ask with one prepared geometry for the first time, so they
are prepared again for each round. By hand for longer: `python tests/core/readers.py 60`.
"""

from __future__ import annotations

import itertools
import sys
import threading
import time
from collections.abc import Callable, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap import Hypermap, SemanticLayer, SemanticObject

READERS = 8
POINTS = np.random.default_rng(3).uniform(2, 8, (20, 2))


def prepared(shapes: Sequence[BaseGeometry]) -> None:
    for shape in shapes:
        shapely.contains_xy(shape, 0.0, 0.0)  # which prepares it in place


QUESTIONS: dict[str, Callable[[Asked], object]] = {
    "labels_in": lambda a: a.map.labels_in("s", a.area),
    "labels_in of a layer": lambda a: a.map["s"].labels_in(a.area),
    "labels_in of a small box": lambda a: a.map["s"].labels_in(a.box),
    "find": lambda a: a.map.find("s", "cup", a.area),
    "objects in an area": lambda a: a.map.objects("cup", area=a.area),
    "objects within of an area": lambda a: a.map.objects("cup", near=a.area, within=0.1, limit=1),
    "objects near an area": lambda a: a.map.objects("cup", near=a.area, limit=1),
    "objects inside an area": lambda a: a.map.objects("cup", inside=a.area),
    "objects within of each other": lambda a: a.map.objects("cup", near="cup", within=0.1),
    "objects inside each other": lambda a: a.map.objects("cup", inside="cup"),
    "label_at, many": lambda a: a.map.label_at("s", POINTS),
    "label_at, one": lambda a: a.map.label_at("s", POINTS[0]),
    "nearest": lambda a: a.map.nearest("cup", POINTS[0]),
    "what objects returned": lambda a: prepared([cup.footprint for cup in a.map["s"].objects()]),
    "what get returned": lambda a: prepared([a.map["s"].get(7).footprint]),
    "what was found": lambda a: prepared([cup.object.footprint for cup in a.map.objects("cup")]),
    "geometries": lambda a: prepared(a.map["s"].geometries),
    "the picture": lambda a: prepared(a.map["s"].picture().shapes),
}


def outline(center: float, corners: int) -> BaseGeometry:
    """Return a ragged shape, which is asked about through GEOS."""
    drawn = np.random.default_rng(corners)
    angle, radius = np.sort(drawn.uniform(0, 2 * np.pi, corners)), drawn.uniform(2.9, 3, corners)
    xy = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return shapely.Polygon(xy + center)


class Asked:
    """What all threads share: a map, half of whose objects are a table, and areas."""

    def __init__(self) -> None:
        cups = [SemanticObject("cup", outline(4.5 + 0.1 * i, 500)) for i in range(8)]
        table = SemanticLayer("s", "map", cups[:4]).table
        layer = SemanticLayer.of_table("s", "map", table)
        layer.add(cups[4:])
        self.is_last = False
        self.map = Hypermap([layer])
        self.area, self.box = outline(5.0, 2000), shapely.box(4.9, 4.9, 5.1, 5.1)
        own = [cup.footprint for cup in cups]
        self._known = [*own, *table.footprints, *layer.geometries, self.area, self.box]

    def prepare(self) -> None:
        """Prepare all geometries that the caller has, as if for the first time."""
        shapely.destroy_prepared(self._known)
        shapely.prepare(self._known)


def main(seconds: float) -> None:
    """Ask one question after the other, each from all threads at once."""
    end = time.monotonic() + seconds
    barrier = threading.Barrier(READERS)
    asked = Asked()
    rounds = 0
    wrong: list[str] = []

    def read(number: int) -> None:
        nonlocal rounds
        try:
            for question in itertools.cycle(QUESTIONS.values()):
                if number == 0:
                    asked.prepare()
                    rounds += 1
                    asked.is_last = time.monotonic() > end
                barrier.wait()
                is_last = asked.is_last
                question(asked)
                barrier.wait()
                if is_last:
                    return
        except Exception as error:  # another thread must not wait for this one
            wrong.append(repr(error))
            barrier.abort()

    threads = [threading.Thread(target=read, args=(i,)) for i in range(READERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    sys.stdout.write(f"{rounds} rounds {wrong}\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main(float(sys.argv[1]))
