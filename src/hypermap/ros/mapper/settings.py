"""The parameters of the semantic mapper: name, default, limits and meaning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, cast

from hypermap.core.errors import HypermapError
from hypermap.perception.pose_convention import CONVENTIONS, OPTICAL
from hypermap.recordings.messages.topic_names import image_folder, names_rectified
from hypermap.recordings.samples import ValueSource
from hypermap.ros.port import Parameter, Value
from hypermap.ros.topic_names import named_by_user

CLOUD = "sensor_msgs/PointCloud2"
IMAGE = "sensor_msgs/Image"
COMPRESSED = "sensor_msgs/CompressedImage"
CAMERA_INFO = "sensor_msgs/CameraInfo"
OCCUPANCY = "nav_msgs/OccupancyGrid"
PATH = "nav_msgs/Path"
GRAPH = "rtabmap_msgs/MapGraph"
DARKNET = "darknet_ros_msgs/BoundingBoxes"
VISION = "vision_msgs/Detection2DArray"

_GEOMETRY = ("depth_topic", "cloud_topic")
_DETECTIONS = ("detector", "detections_topic", "detections_file")


def _setting(
    default: Value,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    once: bool = False,
) -> Any:
    others = {"minimum": minimum, "maximum": maximum, "choices": choices, "once": once}
    return field(default=default, metadata={"description": description, **others})


@dataclass(frozen=True)
class LiveSettings:
    """What a semantic mapper listens to and how it maps; `PARAMETERS` describes each.

    Raises:
        HypermapError: If the topics and sources of detections do not go together.
    """

    origins: Mapping[str, str] = field(default_factory=dict, repr=False)  # where values come from

    depth_topic: str = _setting(
        "",
        "Depth images, registered to color; compressed if the name ends in /compressedDepth, or in "
        "/compressed (PNG).",
    )
    cloud_topic: str = _setting("", "Organised clouds, in place of depth images.")
    camera_info_topic: str = _setting(
        "", "Intrinsics; by default camera_info next to the depth images, or as a cloud shows."
    )
    color_topic: str = _setting("", "Color images; compressed if the name ends in /compressed.")
    detections_topic: str = _setting("", "Detections by another node.")
    detections_type: str = _setting(
        DARKNET, "Type of the detections' messages.", choices=(DARKNET, VISION)
    )
    detections_file: str = _setting("", "Detections recorded in a JSON file.")
    detector: str = _setting(
        "", "Neural network that finds objects in the color images: .onnx, or a known name."
    )
    labels: str = _setting("", "File with the names of the network's classes, where it has none.")
    score: float = _setting(
        -1.0, "Minimum score of detections; -1: as in profile and config.", -1, 1
    )
    detector_threads: int = _setting(0, "Threads of the network; 0 takes all cores.", 0, 1024)
    map_frame: str = _setting("map", "Fixed frame in which the map is made, z up.")
    camera_frame: str = _setting("", "The camera's optical frame; by default as messages say.")
    depth_scale: float = _setting(1000.0, "Units of integer depth per meter.", 1e-3, 1e9)
    profile: str = _setting(
        "default", "Method: the best that we know, or that of 2019.", choices=("default", "thesis")
    )
    config: str = _setting("", "YAML file with settings of mapping that differ.")
    occupancy: bool = _setting(True, "Whether to make an occupancy layer from depth.")
    map_topic: str = _setting(
        "", "Occupancy map of another node, to save in place of our own; poses are corrected by it."
    )
    path_topic: str = _setting(
        "", "Path of base_frame as optimized by SLAM: when a loop closure moves it, the map moves."
    )
    graph_topic: str = _setting(
        "", "Graph of RTAB-Map (MapGraph), whose poses of base_frame move the map as a path does."
    )
    odom_frame: str = _setting(
        "odom",
        "Frame of odometry: without path_topic and graph_topic, when it jumps in map_frame, the "
        "map moves.",
    )
    register: bool = _setting(
        False, "Whether to register depth to color, by the camera info next to color, and tf."
    )
    rotate: int = _setting(
        0, "Degrees by which images are turned clockwise: 0, 90, 180 or 270.", 0, 270
    )
    pose_convention: str = _setting(
        OPTICAL,
        "What tf says of the frame that the depth messages name: the pose of an optical frame, or "
        "of a body, as with some simulators.",
        choices=tuple(CONVENTIONS),
    )
    time_offset: float = _setting(
        0.0, "Delay from an image's stamp to the stamp of its pose in tf [s].", -10, 10
    )
    slop: float = _setting(
        0.02, "Seconds by which stamps of messages that go together may differ.", 0, 1
    )
    patience: float = _setting(
        1.0, "Seconds that an image waits for what belongs to it; a detector may take so long.",
        0.05, 60,
    )  # fmt: skip
    tf_timeout: float = _setting(0.2, "Seconds to wait for the camera's pose.", 0, 10)
    max_rate: float = _setting(0.0, "Frames per second to take at most; 0 is any.", 0, 1000)
    publish_rate: float = _setting(1.0, "How often per second the map is published.", 0.01, 50)
    semantic_map_topic: str = _setting("/semantic_map", "Topic of the objects.")
    values: Sequence[str] = _setting(
        (),
        "Topics with samples of quantities to map, each TOPIC or TOPIC:FIELD, then ,KEY=TEXT for "
        "quantity, unit, sample-unit, censored-below and sensor-frame.",
    )
    values_rate: float = _setting(
        10.0, "Samples of each topic to take per second at most; 0 is any.", 0, 1000
    )
    onto: str = _setting("", "Map (.hmap) of an earlier run to continue, with its settings.")
    save_to: str = _setting("", "File (.hmap) in which the map is saved at the end.", once=True)
    save_every: float = _setting(
        30.0, "Seconds between saves while mapping; 0: only at the end.", 0, 86400
    )
    map_directory: str = _setting(
        "", "Directory in which the service save_map saves; by default that of save_to."
    )
    frontiers: bool = _setting(
        False, "Whether to publish where to look next: frontiers and uncertain objects."
    )
    frontiers_every: float = _setting(2.0, "Seconds between searches for frontiers.", 0.1, 3600)
    base_frame: str = _setting(
        "base_link", "Frame of the robot, for frontiers, path_topic, graph_topic and values."
    )
    robot_radius: float = _setting(0.3, "Radius of the robot [m].", 0, 10)
    through_unknown: bool = _setting(False, "Whether the robot may drive over unknown cells.")
    sensor_range: float = _setting(4.0, "Maximum range of its sensor on the floor [m].", 0.1, 100)
    sensor_min_range: float = _setting(0.0, "Minimum range of its sensor on the floor [m].", 0, 100)
    sensor_fov: float = _setting(60.0, "Horizontal field of view of its sensor [degrees].", 1, 360)

    def __post_init__(self) -> None:
        if bool(self.depth_topic) == bool(self.cloud_topic):
            raise HypermapError(
                "give either depth_topic, as /camera/aligned_depth_to_color/image_raw, or "
                f"cloud_topic, as /camera/depth_registered/points; {self._found(_GEOMETRY)}"
            )
        if sum(bool(getattr(self, name)) for name in _DETECTIONS) != 1:
            raise HypermapError(
                f"there is no source of detections: give one of {', '.join(_DETECTIONS)}; "
                f"{self._found(_DETECTIONS)}"
            )
        if self.detector and not (self.color_topic or self.cloud_topic):
            raise HypermapError("the detector needs color images: give color_topic")
        if self.labels and not self.detector:
            raise HypermapError("labels need a detector")
        if self.register and not (self.color_topic and self.depth_topic):
            raise HypermapError("register moves depth images into color: give color_topic, too")
        if self.path_topic and self.graph_topic:
            raise HypermapError("poses are corrected by path_topic or by graph_topic, not by both")
        if self.rotate % 90:
            raise HypermapError(f"rotate must be 0, 90, 180 or 270 degrees, got {self.rotate}")
        for text in self.values:
            ValueSource.parse(text)
        if not self.map_frame.strip("/"):
            raise HypermapError("map_frame must be the name of a frame")
        if self.frontiers and not (self.occupancy or self.map_topic):
            raise HypermapError("frontiers need an occupancy map: set occupancy, or give map_topic")
        if self.sensor_min_range >= self.sensor_range:
            raise HypermapError(
                f"sensor_min_range must be below sensor_range, got {self.sensor_min_range:g} and "
                f"{self.sensor_range:g}"
            )
        if self.save_to and not self.save_to.lower().endswith(".hmap"):
            raise HypermapError(f"save_to: {self.save_to}: a map is saved as .hmap")

    def _found(self, names: Sequence[str]) -> str:
        """Say which of some settings were given, and where."""
        given = [name for name in names if getattr(self, name)]
        said = [
            f"{name} ({self.origins[name]})" if name in self.origins else name for name in given
        ]
        return f"found {' and '.join(said) or 'none'}"

    @classmethod
    def of(
        cls, values: Mapping[str, Value], origins: Mapping[str, str], node_name: str
    ) -> LiveSettings:
        """Return the settings among a node's parameters; raises as the class does.

        Args:
            values: of the parameters.
            origins: where those that were given come from, in words.
            node_name: the full name of the node, in whose namespace are topics without a slash.
        """
        known: dict[str, Any] = {f.name: values[f.name] for f in fields(cls) if f.name in values}
        for name, value in known.items():
            if name.endswith("_topic"):
                known[name] = named_by_user(value, node_name)
            elif name == "values":
                known[name] = [named_by_user(text, node_name) for text in value]
        return cls(**known, origins=origins)

    @property
    def geometry_topic(self) -> str:
        """Where depth comes from."""
        return self.cloud_topic or self.depth_topic

    @property
    def geometry_type(self) -> str:
        """Type of its messages."""
        if self.cloud_topic:
            return CLOUD
        is_compressed = self.depth_topic.endswith(("/compressedDepth", "/compressed"))
        return COMPRESSED if is_compressed else IMAGE

    @property
    def color_type(self) -> str:
        """Type of the color images."""
        return COMPRESSED if self.color_topic.endswith("/compressed") else IMAGE

    @property
    def info_topic(self) -> str:
        """Where the intrinsics come from; empty if the clouds show them."""
        if self.camera_info_topic or self.cloud_topic:
            return self.camera_info_topic
        folder = image_folder(self.depth_topic)
        return f"{folder}/camera_info"

    @property
    def color_info_topic(self) -> str:
        """Where the intrinsics of color come from; empty if depth is not registered to it."""
        if not self.register:
            return ""
        return f"{image_folder(self.color_topic)}/camera_info"

    @property
    def is_rectified(self) -> bool:
        """Whether the depth images are rectified, as their name tells."""
        return names_rectified(self.geometry_topic)

    @property
    def is_color_rectified(self) -> bool:
        """Whether the color images are rectified; without a topic, as the depth images are."""
        return names_rectified(self.color_topic or self.geometry_topic)


PARAMETERS: tuple[Parameter, ...] = tuple(
    Parameter(setting.name, cast("Value", setting.default), **setting.metadata)
    for setting in fields(LiveSettings)
    if setting.metadata
)
