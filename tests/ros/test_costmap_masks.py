"""The masks as messages of ROS 2, read as nav2 and move_base read them; and on a real roscore."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml

from hypermap import save_map
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.ros.server.costmap_masks import CostmapMasks
from hypermap.ros.typestore import decode, encode, message_class, stamp
from hypermap.testing.builders import occupancy_from_text, square

from .conftest import wait_for

pytestmark = pytest.mark.xdist_group("ros")

LETHAL, UNKNOWN_COST = 254, 255


def office() -> Hypermap:
    return Hypermap(
        [
            occupancy_from_text("\n".join(["..........??"] * 8), resolution=0.5),
            SemanticLayer(
                "semantic",
                "map",
                [
                    SemanticObject("desk", shapely.box(1, 1, 2, 2)),
                    square("plant", 4.75, 2.75, 0.5),
                    square("cup", 1.5, 1.5, 0.1),
                ],
            ),
        ]
    )


@dataclass
class Topics:
    """A port that keeps what is published, after it has been through CDR."""

    message = staticmethod(message_class)
    stamp = staticmethod(stamp)

    node_name: str = "/hypermap_server"
    without: str = ""
    published: dict[str, list[Any]] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)

    def publisher(self, topic: str, type_name: str, *, latched: bool = False) -> Any:
        if type_name == self.without:
            raise HypermapError(f"there is no {type_name}")
        assert latched
        kept = self.published.setdefault(topic, [])
        topics = self

        class Publisher:
            def publish(self, message: Any) -> None:
                assert isinstance(message, topics.message(type_name))
                kept.append(decode(encode(message), type(message)))

            def close(self) -> None:
                topics.published.pop(topic, None)

        return Publisher()

    def now(self) -> int:
        return 1_500_000_000

    def log(self, level: str, text: str) -> None:
        self.lines.append(f"{level}: {text}")


def cells(message: Any) -> np.ndarray:
    data = np.asarray(message.data, dtype=np.int8)
    return data.astype(int).reshape(message.info.height, message.info.width)


def costs(message: Any) -> np.ndarray:
    """Return the costs of a mask, as the constructor of nav2's Costmap2D makes them."""
    values = cells(message)
    return np.where(values == -1, UNKNOWN_COST, np.round(values * 254 / 100)).astype(int)


def after_keepout(costmap: np.ndarray, message: Any) -> np.ndarray:
    """Return a costmap after nav2's KeepoutFilter::process."""
    data = costs(message)
    changed = (data != UNKNOWN_COST) & ((data > costmap) | (costmap == UNKNOWN_COST))
    return np.where(changed, data, costmap)


def after_static_layer(costmap: np.ndarray, message: Any) -> np.ndarray:
    """Return a costmap after a static layer of move_base with `use_maximum`, not rolling."""
    values = cells(message)
    data = np.where(values == -1, UNKNOWN_COST, np.where(values >= 100, LETHAL, 0))
    changed = (data != UNKNOWN_COST) & ((costmap == UNKNOWN_COST) | (costmap < data))
    return np.where(changed, data, costmap)


def speed_limit(mask: Any, info: Any, x: float, y: float) -> float:
    """Return the limit at a place, as nav2's SpeedFilter reads it; 0 is no limit."""
    col = int((x - mask.info.origin.position.x) / mask.info.resolution)
    row = int((y - mask.info.origin.position.y) / mask.info.resolution)
    value = cells(mask)[row, col]
    assert value != -1, "the speed filter takes no unknown cells"
    return 0.0 if value == 0 else value * info.multiplier + info.base


def test_the_keepout_mask_makes_zones_lethal_and_leaves_the_rest_of_a_costmap() -> None:
    topics = Topics()
    masks = CostmapMasks(topics)
    masks.set({"keepout": ["desk 0.3", "plant 0"], "speed": [], "mask_resolution": 0.0})
    masks.show(office())
    (mask,) = topics.published["keepout_mask"]
    assert (mask.header.frame_id, mask.info.resolution) == ("map", 0.5)
    assert (mask.info.width, mask.info.height) == (12, 8)

    before = np.full((8, 12), 0)
    before[:, 10:] = UNKNOWN_COST
    before[2, 2] = 100
    for after in (after_keepout(before, mask), after_static_layer(before, mask)):
        lethal = np.zeros((8, 12), bool)
        lethal[1:5, 2:4] = lethal[2:4, 1:5] = True  # the desk and its margin, without the corners
        lethal[5, 9] = True
        np.testing.assert_array_equal(after == LETHAL, lethal)
        np.testing.assert_array_equal(after[~lethal], before[~lethal])


