"""Which topics of a bag are used for what."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Any

from hypermap.core.errors import FormatError, did_you_mean
from hypermap.recordings.bag.file import Topic
from hypermap.recordings.messages.topic_names import image_folder, image_name
from hypermap.recordings.options import RecordingOptions

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
CLOUD = "sensor_msgs/msg/PointCloud2"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
OCCUPANCY = "nav_msgs/msg/OccupancyGrid"
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
DETECTIONS = ("darknet_ros_msgs/msg/BoundingBoxes", "vision_msgs/msg/Detection2DArray")

_COLOR_WORDS = ("color", "colour", "rgb")
_THERMAL_WORDS = ("thermal", "flir", "lwir")
_NO_COLOR_WORDS = ("depth", "infra", "/ir/", "disparity", "mask", "label", "segment", "confidence")
_REGISTERED_WORDS = ("registered", "aligned", "depth_to_rgb", "depth_to_color")
_COLOR_IN_DEPTH = "_to_depth"  # color registered to depth, as of azure_kinect_ros_driver


@dataclass(frozen=True)
class ChosenTopics:
    """The topics to read; None if a bag has no suitable one.

    Attributes:
        depth: depth images; never together with `cloud`.
        cloud: organized clouds.
        color: color images.
        camera_info: intrinsics of the depth images.
        color_info: intrinsics of the color images; only if depth is to be registered to them.
        detections: recorded detections.
        occupancy: an occupancy map.
        transforms: the topics of tf of the camera's robot.
        notes: sentences on choices that were made.
    """

    depth: Topic | None = None
    cloud: Topic | None = None
    color: Topic | None = None
    camera_info: Topic | None = None
    detections: Topic | None = None
    occupancy: Topic | None = None
    transforms: tuple[Topic, ...] = ()
    color_info: Topic | None = None
    notes: tuple[str, ...] = field(default=())

    @property
    def geometry(self) -> Topic | None:
        """The topic that gives each frame its depth and its stamp."""
        return self.depth or self.cloud

    def use_of(self, topic: Topic) -> str:
        """Return what mapping uses a topic for; empty if it does not."""
        uses = {
            self.depth: "geometry",
            self.cloud: "geometry",
            self.color: "detection of objects",
            self.color_info: "intrinsics of color",
            self.camera_info: "intrinsics",
            self.detections: "recorded detections",
            self.occupancy: "occupancy map",
        }
        return "where the camera was" if topic in self.transforms else uses.get(topic, "")


def choose_topics(topics: Sequence[Topic], options: RecordingOptions) -> ChosenTopics:
    """Return the best topics by type and name; those in the options come first.

    Raises:
        FormatError: If a topic in the options is missing or of the wrong type.
    """
    choice = _Choice([topic for topic in topics if topic.count])
    depth = None
    if not options.cloud_topic:
        depth = choice.pick("depth", options.depth_topic, _is_depth_type, _is_depth, _depth_rank)
    cloud = choice.pick("cloud", options.cloud_topic, _is(CLOUD), _is(CLOUD), _cloud_rank)
    near = depth.name if depth else cloud.name if cloud else ""
    choice.others = _other_robots(choice.topics, near)
    color = choice.pick(
        "color",
        options.color_topic,
        _is(IMAGE, COMPRESSED),
        lambda topic: _is_color(topic) and topic != depth,
        _color_rank(near),
    )
    info = choice.pick(
        "camera-info",
        options.camera_info_topic,
        _is(CAMERA_INFO),
        _is(CAMERA_INFO),
        _info_rank(near, color.name if color else ""),
    )
    has_intrinsics = info is not None or options.intrinsics is not None
    if depth and (options.depth_topic or has_intrinsics or not cloud):
        cloud = None
    else:
        depth = None
    occupancy = choice.pick("map", options.map_topic, _is(OCCUPANCY), _is_map, _map_rank(near))
    choice.others |= _other_cameras(choice.topics, near)
    return ChosenTopics(
        depth,
        cloud,
        color,
        info,
        choice.pick(
            "detections",
            options.detections_topic,
            _is(*DETECTIONS),
            _is(*DETECTIONS),
            _detections_rank(color.name if color else near),
        ),
        occupancy,
        choice.transforms(near),
        _color_info(choice.topics, color) if options.register else None,
        tuple(choice.notes),
    )


def topics_of_tf(topics: Sequence[Topic], near: str) -> tuple[Topic, ...]:
    """Return the topics of tf that tell where a sensor was.

    Where several robots have a tf each, in namespaces of their own, and frames of the same names,
    as with Nav2, these are the tf of the sensor's robot, and that without a namespace.

    Args:
        topics: of the bag.
        near: topic of the sensor.
    """
    others = _other_robots(topics, near)
    found = (topic for topic in topics if topic.type in TRANSFORMS)
    return tuple(topic for topic in found if not _is_in(others, topic.name))


def _other_robots(topics: Sequence[Topic], near: str) -> set[str]:
    """Return the namespaces of robots with a tf of their own; none if the sensor's has none."""
    robots = {t.name.rpartition("/")[0] for t in topics if t.type in TRANSFORMS} - {""}
    others = {robot for robot in robots if not _is_in({robot}, near)}
    return others if others < robots else set()


