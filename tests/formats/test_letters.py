"""Half of a character, which JSON and arguments of the shell can bring, is refused by name."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import shapely

from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import save_map
from hypermap.formats.semantic.csv_table import to_csv
from hypermap.formats.semantic.geojson import from_geojson, to_geojson
from hypermap.formats.semantic.geopandas_bridge import to_geopackage

HALF = "caf\ud83d"
SHAPE = shapely.box(0, 0, 1, 1)
OBJECTS = {
    "name": SemanticObject(HALF, SHAPE),
    "tag": SemanticObject("cup", SHAPE, tags=("cup", HALF)),
    "attribute": SemanticObject("cup", SHAPE, attributes={"maker": HALF}),
    "key": SemanticObject("cup", SHAPE, attributes={HALF: 1}),
    "inner": SemanticObject("cup", SHAPE, attributes={"parts": [{"maker": HALF}]}),
}
SAVED: dict[str, Callable[[SemanticLayer, Path], Any]] = {
    "hmap": lambda layer, path: save_map(Hypermap([layer]), path),
    "parquet": lambda layer, path: save_map(Hypermap([layer]), path, "parquet"),
    "csv": lambda layer, _: to_csv(layer),
    "geojson": lambda layer, _: to_geojson(layer),
    "gpkg": lambda layer, _: to_geopackage(layer),
}


@pytest.mark.parametrize("place", [*OBJECTS, "layer", "frame"])
@pytest.mark.parametrize("kind", SAVED)
def test_saving_it_is_an_error_that_shows_it(tmp_path: Path, kind: str, place: str) -> None:
    if kind == "gpkg":
        pytest.importorskip("geopandas")
    if kind == "csv" and place in ("layer", "frame"):
        return  # which are not written
    name, frame = (HALF if place == key else key for key in ("layer", "frame"))
    layer = SemanticLayer(name, frame, [OBJECTS[place]] if place in OBJECTS else [])
    with pytest.raises(HypermapError) as error:
        SAVED[kind](layer, tmp_path / "t.hmap")
    assert "cannot be saved: 'caf\\ud83d' holds half of a character" in str(error.value)
    assert not list(tmp_path.iterdir())


def test_saving_it_in_metadata_is_the_same_error(tmp_path: Path) -> None:
    with pytest.raises(HypermapError, match="hypermap_metadata"):
        save_map(Hypermap([], metadata={"made_by": HALF}), tmp_path / "t.hmap")


@pytest.mark.parametrize("place", ["name", "tags", "maker"])
def test_reading_it_from_geojson_names_the_feature(place: str) -> None:
    whole = [SemanticObject("\U0001f431", SHAPE, attributes={"maker": "caf\u00e9"})]
    text = json.dumps(json.loads(to_geojson(SemanticLayer("cats", "map", whole * 2))))
    assert "\\ud83d\\udc31" in text
    assert [cat.name for cat in from_geojson(text)] == ["\U0001f431"] * 2
    document = json.loads(text)
    document["features"][1]["properties"][place] = [HALF] if place == "tags" else HALF
    with pytest.raises(FormatError) as error:
        from_geojson(json.dumps(document), path="cats.geojson")
    assert str(error.value).startswith("cats.geojson: features[1]: ")
    assert str(error.value).endswith("holds half of a character, '\\ud83d'")
