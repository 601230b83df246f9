from __future__ import annotations

import pytest

from hypermap.cli.options import check_output
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import locks, open_map, save_map
from hypermap.formats.locks import turn_to_edit
from hypermap.testing import square

from .conftest import answered, assert_one_error


def test_an_output_is_checked_before_the_work_begins(tmp_path):
    check_output(tmp_path / "new.hmap", replace=False)
    old = tmp_path / "old.hmap"
    old.touch()
    check_output(old, replace=True)
    for path, replace, reason in [
        (old, False, "exists already; give --force to replace it"),
        (tmp_path, True, "this is a folder"),
        (tmp_path / "nowhere" / "x.hmap", True, "does not exist; create it first"),
    ]:
        with pytest.raises(HypermapError) as error:
            check_output(path, replace)
        assert str(path) in str(error.value)
        assert reason in str(error.value)


def test_commands_change_a_map_one_by_one_and_none_that_is_write_protected(
    hypermap, tmp_path, monkeypatch
):
    path, other = tmp_path / "a.hmap", tmp_path / "b.hmap"
    for each in (path, other):
        save_map(Hypermap([SemanticLayer("zones", "map", [square("zone", 0, 0)])]), each)
    before = path.read_bytes()
    changes = (
        ("notes", path, "--write", "x", "--place", "1,1"),
        ("expire", path, "0", "--until", "2h"),
        ("history", path, "--keep", "5d"),
        ("connect", other, "0,0", path, "0,0"),
    )
    monkeypatch.setattr(locks, "_PATIENCE", 0.0)
    with turn_to_edit(path):
        for words in changes:
            assert_one_error(hypermap(*words), f"{path}: another program is changing it; try again")
    path.chmod(0o444)
    for words in changes:
        message = f"{path} is write-protected, so it is not changed; make it writable"
        assert_one_error(hypermap(*words), message)
    assert path.read_bytes() == before
    assert hypermap("notes", path).code == 0


@pytest.mark.parametrize(("answer", "code"), [("n\n", 2), ("y\n", 0), ("\x04", 130)])
def test_whether_to_replace_a_write_protected_file_is_asked(hypermap, tmp_path, answer, code):
    source, target = tmp_path / "in.hmap", tmp_path / "out.hmap"
    for path in (source, target):
        save_map(Hypermap([SemanticLayer("zones", "map", [square(path.stem, 0, 0)])]), path)
    target.chmod(0o444)
    command = ["convert", source, target, "--force"]
    refused = hypermap(*command)
    assert refused.code == 2
    assert f"{target} exists already, and is write-protected; make it writable" in refused.err
    ended, said = answered(command, answer)
    assert ended == code, said
    assert b"out.hmap is write-protected. Replace it?" in said
    names = [found.object.name for found in open_map(target).objects()]
    assert names == ["in" if code == 0 else "out"]


def test_an_empty_text_is_no_file(hypermap, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_map(Hypermap([SemanticLayer("zones", "map")]), "in.hmap")
    for words in (["convert", "in.hmap", ""], ["convert", "", "out.hmap"], ["info", ""]):
        done = hypermap(*words)
        assert done.code == 2
        assert "an argument is empty" in done.err
    assert [path.name for path in tmp_path.iterdir()] == ["in.hmap"]
