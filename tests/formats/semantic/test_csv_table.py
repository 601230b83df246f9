from __future__ import annotations

import csv
import io
import json

import shapely

from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats.semantic.csv_table import to_csv
from hypermap.testing import square


def rows(*things: SemanticObject) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(to_csv(SemanticLayer("s", "map", things)), newline="")))


def test_a_row_tells_all_of_an_object_and_its_shape_to_a_nanometre() -> None:
    cup = square(
        "cup", 0.1, 0.2, 1 / 3, tags=("mug", "bowl"), confidence=(0.75, 0.25), last_seen=2.5
    )
    (row,) = rows(cup)
    assert shapely.from_wkt(row["geometry"]).equals_exact(cup.footprint, 1e-9)
    assert (row["x"], row["y"], row["area"]) == ("0.1", "0.2", "0.111111111")
    assert json.loads(row["tags"]) == ["mug", "bowl"]
    assert json.loads(row["confidence"]) == [0.75, 0.25]
    assert (row["last_seen"], row["first_seen"], row["existence"]) == ("2.5", "", "")


def test_names_with_commas_quotes_and_lines_stay_one_cell() -> None:
    names = ["a, b", 'the "red" cup', "two\nlines", "Tür"]
    assert [row["name"] for row in rows(*(square(name, 0, 0) for name in names))] == names


def test_attributes_have_columns_and_take_none_of_ours() -> None:
    attributes = {"x": "mine", "geometry": 1, "colors": ["red"], "is_new": True, "z_max": 0.9}
    first, second = rows(square("a", 5, 6), square("b", 7, 8, attributes=attributes))
    assert (second["x"], second["y"]) == ("7.0", "8.0")
    assert second["geometry"].startswith("POLYGON")
    assert (second["colors"], second["is_new"], second["z_max"]) == ('["red"]', "true", "0.9")
    assert (first["colors"], first["z_max"]) == ("", "")


def test_an_outline_that_crosses_itself_has_the_middle_of_its_repaired_shape() -> None:
    bow_tie = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
    layer = SemanticLayer("s", "map", [SemanticObject("tie", bow_tie)])
    (row,) = rows(SemanticObject("tie", bow_tie))
    assert [[float(row["x"]), float(row["y"])]] == layer.find("tie").tolist()
    assert row["area"] == "2.0"


def test_an_empty_layer_is_a_head_alone() -> None:
    text = to_csv(SemanticLayer("s", "map"))
    assert text == "id,name,x,y,area,existence,first_seen,last_seen,tags,geometry\r\n"
