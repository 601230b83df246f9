"""`hypermap live`: map live on a robot, through ROS."""

from __future__ import annotations

import contextlib
import enum
import platform
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.finding_options import (
    Config,
    Detections,
    Detector,
    Labels,
    Onto,
    Profile,
    Score,
)
from hypermap.cli.live_status import status_line
from hypermap.cli.node_options import (
    NodeCommand,
    Params,
    Ros1,
    Ros2,
    chosen_middleware,
    parse_params,
    ros_arguments,
)
from hypermap.cli.onto import is_same_file
from hypermap.cli.options import ForceMap, check_map_output
from hypermap.cli.recording_options import OPTIONS
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.ros.mapper.semantic_mapper import SemanticMapper
    from hypermap.ros.port import Value

COMMAND_CLASS = NodeCommand

_TOPICS = "What to listen to"
_STORE = "A shared store"
_TYPES = {
    "darknet": "darknet_ros_msgs/BoundingBoxes",
    "vision": "vision_msgs/Detection2DArray",
}


class DetectionsType(str, enum.Enum):
    """The kinds of messages that carry detections."""

    darknet = "darknet"
    vision = "vision"


def _topic(name: str, more: str) -> object:
    """Return the option of a topic, which a recording has, too, with more about a live one."""
    text = f"{OPTIONS[name].help.rstrip('.')}: {more}"
    return typer.Option(metavar="TOPIC", help=text, rich_help_panel=_TOPICS, show_default=False)


