from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely

from hypermap import SemanticLayer, SemanticObject
from hypermap.core.shapes import as_area


def test_threads_may_ask_while_what_callers_have_is_prepared() -> None:
    """In a process of its own, since what is wrong ends it."""
    readers = Path(__file__).with_name("readers.py")
    command = [sys.executable, str(readers), "3"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=480, check=False)
    assert done.returncode == 0, (done.stdout, done.stderr)


@pytest.mark.parametrize("area", [shapely.box(0, 0, 1, 1), shapely.Point(3, 4), shapely.Polygon()])
def test_an_area_to_ask_with_is_a_copy(area: shapely.Geometry) -> None:
    shapely.prepare(area)
    asked = as_area(area)
    assert asked is not area
    assert asked.equals(area)
    assert not shapely.is_prepared(asked)


def test_what_a_layer_hands_out_is_not_what_it_asks_with() -> None:
    given = [SemanticObject("cup", shapely.box(x, 0, x + 1, 1)) for x in range(4)]
    layer = SemanticLayer.of_table("s", "map", SemanticLayer("s", "map", given[:2]).table)
    layer.add(given[2:])
    out = [
        *(item.footprint for item in layer.objects()),
        *(layer.get(number).footprint for number in layer.ids.tolist()),
        *(item.footprint for item in layer.nearest_objects("cup", [0.0, 0.0], k=4)[0]),
        *layer.geometries,
        *layer.picture().shapes,
    ]
    shapely.prepare(np.array([*out, *(item.footprint for item in given[2:])]))
    kept = [*layer.table.footprints[:2], *layer.table.shapes[:2]]
    assert not shapely.is_prepared(kept).any()
    assert len({id(shape) for shape in out}) == len(out)
    assert [item.footprint.bounds for item in layer.objects()] == [
        x.footprint.bounds for x in given
    ]
