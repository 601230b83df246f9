"""What is no map, and maps that are damaged."""

from __future__ import annotations

import io
import random
import zipfile
from pathlib import Path

import pytest

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.formats import open_map, save_map

from .maps import CONFIG, OBJECTS, archive, small_map
from .strategies import map_facts


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"readme": "x"}, "is a zip archive without hmap_config.yaml, so it is not a map"),
        ({}, "is a zip archive without hmap_config.yaml, so it is not a map"),
        (
            {"hmap_config.yaml": CONFIG},
            "/objects: there is no such file, only hmap_config.yaml",
        ),
        (
            {"hmap_config.yaml": CONFIG.replace("objects", "../objects")},
            "the file name '../objects' is not allowed; it must be within the map's files",
        ),
        ({"hmap_config.yaml": "layers: ["}, "/hmap_config.yaml: is not valid YAML: "),
        (
            {"hmap_config.yaml": CONFIG + CONFIG.partition("\n")[2], "objects": OBJECTS},
            "/hmap_config.yaml: layers[1].name: 'semantic' is already the name of layers[0]",
        ),
        (
            {"hmap_config.yaml": CONFIG, "objects": "name: chair"},
            "/objects: expected a list of objects, found keys and values",
        ),
        (
            {
                "hmap_config.yaml": CONFIG.replace("SemanticLayer", "OccupancyGridLayer"),
                "objects.yaml": "image: a.png\nresolution: 0.05\norigin: [0, 0, 0]\n"
                "occupied_thresh: 1\nfree_thresh: 0\n",
                "a.png": "no picture",
            },
            "/a.png: is not a picture",
        ),
    ],
)
def test_a_bad_archive_is_one_clear_error(
    tmp_path: Path, files: dict[str, str | bytes], message: str
) -> None:
    path = archive(tmp_path / "t.hmap", files)
    with pytest.raises(FormatError) as error:
        open_map(path)
    text = str(error.value)
    assert text.startswith(f"{path}{message}") or text == f"{path}: {message}"


def test_what_is_no_map_says_so(tmp_path: Path) -> None:
    cases = {
        "empty.hmap": (b"", "is empty"),
        "picture.png": (b"\x89PNG\r\n\x1a\n", "is not a zip archive"),
        "list.yaml": (b"- 1\n", "is neither a map's configuration (with the key 'layers') nor"),
        "empty.yaml": (b"", "is neither a map's configuration (with the key 'layers') nor"),
        "broken.yml": (b"{", "is not valid YAML: "),
    }
    for name, (content, message) in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FormatError) as error:
            open_map(tmp_path / name)
        assert str(error.value).startswith(f"{tmp_path / name}: {message}")
    with pytest.raises(FormatError) as folder:
        open_map(tmp_path)
    assert str(folder.value) == (
        f"{tmp_path}: is a folder without hmap_config.yaml, so it is not a map; `hypermap map` "
        "makes a map of a recording"
    )
    bag = tmp_path / "drive.bag"
    bag.write_bytes(b"#ROSBAG V2.0")
    with pytest.raises(FormatError) as recording:
        open_map(bag)
    expected = f"{bag}: is a bag, not a map; `hypermap map` makes a map of a recording"
    assert str(recording.value) == expected
    for missing in ("none.hmap", "none.yaml", "none/none"):
        with pytest.raises(FileMissing) as error_missing:
            open_map(tmp_path / missing)
        assert str(error_missing.value) == f"{tmp_path / missing}: there is no such file"


def test_a_configuration_may_not_reach_out_of_its_folder(tmp_path: Path) -> None:
    (tmp_path / "objects").write_text(OBJECTS)
    folder = tmp_path / "map"
    folder.mkdir()
    (folder / "link").symlink_to("../objects")
    (folder / "hmap_config.yaml").write_text(CONFIG.replace("objects", "link"))
    with pytest.raises(FormatError) as error:
        open_map(folder)
    assert str(error.value) == f"{folder / 'link'}: is a link that leads out of the folder"
    (folder / "hmap_config.yaml").write_text(CONFIG.replace("objects", "../objects"))
    with pytest.raises(FormatError, match=r"the file name '\.\./objects' is not allowed"):
        open_map(folder)


def test_damage_to_a_maps_files_never_gives_another_error(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    save_map(small_map(), tmp_path / "intact.hmap")
    with zipfile.ZipFile(tmp_path / "intact.hmap") as source:
        intact = {name: source.read(name) for name in source.namelist()}
    chance = random.Random(0)
    failed = 0
    for _ in range(400):
        damaged = {name: bytearray(content) for name, content in intact.items()}
        victim = damaged[chance.choice(sorted(intact))]
        for _ in range(chance.randint(1, 4)):
            victim[chance.randrange(len(victim))] = chance.randrange(256)
        path = archive(tmp_path / "t.hmap", {name: bytes(c) for name, c in damaged.items()})
        try:
            hypermap = open_map(path)
        except HypermapError:
            failed += 1
        else:
            save_map(hypermap, path)
            assert map_facts(open_map(path)) == map_facts(hypermap)
    assert failed > 100


def test_a_truncated_archive_never_opens(tmp_path: Path) -> None:
    save_map(small_map(), tmp_path / "t.hmap")
    packed = (tmp_path / "t.hmap").read_bytes()
    for end in range(0, len(packed), 7):
        (tmp_path / "t.hmap").write_bytes(packed[:end])
        with pytest.raises(FormatError):
            open_map(tmp_path / "t.hmap")


def test_a_picture_that_shrinks_like_a_bomb_is_refused(tmp_path: Path) -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as target:
        target.writestr("hmap_config.yaml", CONFIG + " " * (10 << 20))
    path = tmp_path / "t.hmap"
    path.write_bytes(file.getvalue())
    with pytest.raises(FormatError, match="unpacks to more than 200 times its size"):
        open_map(path)
