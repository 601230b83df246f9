"""Which version of a map a message points to."""

from __future__ import annotations

import dataclasses

import pytest
import shapely

from hypermap import Hypermap, SemanticLayer, SemanticObject
from hypermap.console.moments import left_the_map, map_at
from hypermap.core.errors import HypermapError
from hypermap.history import begin_history
from hypermap.history.grown import grown

NAMES = ("chair", "bed", "sofa")


def emptied() -> Hypermap:
    """Return a map whose chair, bed and sofa were removed, in the versions 2, 3 and 4."""
    things = [SemanticObject(name, shapely.box(x, 0, x + 1, 1)) for x, name in enumerate(NAMES)]
    hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    assert begin_history(hypermap)
    for day, item in enumerate(range(len(NAMES))):
        hypermap.semantic().remove(item)
        hypermap = grown(hypermap, now=86400.0 * (1 + day))
    return hypermap


def test_the_version_named_is_one_that_shows_the_object_or_none_is_named() -> None:
    hypermap = emptied()
    history = hypermap.history
    assert history is not None
    for lost in (None, 2, 3, 4):  # the version before which a part of the history is lost
        added = tuple(
            dataclasses.replace(one, follows_loss=one.version == lost) for one in history.added
        )
        hypermap.history = dataclasses.replace(history, added=added)
        for name, left_in in zip(NAMES, (2, 3, 4), strict=True):
            said = left_the_map(hypermap, name)
            assert said is not None
            if f"--as-of v{left_in - 1}" in said:
                assert name in map_at(hypermap, f"v{left_in - 1}")[0].semantic().names
            elif left_in > 2 and lost != left_in:  # the first known version has none before it
                with pytest.raises(HypermapError, match="a later part of its history is lost"):
                    map_at(hypermap, f"v{left_in - 1}")
