from __future__ import annotations

import pytest

from hypermap.core.errors import FormatError
from hypermap.core.frames import Pose2D, Transform
from hypermap.formats.config import FLAGS, MapConfig, dump_config, parse_config

OLD = """\
layer_cnt: 7
layers:
  - name: occupancy
    frame_id: map
    class: OccupancyGridLayer
    vis_msg_topic: map
    load_file: true
    file: map
    enable_update: false
  - class: SemanticLayer
    name: no
    frame_id: lab
    load_file: false
transforms:
  - frame_id: map
    child_frame_id: lab
    transform_pose: [1, 2.5, -3.0e-1]
vendor: {a: [1, 2]}
"""


def parse(text: str) -> MapConfig:
    return parse_config(text.encode(), "t.hmap/hmap_config.yaml")


def test_layers_come_in_order_with_all_their_flags() -> None:
    config = parse(OLD)
    first, second = config.layers
    assert (first.class_name, first.name, first.frame_id) == (
        "OccupancyGridLayer",
        "occupancy",
        "map",
    )
    assert first.load_file
    assert first.settings == {
        "file": "map",
        "subscribe_mode": False,
        "enable_update": False,
        "publish_global_topics": False,
        "vis_msg_topic": "map",
    }
    assert (second.class_name, second.name, second.frame_id) == ("SemanticLayer", "no", "lab")
    assert not second.load_file
    assert second.settings == FLAGS
    assert list(config.frames) == [Transform("map", "lab", Pose2D(1.0, 2.5, -0.3))]
    assert config.others == {"layer_cnt": 7, "vendor": {"a": [1, 2]}}
    assert config.metadata == {}


def test_everything_is_written_back_ours_after_theirs_and_the_count_corrected() -> None:
    text = dump_config(parse(OLD)).decode()
    assert text == (
        "layers:\n"
        "- class: OccupancyGridLayer\n"
        "  name: occupancy\n"
        "  frame_id: map\n"
        "  load_file: true\n"
        "  file: map\n"
        "  subscribe_mode: false\n"
        "  enable_update: false\n"
        "  publish_global_topics: false\n"
        "  vis_msg_topic: map\n"
        "- class: SemanticLayer\n"
        "  name: 'no'\n"
        "  frame_id: lab\n"
        "  load_file: false\n"
        "  subscribe_mode: false\n"
        "  enable_update: true\n"
        "  publish_global_topics: false\n"
        "transforms:\n"
        "- frame_id: map\n"
        "  child_frame_id: lab\n"
        "  transform_pose: [1.0, 2.5, -0.3]\n"
        "layer_cnt: 2\n"
        "vendor:\n"
        "  a: [1, 2]\n"
    )
    assert dump_config(parse(text)).decode() == text


def test_metadata_are_kept_under_a_key_that_old_readers_ignore() -> None:
    metadata = {"profile": "default", "thresholds": [0.5, 1e-7]}
    text = dump_config(MapConfig([], metadata=metadata))
    assert b"hypermap_metadata:\n" in text
    assert parse_config(text, "t").metadata == metadata


def test_a_layer_that_does_not_say_whether_to_load_loads_the_file_that_it_names() -> None:
    head = "layers: [{class: A, name: a, frame_id: map"
    assert parse(head + ", file: x}]").layers[0].load_file
    assert not parse(head + "}]").layers[0].load_file


@pytest.mark.parametrize("value", ["true", "True", "yes", "on", "1", "'true'"])
def test_flags_may_be_written_in_any_way_that_yaml_knows(value: str) -> None:
    layer = parse(OLD.replace("enable_update: false", f"enable_update: {value}")).layers[0]
    assert layer.settings["enable_update"] is True


LAYER = "layers: [{class: A, name: a, frame_id: map}]\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected keys and values, found nothing"),
        ("[]", "expected keys and values, found a list"),
        ("a: 1", "layers: is required, but missing"),
        ("layers:", "layers: input should be a valid list, found nothing"),
        ("layers: {a: 1}", "layers: input should be a valid list, found keys and values"),
        ("layers: [a]", "layers[0]: expected keys and values, found 'a'"),
        (OLD.replace("    frame_id: lab\n", ""), "layers[1].frame_id: is required, but missing"),
        (OLD.replace("name: no", "nam: no"), "layers[1].name: is required, but missing"),
        (OLD.replace("class: Sem", "clas: Sem"), "layers[1].class: is required, but missing"),
        (
            OLD.replace("name: no", "name: ''"),
            "layers[1].name: string should have at least 1 character, found ''",
        ),
        (OLD.replace("    file: map\n", ""), "layers[0].file: is required where load_file is true"),
        (
            OLD.replace("load_file: true", "load_file: maybe"),
            "layers[0].load_file: input should be a valid boolean, unable to interpret input, "
            "found 'maybe'",
        ),
        (
            OLD.replace("name: no", "name: occupancy"),
            "layers[1].name: 'occupancy' is already the name of layers[0]",
        ),
        (
            OLD.replace("2.5", ".inf"),
            "transforms[0].transform_pose[1]: input should be a finite number, found inf",
        ),
        (
            OLD.replace("2.5", "x"),
            "transforms[0].transform_pose[1]: input should be a valid number, "
            "unable to parse string as a number, found 'x'",
        ),
        (
            OLD.replace("[1, 2.5", "[1"),
            "transforms[0].transform_pose[2]: is required, but missing",
        ),
        (
            OLD.replace("    child_frame_id: lab\n", ""),
            "transforms[0].child_frame_id: is required, but missing",
        ),
        (LAYER + "transforms: 3", "transforms: input should be a valid list, found 3"),
        (LAYER + "hypermap_metadata: 3", "hypermap_metadata: input should be a valid dictionary"),
        (
            LAYER + "transforms:\n"
            "- {frame_id: a, child_frame_id: b, transform_pose: [0, 0, 0]}\n"
            "- {frame_id: b, child_frame_id: a, transform_pose: [0, 0, 0]}\n",
            "transforms[1]: frame 'a' cannot be a child of 'b': the two would form a loop",
        ),
        (
            LAYER + "transforms:\n"
            "- {frame_id: a, child_frame_id: b, transform_pose: [0, 0, 0]}\n"
            "- {frame_id: c, child_frame_id: b, transform_pose: [0, 0, 0]}\n",
            "transforms[1]: frame 'b' already has the parent 'a'",
        ),
        (OLD + "vendor: 1\n", "line 19: the key 'vendor' appears twice"),
        (OLD.replace("layer_cnt: 7", "layer_cnt: {"), "is not valid YAML: "),
    ],
)
def test_what_is_wrong_is_named_with_its_place(text: str, message: str) -> None:
    with pytest.raises(FormatError) as error:
        parse(text)
    assert str(error.value).startswith(f"t.hmap/hmap_config.yaml: {message}")
