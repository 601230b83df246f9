from __future__ import annotations

import io
import random
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.formats import limits
from hypermap.formats.archive import read_archive, write_archive

FILES = {"hmap_config.yaml": b"layers: []\n", "a/b": bytes(range(256)) * 20, "empty": b""}


def test_what_is_written_is_read_again_in_order(tmp_path: Path) -> None:
    path = tmp_path / "t.hmap"
    write_archive(path, FILES)
    store = read_archive(path)
    assert store.files == FILES
    assert list(store.files) == list(FILES)
    assert store.path_of("a/b") == f"{path}/a/b"


def test_the_same_files_give_the_same_bytes(tmp_path: Path) -> None:
    write_archive(tmp_path / "one", FILES)
    write_archive(tmp_path / "two", FILES)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    with zipfile.ZipFile(tmp_path / "one") as archive:
        for info in archive.infolist():
            assert info.date_time == (1980, 1, 1, 0, 0, 0)
            assert info.external_attr >> 16 == 0o100644


def test_pictures_and_what_shrinks_like_a_bomb_are_stored_unpacked(tmp_path: Path) -> None:
    zeros = bytes(2 * limits.SMALL_FILE_BYTES)
    write_archive(tmp_path / "t", {"zeros": zeros, "p.png": b"\x89PNG" * 99, "text": b"text" * 99})
    with zipfile.ZipFile(tmp_path / "t") as archive:
        stored = {i.filename: i.compress_type == zipfile.ZIP_STORED for i in archive.infolist()}
    assert stored == {"zeros": True, "p.png": True, "text": False}
    assert read_archive(tmp_path / "t").files["zeros"] == zeros


def zipped(build: Callable[[zipfile.ZipFile], None]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        build(archive)
    return file.getvalue()


def zip_of(name: str, content: bytes = b"x", method: int = zipfile.ZIP_DEFLATED) -> bytes:
    return zipped(lambda archive: archive.writestr(name, content, method))


def nameless() -> bytes:
    info = zipfile.ZipInfo("x")
    info.filename = ""
    return zipped(lambda archive: archive.writestr(info, b"x"))


def encrypted() -> bytes:
    packed = bytearray(zip_of("secret"))
    packed[6] |= 1  # the flag in the member's header, and in the directory
    packed[packed.index(b"PK\x01\x02") + 8] |= 1
    return bytes(packed)


def twice() -> bytes:
    packed = zipped(lambda z: (z.writestr("one", b"1"), z.writestr("two", b"2"))[0])
    return packed.replace(b"two", b"one")


@pytest.mark.parametrize(
    ("packed", "message"),
    [
        (b"", "is empty"),
        (b"layers: []", "is not a zip archive"),
        (b"\x89PNG\r\n", "is not a zip archive"),
        (zip_of("a", b"abc" * 999)[:40], "is not an intact zip archive: its end is missing"),
        (zip_of("../../x"), "the file name '../../x' is not allowed; it must be within"),
        (zip_of("/etc/passwd"), "the file name '/etc/passwd' is not allowed"),
        (zip_of("a\\b"), "the file name 'a\\\\b' is not allowed"),
        (nameless(), "the file name '' is not allowed; it must be within"),
        (encrypted(), "secret: is encrypted"),
        (twice(), "one: appears twice"),
        (zip_of("a", method=zipfile.ZIP_LZMA), "a: is packed by another method than deflate"),
        (zip_of("a", bytes(10 << 20)), "a: unpacks to more than 200 times its size"),
    ],
    ids=lambda value: value[:30] if isinstance(value, str) else "",
)
def test_a_bad_archive_is_one_clear_error(tmp_path: Path, packed: bytes, message: str) -> None:
    path = tmp_path / "t.hmap"
    path.write_bytes(packed)
    with pytest.raises(FormatError) as error:
        read_archive(path)
    assert str(error.value).startswith(f"{path}: {message}")


def test_a_missing_archive_and_a_folder_are_distinguished(tmp_path: Path) -> None:
    with pytest.raises(FileMissing) as missing:
        read_archive(tmp_path / "none.hmap")
    assert str(missing.value) == f"{tmp_path / 'none.hmap'}: there is no such file"
    with pytest.raises(FormatError) as folder:
        read_archive(tmp_path)
    assert str(folder.value) == f"{tmp_path}: is a folder, not a file"


@pytest.mark.parametrize(
    ("limit", "value", "message"),
    [
        ("MAX_MEMBERS", 2, "has more than 2 members"),
        ("MAX_FILE_BYTES", 5000, "a/b: unpacks to 5120 bytes, more than the 5000"),
        ("MAX_ARCHIVE_BYTES", 5130, "unpacks to 5131 bytes, more than the 5130"),
        ("MAX_ARCHIVE_BYTES", 400, "holds "),
    ],
)
def test_limits_are_checked_before_anything_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, value: int, message: str
) -> None:
    path = tmp_path / "t.hmap"
    write_archive(path, FILES)
    monkeypatch.setattr(limits, limit, value)
    with pytest.raises(FormatError) as error:
        read_archive(path)
    assert str(error.value).startswith(f"{path}: {message}")


