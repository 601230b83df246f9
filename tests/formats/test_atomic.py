from __future__ import annotations

import errno
import os
import stat
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from hypermap.core.errors import FileMissing, HypermapError
from hypermap.formats import locks
from hypermap.formats.atomic import file_beside, write_file, write_files
from hypermap.formats.journal import JOURNAL_NAME, read_as_saved
from hypermap.formats.locks import turn_to_edit, turn_to_save

from .killed import killed_at


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


@pytest.mark.parametrize(("function", "number"), [("fsync", errno.EINVAL), ("fchmod", errno.EPERM)])
def test_file_systems_that_cannot_flush_or_keep_permissions_can_keep_maps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, function: str, number: int
) -> None:
    """FAT has the same permissions for all files, and some network file systems cannot flush."""
    write_files(tmp_path, {"a": b"old", "b": b"old"})

    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, function, refuse)
    write_files(tmp_path, {"a": b"new", "b": b"new"})
    write_file(tmp_path / "a", b"newer")
    assert [(tmp_path / name).read_bytes() for name in "ab"] == [b"newer", b"new"]
    if function == "fchmod":  # but nothing becomes readable by others
        (tmp_path / "a").chmod(0o600)
        with pytest.raises(HypermapError, match="a: cannot be saved: Operation not permitted"):
            write_file(tmp_path / "a", b"secret")


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


@pytest.mark.parametrize("linked", ["b", "sub"])
def test_a_link_out_of_the_folder_is_not_followed_to_a_file_that_nobody_named(
    tmp_path: Path, linked: str
) -> None:
    (tmp_path / "folder").mkdir()
    elsewhere = tmp_path / "elsewhere" / "c"
    elsewhere.parent.mkdir()
    elsewhere.write_bytes(b"precious")
    link = tmp_path / "folder" / linked
    link.symlink_to(elsewhere if linked == "b" else elsewhere.parent)
    name = "b" if linked == "b" else "sub/c"
    with pytest.raises(HypermapError) as error:
        write_files(tmp_path / "folder", {"a": b"new", name: b"new"})
    assert str(error.value) == (
        f"{tmp_path / 'folder' / name}: cannot be saved: it is a link that leads out of the "
        "folder; remove it"
    )
    assert names(tmp_path / "folder") == [linked]
    assert elsewhere.read_bytes() == b"precious"


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
    for name in ("a\0b", "a\ud800"):
        with pytest.raises(HypermapError, match="cannot be saved: it is not a valid file name"):
            write_file(tmp_path / name, b"")
    with pytest.raises(FileMissing, match="there is no such folder to save in"):
        write_file(long / "map.hmap", b"")
    assert names(tmp_path) == ["folder"]


