from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hypermap import open_map
from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.core.layer import Store
from hypermap.formats import limits
from hypermap.formats.store import FolderStore, MemoryStore, safe_name
from hypermap.perception.detectors.load import load_detector
from hypermap.recordings import open_recording


@pytest.fixture(params=["memory", "folder"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> MemoryStore | FolderStore:
    return MemoryStore(where="t.hmap") if request.param == "memory" else FolderStore(tmp_path)


def test_a_store_gives_back_what_was_written(store: Store) -> None:
    store.write("semantic", b"old")
    store.write("semantic", b"new")
    store.write("maps/floor.yaml", b"\x00\xff")
    assert store.read("semantic") == b"new"
    assert store.read("maps/./floor.yaml") == b"\x00\xff"


def test_a_missing_file_is_named(store: Store) -> None:
    with pytest.raises(FormatError) as error:
        store.read("rooms")
    assert str(error.value).startswith(f"{store.path_of('rooms')}: there is no such file")


OUT = ["", ".", "..", "../x", "a/../../x", "/etc/passwd", "a\\b", "C:x", "a\x00b", "a\nb"]
SPECIAL = [".git/config", "a/.GIT", ".hypermap-save.json", "a/.hypermap-0123456789abcdef-0.tmp"]


@pytest.mark.parametrize("name", OUT + SPECIAL)
def test_names_that_lead_out_or_are_not_a_maps_are_refused(store: Store, name: str) -> None:
    for use in (lambda: store.read(name), lambda: store.write(name, b"")):
        with pytest.raises(FormatError) as error:
            use()
        assert f"the file name {name!r} is not allowed; it must be within" in str(error.value)


def test_the_names_of_a_layer_are_its_file_its_endings_and_its_folder(
    store: MemoryStore | FolderStore,
) -> None:
    for name in ("floor.yaml", "floor/a/b", "floorplan", "cellar.yaml", "x/floor"):
        store.write(name, b"")
    assert sorted(store.names_of("floor")) == ["floor.yaml", "floor/a/b"]
    assert store.names_of("attic") == []
    assert store.names_of("none/attic") == []


def test_a_folder_that_does_not_exist_has_no_files(tmp_path: Path) -> None:
    store = FolderStore(tmp_path / "none")
    with pytest.raises(FormatError, match="there is no such file"):
        store.read("x")
    with pytest.raises(FileMissing) as error:
        store.write("x", b"")
    assert str(error.value) == f"{tmp_path / 'none'}: there is no such folder to save in"


def test_links_may_not_lead_out_of_the_folder(tmp_path: Path) -> None:
    folder = tmp_path / "map"
    folder.mkdir()
    (tmp_path / "secret").write_text("secret")
    (folder / "inside").write_text("inside")
    (folder / "good").symlink_to("inside")
    (folder / "bad").symlink_to("../secret")
    (folder / "loop").symlink_to("loop")
    store = FolderStore(folder)
    assert store.read("good") == b"inside"
    with pytest.raises(FormatError) as error:
        store.read("bad")
    assert str(error.value) == f"{folder / 'bad'}: is a link that leads out of the folder"
    with pytest.raises(HypermapError, match="Too many levels of symbolic links"):
        store.read("loop")


def test_a_folder_and_a_file_that_is_too_large_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "big").write_bytes(b"12345")
    store = FolderStore(tmp_path)
    with pytest.raises(FormatError, match="is a folder, not a file"):
        store.read("sub")
    monkeypatch.setattr(limits, "MAX_FILE_BYTES", 4)
    with pytest.raises(FormatError, match="holds 5 bytes, more than the 4 that are allowed"):
        store.read("big")


POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:%s\nsize 123456\n" % (b"a1" * 32)


@pytest.mark.parametrize(
    ("name", "opened"),
    [
        ("office.hmap", open_map),
        ("office.yaml", open_map),
        ("desk.mcap", lambda path: open_recording(path).frames()),
        ("yolox.onnx", load_detector),
    ],
)
def test_what_git_lfs_has_not_fetched_is_said_to_be_so(
    tmp_path: Path, name: str, opened: Callable[[Path], Any]
) -> None:
    path = tmp_path / name
    path.write_bytes(POINTER)
    with pytest.raises(FormatError) as error:
        list(opened(path))
    assert str(error.value) == (
        f"{path}: is only Git LFS' pointer to the file; `git lfs pull` fetches the file itself"
    )


def test_the_number_of_a_layers_files_is_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "MAX_MEMBERS", 3)
    for number in range(4):
        (tmp_path / f"a.{number}").write_bytes(b"")
    with pytest.raises(FormatError, match="has more than 3 files"):
        FolderStore(tmp_path).names_of("a")


def test_a_name_has_one_plain_form() -> None:
    assert safe_name("./a//b/./c") == "a/b/c"
