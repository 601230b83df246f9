from __future__ import annotations

from pathlib import Path

import pytest

from hypermap import open_map
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.server.save_at_end import announce_end, archive_to_save, save_at_end
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
    save_at_end(hypermap, path, (), log)
    assert_same_objects(open_map(path)["semantic"].objects(), hypermap["semantic"].objects())
    assert log.lines == [f"info: stored the map in {path}"]


@pytest.mark.parametrize(
    "hypermap", [Hypermap(), Hypermap([OccupancyLayer("a", "map"), SemanticLayer("b", "map")])]
)
def test_an_older_file_is_worth_more_than_an_empty_map(hypermap, tmp_path: Path) -> None:
    path = tmp_path / "office.hmap"
    path.write_text("old")
    log = Log()
    save_at_end(hypermap, path, (), log)
    assert path.read_text() == "old"
    assert log.lines == [f"warning: {path} is not written: nothing has arrived in any layer"]


def room(name: str) -> Hypermap:
    return Hypermap([SemanticLayer("semantic", "map", [square(name, 0, 0)])])


def names(path: Path) -> list[str]:
    return [item.name for item in open_map(path)["semantic"].objects()]


def test_a_file_that_holds_another_map_stays_as_it_is(tmp_path: Path) -> None:
    path, log = tmp_path / "office.hmap", Log()
    for name in ("desk", "sofa", "bed"):
        announce_end(path, (), log)
        save_at_end(room(name), path, (), log)
    beside = [tmp_path / "office-1.hmap", tmp_path / "office-2.hmap"]
    assert [names(file) for file in (path, *beside)] == [["desk"], ["sofa"], ["bed"]]
    stays = f"{path} is there already, and this node has not loaded it: it is unchanged"
    assert log.lines == [
        f"info: the map will be stored in {path} at the end",
        f"info: stored the map in {path}",
        f"warning: {stays}, and the map will be stored in {beside[0]} at the end",
        f"warning: {stays}",
        f"info: stored the map in {beside[0]}",
        f"warning: {stays}, and the map will be stored in {beside[1]} at the end",
        f"warning: {stays}",
        f"info: stored the map in {beside[1]}",
    ]


def test_the_file_that_the_map_was_loaded_from_takes_it_again(tmp_path: Path) -> None:
    path, log = tmp_path / "office.hmap", Log()
    save_at_end(room("desk"), path, (), log)
    (tmp_path / "link").symlink_to(tmp_path)
    save_at_end(room("sofa"), path, [tmp_path / "link" / "office.hmap"], log)
    assert names(path) == ["sofa"]
    assert [line.split(":")[0] for line in log.lines] == ["info", "info"]


def test_a_map_that_cannot_be_stored_is_an_error_in_the_log(tmp_path: Path) -> None:
    path = tmp_path / "gone" / "office.hmap"
    log = Log()
    save_at_end(room("desk"), path, (), log)
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
