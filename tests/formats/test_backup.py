"""What becomes of a map and of its older backup when a new map is saved over it."""

from __future__ import annotations

import errno
import itertools
import os
import resource
import signal
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.formats import atomic, journal, open_map, save_map
from hypermap.formats.backup import backup_of, save_with_backup
from hypermap.formats.config import CONFIG_NAME
from hypermap.formats.journal import JOURNAL_NAME

from .maps import small_map

ADDRESSES = ["lab.hmap", CONFIG_NAME]
OLDER = b"an older backup"


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def large_map() -> Hypermap:
    """Return a map whose file is larger than those of the small one, packed or not."""
    cells = np.random.default_rng(0).integers(0, 101, (100, 100)).astype(np.int8)
    return Hypermap([OccupancyLayer("occupancy", "map", GridGeometry(100, 100, 0.1), cells)])


@pytest.fixture(params=ADDRESSES)
def path(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A map, with an older backup."""
    path: Path = tmp_path / request.param
    save_map(small_map(), path)
    backup_of(path).write_bytes(OLDER)
    return path


@contextmanager
def no_file_beyond(size: int) -> Iterator[None]:
    """Let no file grow beyond so many bytes, as on a full disk."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def failing_at(number: int) -> Callable[[Path, Path], Path]:
    """Return what renames files, and fails once, at one of the renames."""
    replace, left = Path.replace, itertools.count(-number)

    def replace_or_fail(temporary: Path, target: Path) -> Path:
        if next(left) == 0:
            raise OSError(errno.EIO, os.strerror(errno.EIO), str(temporary), None, str(target))
        return replace(temporary, target)

    return replace_or_fail


def test_the_backup_is_what_a_save_replaced_and_only_its_owner_may_read_it_either(
    path: Path,
) -> None:
    path.chmod(0o600)
    before = open_map(path)
    assert save_with_backup(large_map(), path) == backup_of(path)
    assert "objects" in open_map(backup_of(path))
    assert len(open_map(backup_of(path)).objects()) == len(before.objects())
    assert "objects" not in open_map(path)
    assert stat.S_IMODE(backup_of(path).stat().st_mode) == 0o600
    assert not [name for name in files(path.parent) if name.startswith(".")]


def test_a_map_that_cannot_be_written_changes_nothing(path: Path) -> None:
    before = files(path.parent)

    class Unknown(OccupancyLayer):
        class_name = "Unknown"

    with pytest.raises(HypermapError, match="no plug-in"):
        save_with_backup(Hypermap([Unknown("occupancy", "map")]), path)
    assert files(path.parent) == before


@pytest.mark.parametrize("size", [0, 100, 6000])
def test_a_full_disk_changes_nothing(path: Path, size: int) -> None:
    before = files(path.parent)
    assert len(before[path.name]) < 6000
    with no_file_beyond(size), pytest.raises(HypermapError) as raised:
        save_with_backup(large_map(), path)
    assert ("cannot keep a backup" in str(raised.value)) == (size < 6000)
    assert "ulimit -f" in str(raised.value)
    assert files(path.parent) == before


@pytest.mark.parametrize("has_older", [True, False])
def test_a_rename_that_fails_changes_nothing(
    path: Path, has_older: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not has_older:
        backup_of(path).unlink()
    before = files(path.parent)
    for number in itertools.count():
        monkeypatch.setattr(Path, "replace", failing_at(number))
        try:
            save_with_backup(large_map(), path)
        except HypermapError as error:
            assert "Input/output error" in str(error)  # noqa: PT017 - the last one is no error
            if JOURNAL_NAME in files(path.parent):
                break  # it counts as saved: the next reader completes it
            assert files(path.parent) == before
        else:
            break
    assert number == (3 if path.name == CONFIG_NAME else 2)
    monkeypatch.undo()
    assert "objects" not in open_map(path)
    assert "objects" in open_map(backup_of(path))


def test_a_save_interrupted_when_it_is_done_keeps_the_backup_of_what_it_replaced(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = path.read_bytes()

    def interrupted(folder: Path) -> None:
        if path.read_bytes() != before:
            raise KeyboardInterrupt

    monkeypatch.setattr(journal, "flush_folder", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_with_backup(large_map(), path)
    monkeypatch.undo()
    assert "objects" not in open_map(path)
    assert "objects" in open_map(backup_of(path))


def test_a_folder_with_the_name_of_the_backup_stays(path: Path) -> None:
    backup_of(path).unlink()
    backup_of(path).mkdir()
    (backup_of(path) / "mine").touch()
    before = path.read_bytes()
    with pytest.raises(HypermapError, match=r"cannot keep a backup.*Is a directory"):
        save_with_backup(large_map(), path)
    assert path.read_bytes() == before
    assert (backup_of(path) / "mine").exists()


def test_nobody_else_may_read_the_backup_of_a_private_map_while_it_is_written(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path.chmod(0o600)
    look, modes = atomic._look_like, []

    def seen(like: Path, handle: int) -> None:
        modes.append(stat.S_IMODE(os.fstat(handle).st_mode))
        look(like, handle)

    monkeypatch.setattr(atomic, "_look_like", seen)
    save_with_backup(large_map(), path)
    assert modes[-1] == 0o600


def test_where_files_have_one_name_only_an_older_backup_is_replaced_all_the_same(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:  # as on FAT
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "link", refused)
    save_with_backup(large_map(), path)
    assert "objects" in open_map(backup_of(path))
    assert not [name for name in files(path.parent) if name.startswith(".")]


def test_where_there_is_no_map_there_is_no_backup(tmp_path: Path) -> None:
    assert save_with_backup(small_map(), tmp_path / "lab.hmap") is None
    assert list(files(tmp_path)) == ["lab.hmap"]
