"""Tells transforms of a time to come, which would keep out all others."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

_BACK = 1_000_000_000  # [ns] by which a frame's stamps go back where time has begun again


class NewestTransforms:
    """The newest transform of each frame that a listener to tf has taken.

    tf2 refuses transforms much older than its newest, and forgets all when the clock jumps back, as
    with a bag in a loop. A transform of before the jump that arrives after it, or one of a machine
    whose clock was ahead, would keep out all others until its time has come. All is forgotten when
    one comes that is much older, and nearer to now.

    Args:
        forget: lets tf2 forget all transforms of moving frames.
    """

    def __init__(self, forget: Callable[[], object]) -> None:
        self._forget = forget
        self._stamps: dict[str, int] = {}

    def take(self, transform: Any, stamp: int, now: int) -> None:
        """Take a `geometry_msgs/TransformStamped` before tf2 does.

        Args:
            transform: the message.
            stamp: its stamp [ns].
            now: by the clock [ns].
        """
        frame = transform.child_frame_id
        newest = self._stamps.get(frame, stamp)
        if stamp < newest - _BACK and abs(now - stamp) < abs(now - newest):
            self._forget()
            self._stamps, newest = {}, stamp
        self._stamps[frame] = max(stamp, newest)