def test_the_keepout_info_is_what_nav2_wants() -> None:
    topics = Topics(node_name="/robot/hypermap_server")
    masks = CostmapMasks(topics)
    masks.set({"keepout": ["desk 0.5"]})
    masks.show(office())
    (info,) = topics.published["keepout_filter_info"]
    assert (info.type, info.base, info.multiplier) == (0, 0.0, 1.0)  # others are an error there
    assert info.filter_mask_topic == "/robot/hypermap_server/keepout_mask"
    assert (info.header.frame_id, info.header.stamp.sec) == ("map", 1)
    assert set(topics.published) == {"keepout_mask", "keepout_filter_info"}


@pytest.mark.parametrize(
    ("entries", "kind", "at_desk", "at_both"),
    [
        (["desk 1 80%", "plant 2 40%"], 1, 80, 40),
        (["plant 2 0.4m/s", "desk 1 0.8m/s"], 2, 0.8, 0.4),
        (["plant 2 0.4m/s", "desk 1 2.5m/s"], 2, 2.5, 0.4),
    ],
)
def test_speed_limits_are_read_back_as_they_were_given(entries, kind, at_desk, at_both) -> None:
    topics = Topics()
    masks = CostmapMasks(topics)
    masks.set({"speed": entries})
    masks.show(office())
    (mask,), (info,) = topics.published["speed_mask"], topics.published["speed_filter_info"]
    assert info.type == kind
    assert info.filter_mask_topic == "/hypermap_server/speed_mask"
    assert speed_limit(mask, info, 1.25, 1.25) == pytest.approx(at_desk)
    assert speed_limit(mask, info, 2.75, 2.25) == pytest.approx(at_both)
    assert speed_limit(mask, info, 5.75, 3.75) == pytest.approx(at_both)
    assert speed_limit(mask, info, 0.25, 3.75) == 0


def test_a_mask_is_published_again_only_when_a_cell_has_changed() -> None:
    topics = Topics()
    masks = CostmapMasks(topics)
    masks.set({"keepout": ["desk 0.5"]})
    masks.show(office())
    masks.show(office(), ["semantic"])
    masks.show(office())
    assert len(topics.published["keepout_mask"]) == 1

    more = office()
    more["semantic"].add([square("desk", 4, 1)])
    masks.show(more, ["semantic"])
    assert len(topics.published["keepout_mask"]) == 2
    assert cells(topics.published["keepout_mask"][-1])[2, 7] == 100
    assert len(topics.published["keepout_filter_info"]) == 1


def test_zones_can_be_changed_while_the_node_runs() -> None:
    topics = Topics()
    masks = CostmapMasks(topics)
    masks.set({"keepout": [], "speed": [], "mask_resolution": 0.0})
    masks.show(office())
    assert topics.published == {}
    masks.set({"keepout": ["plant 0"]})
    masks.set({"speed": ["plant 1 20%"]})
    masks.set({"speed": ["plant 1 0.1m/s"]})
    assert [info.type for info in topics.published["speed_filter_info"]] == [1, 2]
    masks.set({"mask_resolution": 0.25})
    assert topics.published["keepout_mask"][-1].info.width == 2
    masks.set({"keepout": [], "mask_resolution": 0.0})
    last = topics.published["keepout_mask"][-1]
    assert cells(last).shape == (8, 12)
    assert np.all(cells(last) == -1)
    masks.close()
    assert topics.published == {}


@pytest.mark.parametrize(
    "wrong", [{"keepout": ["desk"]}, {"keepout": "desk 0.2m"}, {"speed": ["desk 1"]}]
)
def test_a_wrong_parameter_leaves_the_masks_as_they_were(wrong) -> None:
    topics = Topics()
    masks = CostmapMasks(topics)
    masks.set({"keepout": ["desk 0.5"]})
    masks.show(office())
    with pytest.raises(HypermapError, match="is not a zone"):
        masks.set({"mask_resolution": 0.25, **wrong})
    masks.show(office())
    assert len(topics.published["keepout_mask"]) == 1


def test_a_mask_that_cannot_be_drawn_is_logged_and_the_last_one_stays() -> None:
    topics = Topics()
    masks = CostmapMasks(topics)
    masks.set({"keepout": ["desk 0.5"], "speed": ["plant 1 20%"]})
    masks.show(office())
    lost = office()
    lost.add(SemanticLayer("lab", "lab", [square("desk", 0, 0)]))
    lost["semantic"].add([square("plant", 0, 0)])
    masks.show(lost)
    assert len(topics.published["keepout_mask"]) == 1
    assert len(topics.published["speed_mask"]) == 2
    (line,) = topics.lines
    assert line.startswith("error: keepout_mask: ")
    assert "'lab'" in line
    assert line.endswith("; the last mask stays")


