"""Messages of other packages that a node can use where ROS 1 has not installed them.

Source: darknet_ros_msgs 1.1.5, vision_msgs 0.0.2, map_msgs 1.14, grid_map_msgs 1.7.18 and
rtabmap_msgs 0.21 (ROS 1 Noetic); nav2_msgs 1.3 (ROS 2).
"""

from __future__ import annotations

from collections.abc import Mapping

from hypermap.core.errors import HypermapError
from hypermap.ros.definitions import PACKAGE, package_folder

_FOREIGN: Mapping[str, Mapping[str, str]] = {
    "darknet_ros_msgs": {
        "BoundingBox": (
            "float64 probability\nint64 xmin\nint64 ymin\nint64 xmax\nint64 ymax\n"
            "int16 id\nstring Class\n"
        ),
        "BoundingBoxes": "Header header\nHeader image_header\nBoundingBox[] bounding_boxes\n",
    },
    "vision_msgs": {
        "BoundingBox2D": "geometry_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
        "ObjectHypothesisWithPose": (
            "int64 id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose\n"
        ),
        "Detection2D": (
            "Header header\nObjectHypothesisWithPose[] results\nBoundingBox2D bbox\n"
            "sensor_msgs/Image source_img\n"
        ),
        "Detection2DArray": "Header header\nDetection2D[] detections\n",
    },
    "map_msgs": {
        "OccupancyGridUpdate": (
            "Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n"
        ),
    },
    "grid_map_msgs": {
        "GridMapInfo": (
            "std_msgs/Header header\nfloat64 resolution\nfloat64 length_x\nfloat64 length_y\n"
            "geometry_msgs/Pose pose\n"
        ),
        "GridMap": (
            "GridMapInfo info\nstring[] layers\nstring[] basic_layers\n"
            "std_msgs/Float32MultiArray[] data\n"
            "uint16 outer_start_index\nuint16 inner_start_index\n"
        ),
    },
    "rtabmap_msgs": {
        "Link": (
            "int32 fromId\nint32 toId\nint32 type\ngeometry_msgs/Transform transform\n"
            "float64[36] information\n"
        ),
        "MapGraph": (
            "Header header\ngeometry_msgs/Transform mapToOdom\nint32[] posesId\n"
            "geometry_msgs/Pose[] poses\nLink[] links\n"
        ),
    },
    "nav2_msgs": {
        "CostmapFilterInfo": (
            "Header header\nuint8 type\nstring filter_mask_topic\n"
            "float32 base\nfloat32 multiplier\n"
        ),
    },
}

PACKAGES = (PACKAGE, *_FOREIGN)


def definitions(package: str) -> dict[str, str]:
    """Return the definitions of a package that we know: file, as "msg/SemanticMap.msg", to text.

    Raises:
        HypermapError: If we know none of that package.
    """
    if package == PACKAGE:
        folder = package_folder()
        files = sorted([*folder.glob("msg/*.msg"), *folder.glob("srv/*.srv")])
        return {f"{file.parent.name}/{file.name}": file.read_text("utf-8") for file in files}
    if package not in _FOREIGN:
        raise HypermapError(f"the messages of {package} are unknown")
    return {f"msg/{name}.msg": text for name, text in _FOREIGN[package].items()}
