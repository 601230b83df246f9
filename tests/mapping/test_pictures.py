"""A map keeps the pictures that show its objects best."""

from __future__ import annotations

import contextlib
import functools
import logging
import math
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap import Hypermap, SemanticLayer, SemanticObject, image_of, open_map, save_map
from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.pictures import MOST_PICTURES, ObjectPicture, best_pictures
from hypermap.formats.semantic.pictures_file import dump_pictures, parse_pictures
from hypermap.formats.semantic.yaml_files import dump_objects
from hypermap.mapping.config import MappingConfig, profile
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.stages import PictureConfig
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import RgbdFrame
from hypermap.simulation import SimulatedRecording, demo_world

from .test_mapper import CONFIG, boxes, frame

pytestmark = pytest.mark.xdist_group("pictures")  # they share what takes long to make

JPEG = b"\xff\xd8\xff\xe0 and so on"
SOURCE = detections_from_recording()

pictures = st.builds(
    ObjectPicture,
    jpeg=st.binary(max_size=50).map(lambda rest: JPEG + rest),
    stamp=st.floats(0, 1e9),
    azimuth=st.floats(-7, 7),
    quality=st.floats(0, 1),
    sharpness=st.floats(0, 1e5),
)


def config(**keys: bool) -> MappingConfig:
    return replace(profile("default"), pictures=PictureConfig(**keys))


@functools.cache
def recorded() -> list[RgbdFrame]:
    return list(SimulatedRecording(demo_world(), rate=1.0, has_occupancy=False).frames())


@functools.cache
def mapped(**keys: bool) -> Hypermap:
    mapper = Mapper(config(**keys), SOURCE)
    for each in recorded():
        mapper.add(each)
    return mapper.hypermap()


def test_objects_have_small_pictures_from_different_sides() -> None:
    layer = mapped().semantic()
    things = [item for item in layer.objects() if item.name != "person"]
    seen = [layer.pictures(item.id) for item in things]
    assert sum(map(bool, seen)) >= 0.9 * len(things) > 5
    assert max(map(len, seen)) > 1
    for kept in seen:
        assert len(kept) <= MOST_PICTURES
        assert [each.quality for each in kept] == sorted((e.quality for e in kept), reverse=True)
        for i, picture in enumerate(kept):
            assert len(picture.jpeg) <= 20_000
            assert max(image_of(picture).size) <= 240
            for other in kept[:i]:
                between = math.remainder(picture.azimuth - other.azimuth, math.tau)
                assert abs(between) >= math.radians(45)


def test_a_whole_object_is_shown_rather_than_one_that_the_image_cuts_off() -> None:
    """The image is 2 m wide, and the box that it looks down on 0.4 m."""
    mapper = Mapper(CONFIG, boxes)
    for i, (x, shade) in enumerate([(0.9, 40), (0.85, 80), (0.7, 120), (0.6, 160)]):
        seen = frame(i, x)
        mapper.add(replace(seen, color=np.full((*seen.depth.shape, 3), shade, np.uint8)))
    layer = mapper.hypermap().semantic()
    (item,) = layer.objects()
    (picture,) = layer.pictures(item.id)
    assert picture.stamp == 2.0
    assert picture.azimuth == pytest.approx(0, abs=0.05)  # the camera was at larger x
    image = np.asarray(image_of(picture))
    assert image.mean() == pytest.approx(120, abs=2)
    width = 0.4 / 0.0125  # in pixels, and a tenth more on each side
    assert image.shape[1] == pytest.approx(1.2 * width, abs=2)


def test_no_pictures_of_people_are_kept_unless_asked_for() -> None:
    def kept(hypermap: Hypermap) -> set[str]:
        layer = hypermap.semantic()
        return {item.name for item in layer.objects() if layer.pictures(item.id)}

    people = {item.name for item in mapped().semantic().objects()} & {"person"}
    assert people
    assert not kept(mapped()) & people
    assert kept(mapped(people=True)) >= people
    assert kept(mapped(enabled=False)) == set()


def test_pictures_change_nothing_else() -> None:
    with_, without = mapped().semantic(), mapped(enabled=False).semantic()
    assert dump_objects(with_) == dump_objects(without)


