from __future__ import annotations

from pathlib import Path

import pytest

from hypermap import open_map
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.server.save_at_end import archive_to_save, save_at_end
from hypermap.testing import assert_same_objects, square


class Log:
    def __init__(self) -> None:
        self.lines: list[str] = []

    def log(self, level: str, text: str) -> None:
        self.lines.append(f"{level}: {text}")


def test_a_map_is_stored_at_the_end(tmp_path: Path) -> None:
    path = archive_to_save({"save_to": str(tmp_path / "office.hmap")})
    assert path is not None
    hypermap = Hypermap([SemanticLayer("semantic", "map", [square("desk", 0, 0)])])
    log = Log()
    save_at_end(hypermap, path, log)
    assert_same_objects(open_map(path)["semantic"].objects(), hypermap["semantic"].objects())
    assert log.lines == [f"info: stored the map in {path}"]


@pytest.mark.parametrize(
    "hypermap", [Hypermap(), Hypermap([OccupancyLayer("a", "map"), SemanticLayer("b", "map")])]
)
def test_an_older_file_is_worth_more_than_an_empty_map(hypermap, tmp_path: Path) -> None:
    path = tmp_path / "office.hmap"
    path.write_text("old")
    log = Log()
    save_at_end(hypermap, path, log)
    assert path.read_text() == "old"
    assert log.lines == [f"warning: {path} is not written: nothing has arrived in any layer"]


def test_a_map_that_cannot_be_stored_is_an_error_in_the_log(tmp_path: Path) -> None:
    path = tmp_path / "gone" / "office.hmap"
    log = Log()
    save_at_end(Hypermap([SemanticLayer("s", "map", [square("desk", 0, 0)])]), path, log)
    (line,) = log.lines
    assert line.startswith("error: the map could not be stored: ")
    assert str(path.parent) in line


def test_what_cannot_be_stored_is_refused_at_the_start(tmp_path: Path) -> None:
    assert archive_to_save({"save_to": ""}) is None
    assert archive_to_save({}) is None
    with pytest.raises(HypermapError, match=r"save_to: '.*office.yaml': .* ends in .hmap"):
        archive_to_save({"save_to": str(tmp_path / "office.yaml")})
    with pytest.raises(HypermapError, match="there is no folder"):
        archive_to_save({"save_to": str(tmp_path / "gone" / "office.hmap")})
