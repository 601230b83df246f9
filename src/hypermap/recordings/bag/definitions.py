"""Message types for bags that do not contain them, such as ROS 2 bags before Iron.

Source: vision_msgs 4 (ROS 2 Humble); the ROS 2 port of darknet_ros_msgs.
"""

from __future__ import annotations

from functools import cache

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

DETECTION_TYPES = {
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "vision_msgs/msg/BoundingBox2D": ("vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y"),
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nstring id"
    ),
    "vision_msgs/msg/Detection2DArray": (
        "std_msgs/Header header\nvision_msgs/Detection2D[] detections"
    ),
    "darknet_ros_msgs/msg/BoundingBox": (
        "float64 probability\nint64 xmin\nint64 ymin\nint64 xmax\nint64 ymax\nint16 id\n"
        "string class_id"
    ),
    "darknet_ros_msgs/msg/BoundingBoxes": (
        "std_msgs/Header header\nstd_msgs/Header image_header\n"
        "darknet_ros_msgs/BoundingBox[] bounding_boxes"
    ),
}


@cache
def known_types() -> Typestore:
    """Return the types of ROS 2 Humble, and those of detections."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in DETECTION_TYPES.items():
        store.register(get_types_from_msg(text, name))
    return store