def test_without_nav2_messages_there_are_masks_alone() -> None:
    topics = Topics(without="nav2_msgs/CostmapFilterInfo")
    masks = CostmapMasks(topics)
    masks.set({"keepout": ["desk 0.5"]})
    masks.show(office())
    assert set(topics.published) == {"keepout_mask"}
    assert topics.lines == ["info: keepout_mask: no nav2_msgs here, so no CostmapFilterInfo for it"]


DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "navigation.md"


def blocks(word: str) -> list[Any]:
    """Return the YAML blocks of the document below a heading."""
    text = DOCUMENT.read_text(encoding="utf-8").split(f"## {word}\n", 1)[1].split("\n## ", 1)[0]
    return [yaml.safe_load(block) for block in re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)]


def leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from leaves(inner, name)
    else:
        yield key, value


@pytest.mark.parametrize(
    ("ros", "topic_key", "costmap_of", "node_of"),
    [
        (
            "nav2",
            "filter_info_topic",
            lambda tree, name: tree[name][name]["ros__parameters"],
            lambda tree: tree["hypermap_server"]["ros__parameters"],
        ),
        (
            "move_base",
            "map_topic",
            lambda tree, name: tree[name],
            lambda tree: tree["hypermap_server"],
        ),
    ],
)
def test_the_configurations_in_the_document_fit_together(
    ros, topic_key, costmap_of, node_of
) -> None:
    server, robot = blocks(ros)
    topics = Topics()
    masks = CostmapMasks(topics)
    parameters = node_of(server)
    assert set(parameters) <= {parameter.name for parameter in CostmapMasks.PARAMETERS}
    masks.set(parameters)
    masks.show(office())
    wanted = {value for key, value in leaves(robot) if key == topic_key}
    assert wanted
    published = {f"{topics.node_name}/{topic}" for topic in topics.published}
    assert wanted <= published
    suffix = {"filter_info_topic": "_filter_info", "map_topic": "_mask"}[topic_key]
    assert all(topic.endswith(suffix) for topic in wanted)
    for name in ("global_costmap", "local_costmap"):
        costmap = costmap_of(robot, name)
        layers = costmap.get("filters") or [plugin["name"] for plugin in costmap["plugins"]]
        assert [key for key in costmap if key.endswith(("_filter", "keepout_layer"))] == [
            layer for layer in layers if layer.endswith(("_filter", "keepout_layer"))
        ]


def test_the_static_layers_in_the_document_take_what_is_unknown_as_their_costmap_needs_it() -> None:
    _, robot = blocks("move_base")
    for costmap in robot.values():
        layer = costmap["keepout_layer"]
        assert layer["use_maximum"] is True
        assert layer["track_unknown_space"] is not costmap["rolling_window"]


def test_a_map_server_publishes_masks_and_takes_new_zones_while_it_runs(
    roscore, rospy, start, tmp_path
) -> None:
    from nav_msgs.msg import OccupancyGrid

    save_map(office(), tmp_path / "office.hmap")
    server = start(
        *("hypermap", "serve", tmp_path / "office.hmap", "--ros1", "__name:=masks_server"),
        *("--param", "keepout=['desk 0.3']"),
    )
    received: list[Any] = []
    topic = "/masks_server/keepout_mask"
    listener = rospy.Subscriber(topic, OccupancyGrid, received.append)
    try:
        wait_for(lambda: received, topic)
        assert (received[0].header.frame_id, received[0].info.resolution) == ("map", 0.5)
        expected = cells(received[0])
        assert np.count_nonzero(expected == 100) == 12
        assert np.count_nonzero(expected == -1) == 84

        late = rospy.wait_for_message(topic, OccupancyGrid, timeout=120)
        np.testing.assert_array_equal(cells(late), expected)

        rospy.set_param("/masks_server/keepout", ["plant 0"])
        wait_for(
            lambda: np.argwhere(cells(received[-1]) == 100).tolist() == [[5, 9]],
            "a mask with the new zone alone",
        )

        rospy.set_param("/masks_server/keepout", ["plant"])
        server.expect("keepout: 'plant' is not a zone; expected a class and a margin in meters")
        rospy.set_param("/masks_server/speed", ["desk 0 50%"])
        speed = rospy.wait_for_message("/masks_server/speed_mask", OccupancyGrid, timeout=120)
        assert sorted(np.unique(cells(speed))) == [0, 50]
        assert server.stop() == 0
    finally:
        listener.unregister()
