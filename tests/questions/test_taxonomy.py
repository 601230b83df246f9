"""Names of things: synonyms, plurals and kinds."""

from __future__ import annotations

from pathlib import Path

import pytest

from hypermap.core.errors import FileMissing, FormatError
from hypermap.perception.detectors.labels import COCO
from hypermap.questions import load_taxonomy
from hypermap.questions.keywords import is_reserved
from hypermap.questions.vocabulary import Vocabulary
from hypermap.rooms.kinds import load_kinds


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        ("couch", ["sofa"]),
        ("seating", ["sofa", "chair"]),
        ("cup", ["mug", "cup"]),
        ("mug", ["mug"]),
        ("TV", ["tvmonitor"]),
        ("monitors", ["tvmonitor"]),
        ("furniture", ["sofa", "chair", "dining_table"]),
        ("shelves", []),
        ("Zorblax 3000", ["Zorblax 3000"]),
        ("things", ["sofa", "mug", "cup", "chair", "tvmonitor", "dining_table", "Zorblax 3000"]),
    ],
)
def test_a_name_finds_synonyms_and_kinds(asked: str, found: list[str]) -> None:
    names = ["sofa", "mug", "cup", "chair", "tvmonitor", "dining_table", "Zorblax 3000"]
    assert load_taxonomy().matching(asked, names) == found


@pytest.mark.parametrize(
    ("kind", "names", "others"),
    [
        ("tree", ["palm"], ["rose", "cactus"]),
        ("plant", ["rose", "cactus", "palm"], []),
        ("bird", ["owl", "duck"], ["butterfly"]),
        ("dog", ["puppy"], ["kitten"]),
        ("car", ["taxi", "jeep"], ["school bus"]),
        ("vegetable", ["carrot", "broccoli"], ["apple"]),
        ("ball", ["soccer ball", "basketball"], ["basketball hoop"]),
        ("plate", ["paper plate"], ["soup bowl"]),
        ("light", ["flashlight", "lantern"], ["power drill"]),
        ("sign", ["stop sign"], ["stop watch"]),
        ("pen", ["ballpoint pen"], ["pencil"]),
        ("door", ["glass door"], ["door handle"]),
        ("pants", ["trousers", "jeans"], ["skirt"]),
    ],
)
def test_a_kind_has_what_people_count_as_it(kind: str, names: list[str], others: list[str]) -> None:
    assert load_taxonomy().matching(kind, [*names, *others]) == names


def test_no_name_means_two_objects() -> None:
    taxonomy = load_taxonomy()
    for one, other in [("kennel", "dog house"), ("duvet", "comforter"), ("spanner", "wrench")]:
        assert taxonomy.usual_name(one) == taxonomy.usual_name(other)


def test_all_classes_of_coco_are_known() -> None:
    taxonomy = load_taxonomy()
    assert [name for name in COCO if taxonomy.usual_name(name) is None] == []


# The 150 names of the scenes of ADE20K.
ADE20K = """
wall, building, sky, floor, tree, ceiling, road, bed, windowpane, grass, cabinet, sidewalk,
person, earth, door, table, mountain, plant, curtain, chair, car, water, painting, sofa, shelf,
house, sea, mirror, rug, field, armchair, seat, fence, desk, rock, wardrobe, lamp, bathtub,
railing, cushion, base, box, column, signboard, chest of drawers, counter, sand, sink, skyscraper,
fireplace, refrigerator, grandstand, path, stairs, runway, case, pool table, pillow, screen door,
stairway, river, bridge, bookcase, blind, coffee table, toilet, flower, book, hill, bench,
countertop, stove, palm, kitchen island, computer, swivel chair, boat, bar, arcade machine, hovel,
bus, towel, light, truck, tower, chandelier, awning, streetlight, booth, television, airplane,
dirt track, apparel, pole, land, bannister, escalator, ottoman, bottle, buffet, poster, stage,
van, ship, fountain, conveyer belt, canopy, washer, plaything, swimming pool, stool, barrel,
basket, waterfall, tent, bag, minibike, cradle, oven, ball, food, step, tank, trade name,
microwave, pot, animal, bicycle, lake, dishwasher, screen, blanket, sculpture, hood, sconce, vase,
traffic light, tray, ashcan, fan, pier, crt screen, plate, monitor, bulletin board, shower,
radiator, glass, clock, flag
"""


def test_all_classes_of_ade20k_are_known_but_what_is_no_object() -> None:
    names = [" ".join(name.split()) for name in ADE20K.split(",")]
    taxonomy = load_taxonomy()
    assert len(names) == 150
    unknown = [name for name in names if taxonomy.usual_name(name) is None]
    assert unknown == ["wall", "floor", "ceiling"]


def test_no_name_has_two_meanings_but_glasses() -> None:
    vocabulary = Vocabulary(load_taxonomy(), kinds=tuple(load_kinds().votes))
    several = {name for name, meanings in vocabulary.phrases.items() if len(meanings) > 1}
    assert several == {"glasses"}


def test_no_name_is_a_keyword() -> None:
    taxonomy = load_taxonomy()
    kept = ("everything", "robot")  # are keywords at the begin of a question, and things
    names = {*taxonomy.usual, *taxonomy.plurals}
    assert [name for name in sorted(names) if is_reserved(name) and name not in kept] == []


def test_a_room_may_be_called_like_a_part_of_a_building() -> None:
    rooms, things = ("Balcony",), ("balcony",)
    (meaning,) = Vocabulary(load_taxonomy(), rooms=rooms).phrases["balcony"]
    assert meaning == ("ROOM_NAME", "Balcony")
    assert len(Vocabulary(load_taxonomy(), things, rooms).phrases["balcony"]) == 2


def test_a_file_of_the_user_adds_and_replaces(tmp_path: Path) -> None:
    file = tmp_path / "ours.yaml"
    file.write_text(
        "espresso cup: {is: cup, also: [tiny cup], plural: [espresso cups]}\nmug:\n"
        "lab thing: {includes: [pipette, fume-cupboard]}\n"
    )
    taxonomy = load_taxonomy(file)
    names = ["espresso_cup", "mug"]
    assert taxonomy.matching("cup", names) == ["espresso_cup"]
    assert taxonomy.matching("tiny cups", names) == ["espresso_cup"]
    assert taxonomy.matching("lab things", ["Fume_Cupboard", "cup"]) == ["Fume_Cupboard"]
    assert load_taxonomy().matching("cup", names) == ["mug"]  # ours is as it was


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- cup", "expected names of things"),
        ("cup: [1", "not a taxonomy"),
        ("cup: {also: [Höcker]}", r"wrong\.yaml: is not text in UTF-8"),
        ("cup: {was: mug}", "cup: expected a mapping with `is`, `also`, `plural` and `includes`"),
        ("cup: {also: mug}", "cup: `also` is a list of names"),
        ("cup: {includes: [1]}", "cup: `includes` is a list of names"),
        ("cup: {is: [mug]}", "cup: `is` is a name"),
        ("cup: {includes: [mug]}\nmug:", "cup: includes 'mug', which already exists"),
        ("cup: {is: vessel}", "cup: its kind 'vessel' is not in the taxonomy"),
        ("a: {is: b}\nb: {is: a}", "a: is its own kind, through 'a'"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text(text, encoding="latin-1")
    with pytest.raises(FormatError, match=message):
        load_taxonomy(file)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileMissing, match=r"none.yaml: no such file"):
        load_taxonomy(tmp_path / "none.yaml")
