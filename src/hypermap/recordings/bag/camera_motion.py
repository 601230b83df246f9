"""Where the camera was, by the transforms that a bag has recorded (tf)."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError, FrameError
from hypermap.core.moving_frames import Motion, MovingFrames
from hypermap.core.trajectory import Trajectory
from hypermap.recordings.bag.contents import Contents
from hypermap.recordings.messages.header import clean_frame
from hypermap.recordings.messages.transforms import leap_of
from hypermap.recordings.options import RecordingOptions
from hypermap.text import counted

MAP_FRAME = "map"  # REP 105


class CameraMotion:
    """The frames of the camera and of the map, and the motion of one in the other.

    Every property raises a FormatError if something that it needs is missing.
    """

    def __init__(self, contents: Contents, options: RecordingOptions) -> None:
        self._contents, self._options = contents, options

    @property
    def tree(self) -> MovingFrames:
        """All frames of tf."""
        return self._tree[0]

    @property
    def left_out(self) -> list[str]:
        """Sentences on transforms that are left out."""
        return self._tree[1]

    @cached_property
    def _tree(self) -> tuple[MovingFrames, list[str]]:
        try:
            return self._contents.transforms.frames(self._options.max_pose_gap)
        except FrameError as error:
            raise FormatError(
                f"tf is broken: {error}; one of the nodes that publish them has to stop, or swap "
                "parent and child; record again"
            ) from None

    def check_recorded(self) -> None:
        """Raise a FormatError if no transform was recorded."""
        if not self.tree.frames:
            raise FormatError(
                "there is no tf, so the camera's poses are unknown; record /tf and /tf_static"
            )

    @property
    def camera_frame(self) -> str:
        """The camera's optical frame; empty if the messages do not name it."""
        if self._options.camera_frame:
            return clean_frame(self._options.camera_frame)
        return self._contents.geometry.frame_id

    @cached_property
    def motion(self) -> Motion:
        """The motion of the camera in the map."""
        tree = self.tree
        self.check_recorded()
        known = ", ".join(tree.frames)
        if not self.camera_frame:
            raise FormatError("the depth messages name no frame; name it with --camera-frame")
        if self.camera_frame not in tree.frames:
            raise FormatError(
                f"tf has no frame {self.camera_frame!r}, the camera's; it has {known}; record "
                "/tf_static as well, or name the camera's frame with --camera-frame"
            )
        if self.map_frame not in tree.frames:
            raise FormatError(
                f"tf has no frame {self.map_frame!r}; it has {known} (fixed: "
                f"{', '.join(tree.roots)}); name one with --map-frame"
            )
        if self.map_frame_notes and not tree.moves(self.camera_frame):
            raise FormatError(
                f"tf has no frame {MAP_FRAME!r}, and camera frame {self.camera_frame!r} does not "
                f"move relative to the root of tf, {self.map_frame!r}; it has {known}; record /tf "
                "as well, or, if the camera stood still, name its fixed frame with --map-frame"
            )
        try:
            return tree.motion(self.map_frame, self.camera_frame)
        except FrameError as error:
            raise FormatError(
                f"tf has no transform from the camera to the map: {error}; name another fixed "
                "frame with --map-frame"
            ) from None

    @cached_property
    def map_frame(self) -> str:
        """The frame of the map: from the user, or `map`, or else the root above the camera.

        `motion` checks whether tf has the frame.
        """
        if self._options.map_frame is not None:
            return clean_frame(self._options.map_frame)
        tree = self.tree
        if MAP_FRAME in tree.frames or self.camera_frame not in tree.frames:
            return MAP_FRAME
        return tree.root_of(self.camera_frame)

    @property
    def map_frame_notes(self) -> list[str]:
        """A sentence on the map's frame, if the user gave none and it is not `map`."""
        if self._options.map_frame is not None or self.map_frame == MAP_FRAME:
            return []
        return [
            f"tf has no frame {MAP_FRAME!r}: the map is made in {self.map_frame!r}, the root above "
            "the camera, whose z axis must point up (--map-frame)"
        ]

    def pose_in(self, frame: str) -> NDArray[np.float64]:
        """Return the pose of the camera in another frame at the first image, shape (4, 4).

        Raises:
            FrameError: If tf does not connect them.
        """
        first = self._contents.geometry.seconds()[:1]
        return np.asarray(self.tree.motion(frame, self.camera_frame).at(first)[0])

    def leaps(self) -> list[str]:
        """Return sentences on frames that seem to be in two places, between camera and map."""
        edges = self.tree.edges_between(self.map_frame, self.camera_frame).items()
        leaps = {edge: leap_of(one) for edge, one in edges if isinstance(one, Trajectory)}
        return [
            f"frame {child!r} jumps to and fro in {parent!r}, by {leap:.2f} m: if two nodes "
            "publish where it is, some of the poses are wrong"
            for (parent, child), leap in leaps.items()
            if leap > 0
        ]

    def least_known(self) -> list[str]:
        """Return which transform is missing at most of the images, as a sentence, if one is."""
        stamps = self._contents.geometry.seconds() + self._options.time_offset
        begin, end = self._contents.transforms.span()
        is_within = ((stamps >= begin) & (stamps <= end)).mean() > 0.5
        if self.left_out or not is_within:  # which says more
            return []
        edges = self.tree.edges_between(self.map_frame, self.camera_frame)
        known = {edge: float(motion.covers(stamps).mean()) for edge, motion in edges.items()}
        worst = min(known, key=lambda edge: known[edge], default=("", ""))
        if known.get(worst, 1.0) > 0.5:
            return []
        log = self._contents.transforms.stamps(worst)
        parent, child = worst
        return [
            f"tf says at {known[worst]:.0%} of the images where {child!r} is in {parent!r}: it has "
            f"{counted(len(log), 'transform')}, from {log.min():.3f} to {log.max():.3f} s; "
            "record it more often, or in tf_static if it is fixed"
        ]