def command(
    context: typer.Context,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            show_default=False,
            help="Save here: a map, .hmap. Saved regularly and at the end.",
        ),
    ] = None,
    save_every: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            min=0,
            max=86400,
            show_default="30",
            help="Interval of saving the map; 0: only at the end.",
        ),
    ] = None,
    force: ForceMap = False,
    depth_topic: Annotated[str | None, _topic("depth_topic", "registered to color.")] = None,
    cloud_topic: Annotated[str | None, _topic("cloud_topic", "not with --depth-topic.")] = None,
    camera_info_topic: Annotated[
        str | None,
        _topic("camera_info_topic", "by default camera_info in the namespace of depth."),
    ] = None,
    color_topic: Annotated[str | None, _topic("color_topic", "for --detector.")] = None,
    detections_topic: Annotated[str | None, _topic("detections_topic", "of another node.")] = None,
    detections_type: Annotated[
        DetectionsType,
        typer.Option(
            help="Message type: darknet_ros_msgs/BoundingBoxes or vision_msgs/Detection2DArray.",
            rich_help_panel=_TOPICS,
        ),
    ] = DetectionsType.darknet,
    map_topic: Annotated[
        str | None,
        _topic("map_topic", "used to correct poses, and instead of one made from depth."),
    ] = None,
    detector: Detector = None,
    labels: Labels = None,
    score: Score = None,
    detections: Detections = None,
    map_frame: Annotated[
        str | None,
        typer.Option(
            metavar="FRAME",
            show_default="map",
            help=f"{OPTIONS['map_frame'].help.partition(':')[0]}.",
        ),
    ] = None,
    value: Annotated[
        list[str] | None,
        typer.Option(
            "--value",
            metavar="TOPIC[:FIELD][,KEY=TEXT]...",
            show_default=False,
            help="Make a layer of measured values from this topic: such as /temperature, or "
            "/wifi:rssi,unit=dBm. KEY as in `hypermap map`. May be repeated.",
            rich_help_panel=_TOPICS,
        ),
    ] = None,
    onto: Onto = None,
    profile: Profile = None,
    config: Config = None,
    store: Annotated[
        str | None,
        typer.Option(
            "--store",
            metavar="STORE",
            show_default=False,
            help="Also write to a site of a shared store: postgresql://USER@HOST/DATABASE?site=SITE.",
            rich_help_panel=_STORE,
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            metavar="NAME",
            show_default="that of the machine",
            help="Name of this robot in the store.",
            rich_help_panel=_STORE,
        ),
    ] = None,
    spool: Annotated[
        Path,
        typer.Option(
            "--spool",
            metavar="FILE",
            help="File where observations wait while the database cannot be reached.",
            rich_help_panel=_STORE,
        ),
    ] = Path("hypermap.spool"),
    most_refused: Annotated[
        float,
        typer.Option(
            "--refused-mb",
            metavar="MB",
            min=0,
            rich_help_panel=_STORE,
            help="Keep at most so much of what the store refused, the newest.",
        ),
    ] = 100.0,
    ros1: Ros1 = False,
    ros2: Ros2 = False,
    param: Params = None,
    correct_poses: Annotated[str | None, typer.Option("--correct-poses", hidden=True)] = None,
) -> None:
    """Map live on a robot: runs the node semantic_mapper until Ctrl-C, which saves the map.

    The node subscribes to depth images or organized point clouds and tf. Detections come from
    --detector, --detections-topic or --detections. It publishes /semantic_map and saves the file -o
    every --save-every seconds and at the end. The service save_map saves it at once. If the machine
    is too slow, frames are dropped, not queued. --onto continues a map of an earlier run,
    also after a crash; if it is the file of -o, it need not exist at the first start. --store also
    writes objects, their evidence and the occupancy layer to a site of a shared store, every
    second. --value makes layers of measured values from other sensors, such as temperature or
    WiFi. --param sets
    parameters of the node. ROS arguments (NAME:=VALUE, --ros-args ...) are passed to ROS.

    Examples:
        hypermap live --depth-topic /camera/aligned_depth_to_color/image_raw --color-topic
            /camera/color/image_raw --detector yolox-nano -o office.hmap
        hypermap live --cloud-topic /camera/depth_registered/points --detections-topic
            /darknet_ros/bounding_boxes --onto office.hmap -o office.hmap
    """
    if correct_poses is not None:
        raise HypermapError(
            "--correct-poses: live mapping corrects poses by an occupancy map (--map-topic) and by "
            "the loop closures of a SLAM node; without either, record a bag, and map it: hypermap "
            "map BAG --correct-poses graph"
        )
    values: dict[str, Value | None] = {
        "depth_topic": depth_topic,
        "cloud_topic": cloud_topic,
        "camera_info_topic": camera_info_topic,
        "color_topic": color_topic,
        "detections_topic": detections_topic,
        "detections_type": _TYPES[detections_type.value],
        "map_topic": map_topic,
        "detector": _absolute(detector),
        "labels": _absolute(labels),
        "score": score,
        "detections_file": _absolute(detections),
        "map_frame": map_frame,
        "values": value or None,
        "onto": _absolute(onto),
        "profile": None if profile is None else profile.value,
        "config": _absolute(config),
        "save_to": _absolute(output),
        "save_every": save_every,
    }
    given = {name: value for name, value in values.items() if value is not None}
    if output is not None:
        check_map_output(output, force or is_same_file(output, onto))
    middleware = chosen_middleware(ros1, ros2, False)
    arguments = ros_arguments(context)

    from hypermap.ros.mapper.semantic_mapper import SemanticMapper
    from hypermap.ros.nodes import opened_port, run_node, usual_end

    own = {**given, **parse_params(param)}
    with usual_end(), opened_port(SemanticMapper, arguments, middleware, own) as port:
        node = SemanticMapper(port)
        with (
            status_line(node.report, node.__len__),
            _written(node, store, spool, robot, most_refused),
        ):
            run_node(port, node)


@contextlib.contextmanager
def _written(
    node: SemanticMapper,
    store: str | None,
    spool: Path,
    robot: str | None,
    most_refused: float,
) -> Iterator[None]:
    """Write what the node maps to a store meanwhile, if there is one."""
    if store is None:
        yield
        return
    from hypermap.fleet.store.address import site_address
    from hypermap.fleet.store.live_writer import LiveWriter

    address = site_address(store)
    named = robot or platform.node()
    writer = LiveWriter(node.mapped, address, spool, named, note, most_refused)
    try:
        yield
    finally:
        if waiting := writer.close():
            note(f"{counted(waiting, 'message')} for the store wait in {spool} for the next run")


def _absolute(path: Path | str | None) -> str | None:
    """Return a file as the node finds it from anywhere; a detector of a plug-in as it is."""
    if path is None or (isinstance(path, str) and not Path(path).exists()):
        return path
    return str(Path(path).absolute())
