"""Objects are found by what they look like, with encoders that a user brings."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import logging
import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from hypermap import (
    Hypermap,
    HypermapError,
    Pose2D,
    SemanticLayer,
    SemanticObject,
    load_embedder,
    open_map,
    save_map,
)
from hypermap.agents.looking import Looking
from hypermap.console.commands import Console
from hypermap.core.embeddings import Embedding, Embeddings
from hypermap.core.errors import FormatError
from hypermap.formats.semantic.embeddings_file import dump_embeddings, parse_embeddings
from hypermap.mapping.config import profile
from hypermap.mapping.going_on import CannotGoOn
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.merging import merge_maps
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.embedders.embedder import Embedder
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.questions import Query
from hypermap.questions.likeness import most_similar
from hypermap.simulation import EXACT_DETECTOR, SimulatedRecording
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, Wall, World, WorldObject
from hypermap.testing.encoders import write_encoders

pytestmark = pytest.mark.xdist_group("looks")  # they share what takes long to make

pytest.importorskip("onnx", reason="the tiny encoders are made with onnx")
pytest.importorskip("tokenizers", reason="texts are read with tokenizers")

COLORS = {"red": (200, 20, 20), "green": (20, 160, 30), "blue": (30, 40, 200)}
# Kinds of things are known by their colors alone: all sofas are red.
WORDS = {**COLORS, "sofa": COLORS["red"], "sit": COLORS["red"], "bin": COLORS["blue"]}
THINGS = [
    WorldObject("sofa", (3.6, 3.0), color="#c81414"),
    WorldObject("table", (3.4, 0.9), size={"length": 0.8, "width": 0.8}, color="#14a01e"),
    WorldObject("bin", (2.4, 2.0), color="#1e28c8"),
    WorldObject("person", (4.4, 2.0)),
]


@functools.cache
def frames() -> tuple[RgbdFrame, ...]:
    look = [(0.7, 1.9, degrees) for degrees in (-50, 50, -50, 50, 0)]
    room = World(
        "room",
        FloorPlan((0, 0, 5, 4)),
        objects=tuple(THINGS),
        walls=(Wall(rectangle=(-0.05, -0.05, 5.05, 4.05)),),
        drive=DrivePlan(((0.6, 2.0), *look), speed=0.3, turn_rate_deg=20),
    )
    recording = SimulatedRecording(
        room,
        detector_noise=EXACT_DETECTOR,
        has_occupancy=False,
        camera=Camera.from_intrinsics(131.25, 131.25, 79.5, 59.5, width=160, height=120),
        rate=2.0,
    )
    return tuple(recording.frames())


def mapped(
    shots: tuple[RgbdFrame, ...], embedder: Embedder | None, onto: Hypermap | None = None
) -> Hypermap:
    source = detections_from_recording()
    mapper = Mapper(profile("default"), source) if onto is None else Mapper.onto(onto, source)
    mapper.embed_with(embedder)
    for shot in shots:
        mapper.add(shot)
    return mapper.hypermap()


@pytest.fixture(scope="module")
def encoders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_encoders(tmp_path_factory.mktemp("encoders") / "tiny", WORDS)


@pytest.fixture(scope="module")
def embedder(encoders: Path) -> Embedder:
    return load_embedder(encoders)


@pytest.fixture(scope="module")
def room(embedder: Embedder) -> Hypermap:
    return mapped(frames(), embedder)


def names(found: Any) -> list[str]:
    return [item.object.name for item in found]


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("red", "sofa"),
        ("Green!", "table"),
        ("the blue one", "bin"),
        ("a sofa", "sofa"),
        ("something to sit on", "sofa"),
        ("bin", "bin"),
    ],
)
def test_a_text_finds_what_looks_like_it(
    room: Hypermap, embedder: Embedder, text: str, name: str
) -> None:
    found = room.find_like(text, k=2, encoder=embedder)
    assert names(found)[0] == name
    assert len(found) == 2


def test_people_are_not_embedded(room: Hypermap, embedder: Embedder) -> None:
    layer = room.semantic("semantic")
    assert "person" in set(layer.names)
    assert "person" not in names(room.find_like("red", k=99, encoder=embedder))


def test_everyone_can_ask_it(
    room: Hypermap, encoders: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(HypermapError, match="name the encoders that mapping used"):
        room.find_like("red")
    console = Console(room)
    head, row = console.run(f"query --like blue -k 1 --embedder {encoders}").splitlines()
    assert "similarity" in head
    assert " bin " in row
    monkeypatch.setenv("HYPERMAP_EMBEDDER", str(encoders))
    assert names(room.ask("what looks like something green?").objects)[0] == "table"
    assert names(room.ask({"like": "red", "names": ["bin", "table"]}).objects)[0] != "sofa"
    assert "bin" in console.run("ask like: blue").splitlines()[3]
    answer = Looking(lambda: room).find_like(text="red", limit=1)
    assert answer["objects"][0]["name"] == "sofa"
    assert 0.5 < answer["objects"][0]["similarity"] <= 1.001


def test_embeddings_are_in_the_archive_and_go_on_with_the_map(
    room: Hypermap, embedder: Embedder, tmp_path: Path
) -> None:
    shots = frames()
    half = mapped(shots[: len(shots) // 2], embedder)
    save_map(half, tmp_path / "half.hmap")
    whole = mapped(shots[len(shots) // 2 :], embedder, open_map(tmp_path / "half.hmap"))
    ours, at_once = (each.semantic("semantic").kept_embeddings for each in (whole, room))
    assert ours is not None
    assert at_once is not None
    np.testing.assert_array_equal(ours.ids, at_once.ids)
    cosines = (ours.vectors.astype(np.float32) * at_once.vectors).sum(axis=1)
    assert cosines.min() > 0.999  # what was saved was rounded to half precision
    np.testing.assert_allclose(ours.lengths, at_once.lengths, rtol=2e-3)
    with zipfile.ZipFile(tmp_path / "half.hmap") as archive:
        assert "semantic.embeddings" in archive.namelist()


def test_merged_maps_have_the_views_of_both(room: Hypermap, embedder: Embedder) -> None:
    shots = frames()
    halves = [mapped(part, embedder) for part in (shots[::2], shots[1::2])]
    merged = merge_maps(*halves, Pose2D()).hypermap
    assert names(merged.find_like("red", k=1, encoder=embedder)) == ["sofa"]
    lengths = []
    for hypermap in (*halves, merged):
        kept = hypermap.semantic("semantic").kept_embeddings
        number = {item.name: item.id for item in hypermap.semantic("semantic")}["sofa"]
        assert kept is not None
        own = kept.embedding(number)
        assert own is not None
        lengths.append(own.length)
    assert lengths[2] == pytest.approx(lengths[0] + lengths[1], rel=0.01)


def test_without_encoders_the_embeddings_stay(room: Hypermap, embedder: Embedder) -> None:
    kept = mapped((), None, room)
    assert names(kept.find_like("red", k=1, encoder=embedder)) == ["sofa"]


def test_other_encoders_are_refused(room: Hypermap, tmp_path: Path) -> None:
    other = load_embedder(write_encoders(tmp_path / "tiny", {"red": (0, 255, 0)}))
    other.model = "another"
    with pytest.raises(HypermapError, match="and the text by 'another'"):
        room.find_like("red", encoder=other)
    with pytest.raises(CannotGoOn, match="embeddings of different encoders cannot be compared"):
        mapped(frames(), other, room)


def test_a_map_without_embeddings_says_how_to_make_them(embedder: Embedder) -> None:
    cup = SemanticObject("cup", shapely.box(0, 0, 1, 1))
    hypermap = Hypermap([SemanticLayer("semantic", "map", [cup])])
    with pytest.raises(HypermapError, match="`hypermap map --embedder FOLDER` makes them"):
        hypermap.find_like("red", encoder=embedder)


def test_merged_objects_add_their_views() -> None:
    one = Embedding("m", np.array([3.0, 0.0], np.float32))
    other = Embedding("m", np.array([0.0, 1.0], np.float32))
    assert one.plus(other).total.tolist() == [3.0, 1.0]
    assert one.plus(None) is one
    assert one.plus(Embedding("n", np.array([9.0], np.float32))).model == "n"  # the more of views


def random_embeddings(count: int, numbers: int = 64) -> Embeddings:
    vectors = np.random.default_rng(count).standard_normal((count, numbers)).astype(np.float32)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    ids = np.arange(count) * 2
    return Embeddings("m", ids, vectors.astype(np.float16), np.ones(count, np.float32))


@pytest.mark.parametrize("length", [-1.0, 1e13, 3e38, np.inf, np.nan])
def test_lengths_that_no_sum_of_unit_vectors_has_are_refused(length: float) -> None:
    one = random_embeddings(2)
    with pytest.raises(ValueError, match="of embeddings"):
        dataclasses.replace(one, lengths=np.array([1, length], np.float32))


@pytest.mark.parametrize(("count", "k"), [(5, 9), (1000, 3), (30_000, 1), (30_000, 20)])
def test_the_search_among_many_is_exact(count: int, k: int) -> None:
    many = random_embeddings(count)
    wanted = many.vectors[count // 3].astype(np.float32)
    wanted /= np.linalg.norm(wanted)
    cosines = many.vectors.astype(np.float32) @ wanted
    best = np.argsort(-cosines, kind="stable")[:k]
    ids, found = most_similar(many, wanted, k)
    assert ids.tolist() == many.ids[best].tolist()
    np.testing.assert_allclose(found, cosines[best], atol=1e-6)


def test_a_file_of_embeddings_is_read_again_or_refused(caplog: pytest.LogCaptureFixture) -> None:
    made = random_embeddings(10, 8)
    content = dump_embeddings(made)
    again = parse_embeddings(content, "file")
    assert again.model == "m"
    np.testing.assert_array_equal(again.vectors, made.vectors)
    for damage in (content[:-3], content.replace(b"embedding.vector", b"embedding.vektor")):
        with pytest.raises(FormatError):
            parse_embeddings(damage, "file")
    rng = np.random.default_rng(0)
    for _ in range(100):
        bytes_ = bytearray(content)
        bytes_[rng.integers(len(bytes_))] = rng.integers(256)
        with contextlib.suppress(FormatError):
            parse_embeddings(bytes(bytes_), "file")


def test_a_map_whose_embeddings_are_damaged_still_opens(
    room: Hypermap, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    save_map(room, tmp_path / "room.hmap")
    damaged = tmp_path / "damaged.hmap"
    with zipfile.ZipFile(tmp_path / "room.hmap") as old, zipfile.ZipFile(damaged, "w") as new:
        for name in old.namelist():
            is_it = name.endswith(".embeddings")
            new.writestr(name, b"nothing" if is_it else old.read(name))
    with caplog.at_level(logging.WARNING):
        again = open_map(damaged)
    assert again.semantic("semantic").kept_embeddings is None
    assert "the embeddings of the objects are missing" in caplog.text


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("vision_model.onnx", None, "no vision_model.onnx or image_encoder.onnx or visual.onnx"),
        ("vision_model.onnx", b"no network", "not a complete ONNX model"),
        ("text_model.onnx", b"no network", "not a complete ONNX model"),
        ("tokenizer.json", None, "the tokenizer of the encoder is missing"),
        ("tokenizer.json", b"{}", "is not a tokenizer"),
        ("preprocessor_config.json", b'{"image_mean": "gray"}', "is not a description of images"),
        ("preprocessor_config.json", b'{"image_std": [0, 1, 1]}', "out of range"),
        ("preprocessor_config.json", b"[", "cannot be read"),
    ],
)
def test_a_folder_that_lacks_something_is_refused(
    encoders: Path, tmp_path: Path, name: str, content: bytes | None, words: str
) -> None:
    for file in encoders.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / name).unlink()
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(HypermapError, match=words):
        embed_both(tmp_path)


def embed_both(folder: Path) -> None:
    embedder = load_embedder(folder)
    embedder.images([np.zeros((20, 30, 3), np.uint8)])
    embedder.texts(["red"])


def test_embedders_that_are_not_there_are_named(tmp_path: Path) -> None:
    with pytest.raises(HypermapError, match="there is no such folder with encoders"):
        load_embedder(tmp_path / "clip")
    with pytest.raises(HypermapError, match="no embedder 'clip' is installed"):
        load_embedder("clip:large")


def test_long_and_empty_texts_have_an_answer(embedder: Embedder) -> None:
    long, empty = embedder.texts(["red " * 1000, ""])
    assert math.isclose(float(np.linalg.norm(long)), 1.0, rel_tol=1e-5)
    assert np.isfinite(empty).all()
    with pytest.raises(FormatError, match="at most 500 letters"):
        Query.from_json({"like": "red " * 1000})
