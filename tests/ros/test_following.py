"""How the map server takes over what others change in its map."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from hypermap.core.frames import FrameTree
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.server.current_map import CurrentMap
from hypermap.ros.server.following import Following
from hypermap.testing import occupancy_from_text, square

from .conftest import wait_for
from .map_server_tools import LAB


class Others:
    """A map that others change; it is a port with a log, too."""

    name, address = "lab", "postgresql://db/maps?site=lab"
    is_shut_down = False

    def __init__(self, hypermap: Hypermap) -> None:
        self.hypermap = hypermap
        self.lines: list[str] = []

    def log(self, _level: str, text: str) -> None:
        self.lines.append(text)


class Seen:
    """A part that remembers which layers it was shown as changed."""

    def __init__(self) -> None:
        self.changes: list[Any] = []

    def set(self, values: Any) -> None: ...
    def close(self) -> None: ...

    def show(self, _: Hypermap, changed: Any = None) -> None:
        self.changes.append(changed)


def things(*names: str) -> Layer:
    return SemanticLayer("things", "map", [square(name, i, 0) for i, name in enumerate(names)])


@pytest.fixture
def others() -> Others:
    return Others(Hypermap([occupancy_from_text("..", name="grid"), things("cup")]))


@pytest.fixture
def seen() -> Seen:
    return Seen()


@pytest.fixture
def current(others: Others, seen: Seen) -> Iterator[CurrentMap]:
    port: Any = others
    current = CurrentMap(port)
    current.replace(others.hypermap)
    following = Following(port, current, others, others.hypermap)
    current.show_on([seen, following])
    yield current
    current.show_no_more()
    following.close()


def test_only_layers_that_others_have_changed_are_shown_again(
    others: Others, seen: Seen, current: CurrentMap
) -> None:
    others.hypermap = others.hypermap.with_layer(things("cup", "lamp"))
    wait_for(lambda: seen.changes[1:], "the change")
    assert seen.changes == [None, ["things"]]
    assert current.hypermap["things"] is others.hypermap["things"]


@pytest.mark.parametrize("what", ["layers", "frames"])
def test_a_map_of_other_layers_or_frames_is_shown_as_a_whole(
    others: Others, seen: Seen, current: CurrentMap, what: str
) -> None:
    layers = list(others.hypermap)
    if what == "layers":
        others.hypermap = others.hypermap.with_layers(layers[1:])
    else:
        others.hypermap = Hypermap(layers, FrameTree([LAB]))
    wait_for(lambda: seen.changes[1:], "the change")
    assert seen.changes == [None, None]
    assert list(current.hypermap) == list(others.hypermap)


def test_a_map_that_a_client_has_loaded_stays(others: Others, current: CurrentMap) -> None:
    loaded = Hypermap([things("bed")])
    current.replace(loaded)
    assert others.lines == ["another map was loaded; that of the store is not followed"]
    others.hypermap = others.hypermap.with_layer(things("lamp"))
    wait_for(
        lambda: "following" not in {thread.name for thread in threading.enumerate()},
        "the end of following",
    )
    assert current.hypermap is loaded