def test_a_replaced_file_keeps_its_owner_where_the_system_allows(tmp_path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root may give files away")
    path = tmp_path / "map.hmap"
    write_file(path, b"old")
    os.chown(path, 65534, 65533)
    path.chmod(0o640)
    write_file(path, b"new")
    found = path.stat()
    assert (found.st_uid, found.st_gid, stat.S_IMODE(found.st_mode)) == (65534, 65533, 0o640)


def test_files_are_replaced_in_their_order_when_all_are_on_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order = ["z", "folder/b", "a"]
    write_files(tmp_path, dict.fromkeys(order, b"old"))
    seen = []
    replace = Path.replace

    def look_and_replace(temporary: Path, target: Path) -> Path:
        if target.name != JOURNAL_NAME:
            news = [path.read_bytes() for path in tmp_path.rglob(".hypermap-*.tmp")]
            seen.append([(tmp_path / name).read_bytes() for name in order])
            assert set(news) == {b"new"}
            assert len(news) == len(order) - len(seen) + 1
        return replace(temporary, target)

    monkeypatch.setattr(Path, "replace", look_and_replace)
    write_files(tmp_path, dict.fromkeys(order, b"new"))
    assert seen == [[b"old"] * 3, [b"new", b"old", b"old"], [b"new", b"new", b"old"]]
    assert names(tmp_path) == ["a", "folder", "z"]


WRITE_FILES = """
from hypermap.formats import locks
from hypermap.formats.atomic import write_files
write_files(sys.argv[2], {name: b"new" for name in sys.argv[3:]})
"""


@pytest.mark.parametrize("rename", range(4))
def test_of_a_save_that_is_killed_all_is_seen_or_nothing(tmp_path: Path, rename: int) -> None:
    order = ["a", "folder/b", "c"]
    write_files(tmp_path, dict.fromkeys(order, b"old"))
    assert killed_at(rename, WRITE_FILES, str(tmp_path), *order)

    def read() -> list[bytes]:
        return [(tmp_path / name).read_bytes() for name in order]

    expected = [b"old" if rename == 0 else b"new"] * 3
    assert read_as_saved(tmp_path / "c", read) == expected
    write_files(tmp_path, dict.fromkeys(order, b"newest"))
    assert read() == [b"newest"] * 3
    assert not list(tmp_path.rglob(".hypermap-*"))


def test_a_save_completes_what_a_killed_one_has_begun_and_goes_on_from_there(
    tmp_path: Path,
) -> None:
    write_files(tmp_path, {"a": b"old", "b": b"old"})
    assert killed_at(2, WRITE_FILES, str(tmp_path), "a", "b")  # one of the two is replaced
    write_file(tmp_path / "a", b"newest")
    assert [(tmp_path / name).read_bytes() for name in "ab"] == [b"newest", b"new"]
    assert names(tmp_path) == ["a", "b"]


def test_the_next_save_sweeps_what_a_killed_one_has_left(tmp_path: Path) -> None:
    assert killed_at(0, WRITE_FILES, str(tmp_path), "map.hmap")
    assert len(names(tmp_path)) == 1
    (tmp_path / ".hypermap-notes").touch()  # somebody's own
    write_file(tmp_path / "map.hmap", b"new")
    assert names(tmp_path) == [".hypermap-notes", "map.hmap"]


def test_what_another_librarys_killed_save_has_left_is_swept_too(tmp_path: Path) -> None:
    program = """
from hypermap.formats.atomic import file_beside
with file_beside(sys.argv[2]) as beside:
    beside.write_bytes(b"half")
"""
    path = tmp_path / "room.mcap"
    assert killed_at(0, program, str(path))
    assert len(names(tmp_path)) == 1
    with file_beside(path) as beside:
        beside.write_bytes(b"whole")
    assert names(tmp_path) == ["room.mcap"]


@pytest.mark.parametrize("files", [["a"], ["a", "b"]])
def test_a_save_whose_temporary_files_are_taken_away_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, files: list[str]
) -> None:
    write_files(tmp_path, dict.fromkeys(files, b"old"))
    flush = os.fsync

    def flush_and_lose(handle: int) -> None:
        flush(handle)
        for path in tmp_path.glob(".hypermap-*"):
            path.unlink()

    monkeypatch.setattr(os, "fsync", flush_and_lose)
    with pytest.raises(HypermapError, match="cannot be saved: No such file"):
        write_files(tmp_path, dict.fromkeys(files, b"new"))
    monkeypatch.undo()
    assert [(tmp_path / name).read_bytes() for name in files] == [b"old"] * len(files)
    assert names(tmp_path) == files


def test_a_save_waits_for_another_and_sweeps_nothing_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(locks, "_PATIENCE", 240.0)
    (tmp_path / "a").write_bytes(b"old")
    with turn_to_save([tmp_path]) as turn:
        assert turn == "alone"
        theirs = tmp_path / f".hypermap-{'0' * 16}.tmp"
        theirs.touch()
        saving = threading.Thread(target=write_file, args=(tmp_path / "a", b"new"))
        saving.start()
        saving.join(0.2)
        assert saving.is_alive()
        assert theirs.exists()
    saving.join()
    assert names(tmp_path) == ["a"]
    assert (tmp_path / "a").read_bytes() == b"new"


def test_what_is_being_saved_all_the_time_is_not_read_by_halves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(locks, "_PATIENCE", 0.0)
    assert killed_at(2, WRITE_FILES, str(tmp_path), "a", "b")
    with turn_to_save([tmp_path]):
        with pytest.raises(HypermapError, match="b: is being saved; try again later"):
            read_as_saved(tmp_path / "b", lambda: None)
        with pytest.raises(HypermapError, match="another program is saving here; try again"):
            write_files(tmp_path, {"a": b"newest", "b": b"newest"})


def test_where_the_first_file_cannot_be_replaced_all_stay_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_files(tmp_path, {"a": b"old", "b": b"old"})
    replace = Path.replace

    def refuse(temporary: Path, target: Path) -> Path:
        if target.name == "a":
            raise PermissionError(1, "Operation not permitted", temporary, None, target)
        return replace(temporary, target)

    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(HypermapError, match="a: cannot be saved: Operation not permitted"):
        write_files(tmp_path, {"a": b"new", "b": b"new"})
    assert names(tmp_path) == ["a", "b"]
    assert (tmp_path / "b").read_bytes() == b"old"


def test_readers_while_a_map_is_saved_see_files_of_one_save(tmp_path: Path) -> None:
    path = tmp_path / "config"
    write_files(tmp_path, {"a": b"0", "config": b"0"})
    reads: list[bytes] = []

    def read() -> list[bytes]:
        found = [(tmp_path / "a").read_bytes()]
        if len(reads) < 3:  # another program saves just now
            reads.append(b"%d" % (len(reads) + 1))
            write_files(tmp_path, dict.fromkeys(("a", "config"), reads[-1]))
        return [*found, path.read_bytes()]

    assert read_as_saved(path, read) == [b"3", b"3"]


