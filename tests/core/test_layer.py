from __future__ import annotations

import numpy as np
import pytest

from hypermap.core.layer import Hits, Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer


def test_hits_have_one_place_per_value() -> None:
    assert len(Hits(np.array([1, 2]), np.zeros((2, 2)))) == 2
    with pytest.raises(ValueError, match=r"expected points of shape \(2, 2\), got \(3, 2\)"):
        Hits(np.array([1, 2]), np.zeros((3, 2)))


@pytest.mark.parametrize(
    ("name", "frame_id", "message"),
    [("", "map", "a layer needs a name"), ("rooms", "", "layer 'rooms' needs a frame_id")],
)
def test_a_layer_needs_a_name_and_a_frame(name: str, frame_id: str, message: str) -> None:
    with pytest.raises(ValueError) as caught:
        SemanticLayer(name, frame_id)
    assert str(caught.value) == message


@pytest.mark.parametrize("k", [0, -1])
@pytest.mark.parametrize("kind", [SemanticLayer, OccupancyLayer])
def test_the_nearest_of_none_is_an_error_in_any_layer(kind: type[Layer], k: int) -> None:
    with pytest.raises(ValueError, match=f"k must be at least 1, got {k}"):
        kind("rooms", "map").nearest("occupied", [0, 0], k)


def test_a_layer_keeps_its_own_copy_of_the_settings() -> None:
    settings = {"file": "rooms"}
    layer = SemanticLayer("rooms", "map", settings=settings)
    settings["file"] = "other"
    assert layer.settings == {"file": "rooms"}