def as_zip64(packed: bytes) -> bytes:
    """Return the same archive with its counts in ZIP64's end, and none in the other."""
    end = packed.rindex(b"PK\x05\x06")
    count, size, start = struct.unpack_from("<HII", packed, end + 10)
    numbers = (44, 45, 45, 0, 0, count, count, size, start)
    record = b"PK\x06\x06" + struct.pack("<QHHIIQQQQ", *numbers)
    locator = b"PK\x06\x07" + struct.pack("<IQI", 0, end, 1)
    return packed[:end] + record + locator + packed[end : end + 8] + bytes(14)


def test_zip64_hides_no_members(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "t.hmap"
    write_archive(path, FILES)
    path.write_bytes(as_zip64(path.read_bytes()))
    assert read_archive(path).files == FILES

    def refuse(*_: object) -> None:
        raise AssertionError("the directory is read")

    monkeypatch.setattr(limits, "MAX_MEMBERS", 2)
    monkeypatch.setattr(zipfile, "ZipFile", refuse)
    with pytest.raises(FormatError, match="has more than 2 members"):
        read_archive(path)
    path.write_bytes(path.read_bytes().replace(b"PK\x06\x06", b"PK\x06\x00"))
    with pytest.raises(FormatError, match="is not an intact zip archive: its end is damaged"):
        read_archive(path)


def test_a_member_that_unpacks_to_more_than_it_says_is_cut_off(tmp_path: Path) -> None:
    content = random.Random(0).randbytes(1000) * 50
    packed = bytearray(zip_of("a", content))
    entry = packed.index(b"PK\x01\x02")
    packed[entry + 24 : entry + 28] = (1000).to_bytes(4, "little")
    path = tmp_path / "t.hmap"
    path.write_bytes(packed)
    with pytest.raises(FormatError, match="is not an intact zip archive: Bad CRC-32 for file 'a'"):
        read_archive(path)


def test_a_map_that_could_not_be_read_again_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "MAX_ARCHIVE_BYTES", 1000)
    with pytest.raises(HypermapError) as error:
        write_archive(tmp_path / "t.hmap", FILES)
    assert str(error.value) == (
        f"{tmp_path / 't.hmap'}: the map is too large to be saved: 5131 bytes, 5120 in one file"
    )
    assert list(tmp_path.iterdir()) == []


def test_damage_never_gives_another_error(tmp_path: Path) -> None:
    path = tmp_path / "t.hmap"
    write_archive(path, FILES)
    intact = path.read_bytes()
    chance = random.Random(0)
    messages = []
    for turn in range(1500):
        damaged = bytearray(intact)
        for _ in range(chance.randint(1, 8)):
            damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        path.write_bytes(damaged[: chance.randrange(len(damaged))] if turn % 5 == 0 else damaged)
        try:
            read_archive(path)
        except FormatError as error:
            messages.append(str(error))
    assert len(messages) > 500
    assert all(message.startswith(f"{path}: ") for message in messages)