@pytest.mark.parametrize(
    "content",
    [b"", b"[]", b"{", b'{"token": "0", "names": []}', b'{"token": 1, "names": 2}', b"[" * 99_999]
    + [b'{"token": "0123456789abcdef", "names": [%s]}' % n for n in (b'"../a"', b'"/a"', b'""')],
)
def test_a_journal_that_is_none_is_named(tmp_path: Path, content: bytes) -> None:
    journal = tmp_path / JOURNAL_NAME
    journal.write_bytes(content)
    with pytest.raises(HypermapError) as error:
        read_as_saved(tmp_path / "config", lambda: None)
    assert str(error.value) == f"{journal}: is not a journal of a save; delete it"
    write_file(tmp_path / "other.hmap", b"")  # which has nothing to do with it


def test_pipes_with_the_names_of_our_files_are_not_waited_for(tmp_path: Path) -> None:
    part = tmp_path / ".hypermap-0123456789abcdef.part"
    os.mkfifo(part)
    write_file(tmp_path / "map.hmap", b"")
    os.mkfifo(tmp_path / JOURNAL_NAME)
    with pytest.raises(HypermapError, match="is not a journal of a save; delete it"):
        read_as_saved(tmp_path / "config", lambda: None)
    write_file(tmp_path / "map.hmap", b"")
    assert names(tmp_path) == [JOURNAL_NAME, "map.hmap"]


def test_who_waits_for_a_turn_to_edit_misses_nothing_that_was_saved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(locks, "_PATIENCE", 240.0)
    monkeypatch.setattr(locks, "_PAUSE", 0.001)
    path = tmp_path / "map.hmap"
    path.write_bytes(b"0")

    def count(_: int) -> None:
        with turn_to_edit(path):
            number = int(path.read_bytes())
            write_file(path, b"%d" % (number + 1))

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(count, range(20)))
    assert path.read_bytes() == b"20"
    monkeypatch.setattr(locks, "_PATIENCE", 0.0)
    (tmp_path / "link.hmap").symlink_to(path)
    with (
        turn_to_edit(path),
        pytest.raises(HypermapError, match="another program is changing it; try again"),
        turn_to_edit(tmp_path / "link.hmap"),
    ):
        pass


def test_who_edits_does_not_keep_a_folder_from_being_saved_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(locks, "_PATIENCE", 0.0)
    with turn_to_edit(tmp_path), turn_to_save([tmp_path]) as turn:
        assert turn == "alone"


def test_a_save_does_not_wait_for_itself_where_a_folder_has_two_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(locks, "_PATIENCE", 0.0)
    monkeypatch.chdir(tmp_path)
    Path("other").write_bytes(b"old")
    Path("link").symlink_to("other")
    write_files(".", {"link": b"new", "map": b""})
    assert Path("other").read_bytes() == b"new"


def test_another_library_writes_beside_and_replaces_the_file_in_the_end(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(b"old")
    path.chmod(0o640)
    with file_beside(path) as beside:
        assert beside.suffix == ".mcap"
        beside.write_bytes(b"new")
        write_file(tmp_path / "map.hmap", b"")  # a save of a map does not sweep it away
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640

    def fail() -> None:
        with file_beside(path) as beside:
            beside.write_bytes(b"part")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_bytes() == b"new"
    killed = tmp_path / f".hypermap-{'0' * 16}.part.mcap"
    killed.touch()
    write_file(tmp_path / "map.hmap", b"")
    assert names(tmp_path) == ["log.mcap", "map.hmap"]


def test_what_is_saved_is_on_the_disk_contents_first_and_names_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flushed = []
    fsync = os.fsync

    def note(handle: int) -> None:
        status = os.fstat(handle)
        assert stat.S_ISDIR(status.st_mode) or status.st_size > 0  # all of it was handed over
        flushed.append(status.st_ino)
        fsync(handle)

    monkeypatch.setattr(os, "fsync", note)
    write_files(tmp_path, {"a": b"1", "folder/b": b"2"})
    files, folders = ([tmp_path / "a", tmp_path / "folder/b"], [tmp_path, tmp_path / "folder"])
    contents = [file.stat().st_ino for file in files]
    names = sorted(folder.stat().st_ino for folder in folders)
    assert flushed[:2] == contents
    assert sorted(flushed[2:4]) == names  # before the journal says that all are there
    assert flushed[4] not in (*contents, *names)
    assert sorted(flushed[-2:]) == names


# A limit on the size of files is the nearest thing to a full disk that needs no rights: the write
# fails half way with an error of the operating system.
FULL_DISK = """
import resource, signal, sys
from hypermap.core.errors import HypermapError
from hypermap.formats import locks
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
    said = "cannot be saved: File too large; allow larger files (ulimit -f), or save elsewhere"
    assert done.stdout == f"{tmp_path / 'b'}: {said}\n"
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
