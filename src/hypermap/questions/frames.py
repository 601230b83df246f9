"""Where people are, and frames in which they give points; a `Query` has all in the base frame."""

from __future__ import annotations

from hypermap.core.errors import FrameError, HypermapError, did_you_mean
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap


def pose_of_frame(hypermap: Hypermap, frame_id: str | None) -> Pose2D:
    """Return the pose of a frame in the base frame of a map; None is the base frame.

    Raises:
        FrameError: If the map does not know it.
    """
    base = hypermap.base_frame
    known = dict.fromkeys([base, *(one.frame_id for one in hypermap), *hypermap.frames.frames])
    if frame_id is not None and frame_id not in known:
        hint = did_you_mean(frame_id, known)
        raise FrameError(f"frame {frame_id!r} is unknown to the map; {hint}")
    return hypermap.frames.lookup(base, frame_id or base)


def pose_of_asker(asker: Pose2D | None) -> Pose2D:
    """Return the pose of the asker in the base frame.

    Raises:
        HypermapError: If it is not known.
    """
    if asker is None:
        raise HypermapError(
            "the answer depends on where you are; say so in the question, or give a pose: "
            "--pose X,Y or X,Y,YAW on the command line, pose=(x, y) in Python"
        )
    return asker