def _other_cameras(topics: Sequence[Topic], near: str) -> set[str]:
    """Return the namespaces of other depth cameras, down to where that of the sensor differs."""
    infos = [topic.name for topic in topics if topic.type == CAMERA_INFO]
    depths = [t.name for t in topics if (_is_depth(t) or t.type == CLOUD) and t.name != near]
    spaces = {"/".join(name.split("/")[: _shared_folders(name, near) + 1]) for name in depths}
    return {space for space in spaces if any(_is_in({space}, info) for info in infos)}


def _is_in(namespaces: set[str], name: str) -> bool:
    return any(name.startswith(f"{namespace}/") for namespace in namespaces)


def may_hold_depth(topic: Topic) -> bool:
    """Return whether the images of a topic may be depth, although its name does not say so.

    Compressed ones that name depth may be JPEGs of it, or PNGs, which keep it.
    """
    if topic.type == COMPRESSED:
        return "depth" in topic.name.lower() and topic.count > 0 and not _is_color(topic)
    is_thermal = _has(topic.name.lower(), _THERMAL_WORDS)  # which has 16 bits, too
    return topic.type == IMAGE and topic.count > 0 and _is_color(topic) and not is_thermal


def _color_info(topics: Sequence[Topic], color: Topic | None) -> Topic | None:
    """Return the camera info in the namespace of the color images, if any."""
    namespace = "" if color is None else image_folder(color.name)
    infos = (topic for topic in topics if topic.type == CAMERA_INFO)
    return next((topic for topic in infos if image_folder(topic.name) == namespace), None)


class _Choice:
    """Picks topics and notes where there was more than one."""

    def __init__(self, topics: list[Topic]) -> None:
        self.topics = topics
        self.notes: list[str] = []
        self.others: set[str] = set()  # namespaces of which nothing is picked unless it is named

    def pick(
        self,
        what: str,
        named: str | None,
        is_possible: Callable[[Topic], bool],
        is_likely: Callable[[Topic], bool],
        rank: Callable[[Topic], Any],
    ) -> Topic | None:
        """Return the user's topic, or the candidate of the lowest rank."""
        if named is not None:
            return self._named(what, named, is_possible)
        found = [topic for topic in self.topics if is_likely(topic)]
        own = [topic for topic in found if not _is_in(self.others, topic.name)]
        likely = sorted(own, key=lambda t: (rank(t), t.name))
        if found and not own:
            self.notes.append(
                f"{found[0].name} is not used, as of another robot or camera (--{what}-topic)"
            )
        if len(likely) > 1:
            others = ", ".join(topic.name for topic in likely[1:4])
            more = f" and {len(likely) - 4} more" if len(likely) > 4 else ""
            self.notes.append(
                f"{likely[0].name} is used; also there: {others}{more} (--{what}-topic)"
            )
        return likely[0] if likely else None

    def transforms(self, near: str) -> tuple[Topic, ...]:
        """Return the topics of tf for a sensor with this topic, and note if others are left out."""
        found = topics_of_tf(self.topics, near)
        others = [t.name for t in self.topics if t.type in TRANSFORMS and t not in found]
        if others:
            self.notes.append(
                f"poses are from {', '.join(topic.name for topic in found)}; not from "
                f"{', '.join(others)}, as of another robot"
            )
        return found

    def _named(self, what: str, name: str, is_possible: Callable[[Topic], bool]) -> Topic:
        found = next((topic for topic in self.topics if topic.name == name), None)
        if found is None:
            names = [topic.name for topic in self.topics]
            raise FormatError(
                f"there are no messages on topic {name!r} (--{what}-topic); "
                f"{did_you_mean(name, names)}"
            )
        if not is_possible(found):
            raise FormatError(f"topic {name} (--{what}-topic) is of the wrong type {found.type}")
        return found


