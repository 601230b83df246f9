from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from hypermap.core.errors import FileMissing, HypermapError
from hypermap.formats.atomic import write_file, write_files


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_is_replaced_and_keeps_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "map.hmap"
    write_file(path, b"old")
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~umask
    path.chmod(0o640)
    write_file(path, b"new")
    assert path.read_bytes() == b"new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert names(tmp_path) == ["map.hmap"]


def test_folders_below_are_made_and_may_be_there_already(tmp_path: Path) -> None:
    for content in (b"1", b"2"):
        write_files(tmp_path, {"one/two/a": content, "one/b": content})
        assert (tmp_path / "one/two/a").read_bytes() == content
        assert (tmp_path / "one/b").read_bytes() == content


def test_saving_leaves_no_file_open(tmp_path: Path) -> None:
    next_number = os.dup(0)
    os.close(next_number)
    write_files(tmp_path, {"a": b"1", "folder/b": b"2"})
    again = os.dup(0)
    os.close(again)
    assert again == next_number


def test_a_link_keeps_pointing_at_the_file_that_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    target = tmp_path / "real" / "map.hmap"
    target.write_bytes(b"old")
    link = tmp_path / "link.hmap"
    link.symlink_to(target)
    write_file(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"


def test_where_it_cannot_be_written_the_message_says_why(tmp_path: Path) -> None:
    with pytest.raises(FileMissing) as missing:
        write_file(tmp_path / "none" / "map.hmap", b"")
    assert str(missing.value) == f"{tmp_path / 'none'}: there is no such folder to save in"
    (tmp_path / "folder").mkdir()
    with pytest.raises(HypermapError) as folder:
        write_file(tmp_path / "folder", b"")
    assert str(folder.value) == (
        f"{tmp_path / 'folder'}: is a folder; choose another name to save under"
    )
    long = tmp_path / ("x" * 300)
    with pytest.raises(HypermapError) as error:
        write_file(long, b"")
    assert str(error.value) == f"{long}: cannot be saved: File name too long"
    with pytest.raises(HypermapError, match="cannot be saved: it is no name of a file"):
        write_file(tmp_path / "a\0b", b"")
    with pytest.raises(FileMissing, match="there is no such folder to save in"):
        write_file(long / "map.hmap", b"")
    assert names(tmp_path) == ["folder"]


def test_files_are_replaced_in_their_order_when_all_are_on_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order = ["z", "folder/b", "a"]
    write_files(tmp_path, dict.fromkeys(order, b"old"))
    seen = []
    replace = Path.replace

    def look_and_replace(temporary: Path, target: Path) -> Path:
        news = [path.read_bytes() for path in tmp_path.rglob(".hypermap-*")]
        seen.append([(tmp_path / name).read_bytes() for name in order])
        assert set(news) == {b"new"}
        assert len(news) == len(order) - len(seen) + 1
        return replace(temporary, target)

    monkeypatch.setattr(Path, "replace", look_and_replace)
    write_files(tmp_path, dict.fromkeys(order, b"new"))
    assert seen == [[b"old"] * 3, [b"new", b"old", b"old"], [b"new", b"new", b"old"]]


def test_what_is_saved_is_on_the_disk_contents_first_and_names_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flushed = []
    fsync = os.fsync

    def note(handle: int) -> None:
        status = os.fstat(handle)
        assert stat.S_ISDIR(status.st_mode) or status.st_size == 1  # all of it was handed over
        flushed.append(status.st_ino)
        fsync(handle)

    monkeypatch.setattr(os, "fsync", note)
    write_files(tmp_path, {"a": b"1", "folder/b": b"2"})
    files, folders = ([tmp_path / "a", tmp_path / "folder/b"], [tmp_path, tmp_path / "folder"])
    assert flushed[:2] == [file.stat().st_ino for file in files]
    assert sorted(flushed[2:]) == sorted(folder.stat().st_ino for folder in folders)


# A limit on the size of files is the nearest thing to a full disk that needs no rights: the write
# fails half way with an error of the operating system.
FULL_DISK = """
import resource, signal, sys
from hypermap.core.errors import HypermapError
from hypermap.formats.atomic import write_files
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.RLIM_INFINITY))
try:
    write_files(sys.argv[1], {"a": b"new", "b": b"x" * 100_000})
except HypermapError as error:
    print(error)
"""


def test_a_full_disk_leaves_the_old_files_and_no_litter(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"old a")
    (tmp_path / "b").write_bytes(b"old b")
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(tmp_path)], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"{tmp_path / 'b'}: cannot be saved: File too large\n"
    assert names(tmp_path) == ["a", "b"]
    assert (tmp_path / "a").read_bytes() == b"old a"
    assert (tmp_path / "b").read_bytes() == b"old b"


def test_an_interrupt_while_writing_leaves_no_litter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(_: int) -> None:
        raise KeyboardInterrupt

    (tmp_path / "a").write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_files(tmp_path, {"a": b"new"})
    assert names(tmp_path) == ["a"]
    assert (tmp_path / "a").read_bytes() == b"old"
