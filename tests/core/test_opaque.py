"""Layers of a kind that nobody here knows."""

from __future__ import annotations

from typing import Any

import pytest
import shapely

from hypermap.core.errors import HypermapError
from hypermap.core.opaque import OpaqueLayer

BOX = shapely.box(0, 0, 1, 1)


@pytest.mark.parametrize(
    ("ask", "asked"),
    [
        ("label_at", ([0, 0],)),
        ("labels_at", ([0, 0],)),
        ("value_at", ([0, 0],)),
        ("labels_in", (BOX,)),
        ("values_in", (BOX,)),
        ("find", ("cup", BOX)),
        ("nearest", ("cup", [0, 0])),
    ],
)
def test_every_question_to_an_unknown_layer_is_an_error(ask: str, asked: tuple[Any, ...]) -> None:
    layer = OpaqueLayer("WifiLayer", "wifi", "map")
    with pytest.raises(HypermapError, match=r"layer 'wifi' cannot be queried: .*'WifiLayer'"):
        getattr(layer, ask)(*asked)


def test_an_unknown_layer_keeps_what_it_was_given_and_says_what_it_is() -> None:
    files = {"wifi.bin": b"1"}
    layer = OpaqueLayer("WifiLayer", "wifi", "map", files, False, {"band": 5})
    files.clear()
    assert (layer.class_name, layer.name, layer.frame_id) == ("WifiLayer", "wifi", "map")
    assert (layer.files, layer.load_file, layer.settings) == (
        {"wifi.bin": b"1"},
        False,
        {"band": 5},
    )
    assert layer.summary() == "of class 'WifiLayer', whose plug-in is not installed"
    assert layer.extent().is_empty
    assert OpaqueLayer("WifiLayer", "wifi", "map").load_file