def _is(*types: str) -> Callable[[Topic], bool]:
    return lambda topic: topic.type in types


def _is_depth_type(topic: Topic) -> bool:
    return topic.type in (IMAGE, COMPRESSED)


def _is_depth(topic: Topic) -> bool:
    if topic.type == COMPRESSED:
        return topic.name.endswith("/compressedDepth")
    name = topic.name.lower()
    return topic.type == IMAGE and "depth" in name and _COLOR_IN_DEPTH not in name


def _is_color(topic: Topic) -> bool:
    name = topic.name.lower().replace(_COLOR_IN_DEPTH, "")
    return topic.type in (IMAGE, COMPRESSED) and not _has(name, _NO_COLOR_WORDS)


def _is_map(topic: Topic) -> bool:
    return topic.type == OCCUPANCY and "costmap" not in topic.name


def _depth_rank(topic: Topic) -> Any:
    """Depth registered to color first, then images as the camera gave them."""
    return not _has(topic.name, _REGISTERED_WORDS), topic.type == COMPRESSED


def _cloud_rank(topic: Topic) -> Any:
    return not _has(topic.name, _REGISTERED_WORDS), "depth" not in topic.name


def _color_rank(near: str) -> Callable[[Topic], Any]:
    """Color by name, of the same camera as the depth, converted and uncompressed first."""
    is_registered = _has(near, _REGISTERED_WORDS)

    def rank(topic: Topic) -> Any:
        leaf = image_name(topic.name).rpartition("/")[2]
        return (
            (_COLOR_IN_DEPTH in topic.name) == is_registered,
            not _has(topic.name.lower(), _COLOR_WORDS),
            -_shared_folders(topic.name, near),
            not _has(leaf, _COLOR_WORDS),  # image_color, where image_raw may be a Bayer pattern
            topic.type == COMPRESSED,
        )

    return rank


def _info_rank(depth: str, color: str) -> Callable[[Topic], Any]:
    """The depth image's own intrinsics, or else those of the color to which it is registered."""

    def rank(topic: Topic) -> Any:
        folder = image_folder(topic.name)
        return (
            folder != image_folder(depth),
            folder != image_folder(color),
            -_shared_folders(topic.name, depth),
        )

    return rank


def _detections_rank(near: str) -> Callable[[Topic], Any]:
    """Detections in images of the same camera, then the most of them."""
    return lambda topic: (-_shared_folders(topic.name, near), -topic.count)


def _map_rank(near: str) -> Callable[[Topic], Any]:
    """The map of all, or else that of the camera's robot."""

    def rank(topic: Topic) -> Any:
        name = topic.name
        return name != "/map", not name.endswith("map"), -_shared_folders(name, near)

    return rank


def _has(name: str, words: Sequence[str]) -> bool:
    return any(word in name for word in words)


def _shared_folders(one: str, other: str) -> int:
    pairs = zip(one.split("/"), other.split("/"), strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