def test_pictures_come_back_from_a_file_and_go_with_their_object(tmp_path: Path) -> None:
    before = mapped().semantic()
    save_map(mapped(), tmp_path / "room.hmap")
    after = open_map(tmp_path / "room.hmap").semantic()
    assert after.kept_pictures == before.kept_pictures
    assert after.copy().kept_pictures == before.kept_pictures
    gone = next(iter(after.kept_pictures))
    after.remove(gone)
    with pytest.raises(HypermapError, match="no object"):
        after.pictures(gone)
    save_map(Hypermap([after]), tmp_path / "fewer.hmap")
    left = open_map(tmp_path / "fewer.hmap").semantic()
    assert left.kept_pictures == {n: k for n, k in before.kept_pictures.items() if n != gone}


def test_whether_pictures_are_kept_may_change_with_the_next_drive() -> None:
    mapper = Mapper.onto(mapped(), SOURCE, config(enabled=False))
    assert mapper.hypermap().semantic().kept_pictures == mapped().semantic().kept_pictures


def test_a_color_image_that_cannot_be_read_costs_its_pictures_alone() -> None:
    def broken() -> Any:
        raise HypermapError("the color image is damaged")

    mapper = Mapper(config(), SOURCE)
    for each in recorded():
        mapper.add(replace(each, color=broken))
    layer = mapper.hypermap().semantic()
    assert dump_objects(layer) == dump_objects(mapped(enabled=False).semantic())
    assert not layer.kept_pictures


@given(st.dictionaries(st.integers(0, 2**40), st.lists(pictures, min_size=1).map(best_pictures)))
def test_a_file_gives_back_what_was_written(
    kept: dict[int, tuple[ObjectPicture, ...]],
) -> None:
    assert parse_pictures(dump_pictures(kept), "pictures") == kept


@given(st.lists(pictures))
def test_the_best_pictures_do_not_depend_on_their_order_and_stay_the_best(
    some: list[ObjectPicture],
) -> None:
    best = best_pictures(some)
    assert best == best_pictures(some[::-1]) == best_pictures(best)
    if some:
        assert best[0].quality == max(each.quality for each in some)


@pytest.mark.parametrize("spoil", ["cut", "not a jpeg", "no columns", "other"])
def test_a_map_with_damaged_pictures_opens_without_them(
    spoil: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    layer = SemanticLayer("semantic", "map", [SemanticObject("cup", shapely.box(0, 0, 1, 1))])
    layer.kept_pictures = {0: (ObjectPicture(JPEG, 1.0, 0.0, 0.5, 3.0),)}
    good = dump_pictures(layer.kept_pictures)
    content = {
        "cut": good[:-5],
        "not a jpeg": good.replace(JPEG, b"<html><script>"[: len(JPEG)].ljust(len(JPEG))),
        "no columns": good.replace(b"picture.length", b"picture.lengtH"),
        "other": b"\x89PNG",
    }[spoil]
    with pytest.raises(FormatError, match=r"room\.hmap"):
        parse_pictures(content, "room.hmap/semantic.pictures")
    save_map(Hypermap([layer]), tmp_path / "room.hmap")
    with zipfile.ZipFile(tmp_path / "room.hmap") as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(tmp_path / "room.hmap", "w") as archive:
        for name, old in files.items():
            archive.writestr(name, content if name == "semantic.pictures" else old)
    with caplog.at_level(logging.WARNING):
        opened = open_map(tmp_path / "room.hmap").semantic()
    assert "the pictures of the objects are missing" in caplog.text
    assert len(opened) == 1
    assert opened.pictures(0) == ()


@given(place=st.integers(0, 600), byte=st.integers(0, 255), cut=st.integers(0, 600))
def test_a_spoiled_file_is_one_error_or_pictures(place: int, byte: int, cut: int) -> None:
    some = ObjectPicture(JPEG, 1.0, 0.0, 0.5, 3.0)
    content = bytearray(dump_pictures({0: (some,), 7: (some,)}))
    content[place % len(content)] = byte
    with contextlib.suppress(FormatError):
        for kept in parse_pictures(
            bytes(content[: len(content) - cut // 100]), "pictures"
        ).values():
            assert all(each.jpeg.startswith(JPEG[:3]) for each in kept)


def test_a_damaged_picture_is_one_error() -> None:
    with pytest.raises(FormatError, match="the picture cannot be read"):
        image_of(ObjectPicture(JPEG, 1.0, 0.0, 0.5, 3.0))
