"""Where a robot should look next, as markers and poses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from hypermap.core.frames import Pose2D
from hypermap.exploration import Frontier, NextView
from hypermap.ros.messages.geometry_messages import Types, header, point, quaternion
from hypermap.ros.messages.markers import ARROW, CUBE_LIST, INK, TEXT_VIEW_FACING, MarkerMaker
from hypermap.ros.port import Message

_BORDER, _VIEW = (0.12, 0.47, 0.71, 1.0), (0.84, 0.37, 0.0, 1.0)
_HEIGHT, _LABEL, _LENGTH = 0.05, 0.2, 0.4  # m: above the floor, of letters, of arrows


def exploration_markers(
    frontiers: Sequence[Frontier], views: Sequence[NextView], frame_id: str, types: Types
) -> Message:
    """Return frontiers and next views as a `visualization_msgs/MarkerArray`.

    The first marker deletes all earlier ones. Each frontier has its cells in the namespace
    `frontiers`, an arrow where a robot can stand in `stands`, and its rank with what it shows in
    `gains`; each unsure object has an arrow in `next_views` and its name in `objects`. The numbers
    of markers are ranks, from 0.
    """
    make = MarkerMaker(types, frame_id)
    markers = [make.delete_all()]
    for i, each in enumerate(frontiers):
        cells = make.marker("frontiers", i, CUBE_LIST, color=_BORDER)
        height = np.full(len(each.points_xy), _HEIGHT)
        make.draw(cells, np.column_stack([each.points_xy, height]), each.size / len(height))
        markers += [cells, _arrow(make, "stands", i, each.pose, _BORDER)]
        text = f"{i + 1}: {each.gain:.1f} m2, {each.distance:.1f} m"
        markers.append(_label(make, "gains", i, text, each.place_xy))
    for i, view in enumerate(views):
        markers.append(_arrow(make, "next_views", i, view.pose, _VIEW))
        name = f"{view.item.object.name} {view.item.object.id}"
        markers.append(_label(make, "objects", i, name, view.item.point_xy))
    return make.array(markers)


def pose_array(poses: Iterable[Pose2D], frame_id: str, types: Types, stamp: int) -> Message:
    """Return poses on the floor as a `geometry_msgs/PoseArray`."""
    pose_class = types.message("geometry_msgs/Pose")
    return types.message("geometry_msgs/PoseArray")(
        header=header(frame_id, types, stamp),
        poses=[
            pose_class(
                position=point(pose.x, pose.y, types), orientation=quaternion(pose.yaw, types)
            )
            for pose in poses
        ],
    )


def _arrow(
    make: MarkerMaker, namespace: str, number: int, pose: Pose2D, color: tuple[float, ...]
) -> Message:
    red, green, blue, alpha = color
    arrow = make.marker(namespace, number, ARROW, color=(red, green, blue, alpha))
    make.point_along(arrow, pose, _LENGTH, _HEIGHT)
    return arrow


def _label(
    make: MarkerMaker, namespace: str, number: int, text: str, at_xy: Sequence[float] | np.ndarray
) -> Message:
    label = make.marker(namespace, number, TEXT_VIEW_FACING, color=INK)
    make.write(label, text, (float(at_xy[0]), float(at_xy[1]), _HEIGHT + _LABEL), _LABEL)
    return label
