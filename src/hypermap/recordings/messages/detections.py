"""Detections from `darknet_ros_msgs/BoundingBoxes` and `vision_msgs/Detection2DArray`."""

from __future__ import annotations

from typing import Any

from hypermap.core.errors import FormatError
from hypermap.perception.detections import Detections
from hypermap.recordings.messages.header import nanoseconds


def detections_of(message: Any) -> tuple[int, Detections]:
    """Return the stamp of the image [ns], and the detections in it.

    Boxes without a class are left out; of several classes for one box, the most likely one is used.

    Raises:
        FormatError: If the message is of an unknown kind.
    """
    if hasattr(message, "bounding_boxes"):
        # Some versions leave the image's header empty.
        image, own = message.image_header.stamp, message.header.stamp
        return nanoseconds(image) or nanoseconds(own), _of_darknet(message.bounding_boxes)
    if hasattr(message, "detections"):
        return nanoseconds(message.header.stamp), _of_vision(message.detections)
    raise FormatError(f"a message of type {type(message).__name__} contains no detections")


def _of_darknet(boxes: Any) -> Detections:
    return Detections.of(
        [(box.xmin, box.ymin, box.xmax, box.ymax) for box in boxes],
        # ROS 1 spells it `Class`, the ROS 2 port `class_id`.
        [box.Class if hasattr(box, "Class") else box.class_id for box in boxes],
        [box.probability for box in boxes],
    )


def _of_vision(detections: Any) -> Detections:
    xyxy, names, scores = [], [], []
    for detection in detections:
        # From vision_msgs 3 on, class and score lie one level deeper; before, the class is `id`.
        found = [getattr(result, "hypothesis", result) for result in detection.results]
        if not found:
            continue
        best = max(found, key=lambda hypothesis: float(hypothesis.score))
        center = detection.bbox.center
        at = getattr(center, "position", center)  # vision_msgs 4 has a pose of its own
        half_x, half_y = detection.bbox.size_x / 2, detection.bbox.size_y / 2
        xyxy.append((at.x - half_x, at.y - half_y, at.x + half_x, at.y + half_y))
        names.append(str(best.class_id if hasattr(best, "class_id") else best.id))
        scores.append(float(best.score))
    return Detections.of(xyxy, names, scores)
