"""One recording by many workers, who look at frames ahead of the mapper.

What a frame shows does not depend on the frames before it, and takes nearly all of the time. Which
frames are keyframes does, a little: the poses show it in advance, unless a frame cannot be used. So
workers look at the frames that will be keyframes by all that is known, and again at others if it
turns out otherwise. The mapper decides; a frame that it needs and nobody has looked at, it looks at
itself. Thus the map does not depend on the number of workers.
"""

from __future__ import annotations

import copy
import logging
import re
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from hypermap.fleet.looking import Look, Looked, look_at
from hypermap.fleet.workers import Workers
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.perceived import Perceived, Perceiver
from hypermap.perception.detectors.origin import DetectionOrigin
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.recording import (
    OnBadFrame,
    PendingFrame,
    PendingRecording,
    SameRecording,
)

_PER_WORKER = 4  # frames that are with workers, or wait for the mapper

_log = logging.getLogger(__name__)


@dataclass(eq=False)
class _Sent:
    """A frame that is with the workers, or back from them."""

    pending: PendingFrame
    is_keyframe: bool
    future: Future[Looked]


class LookedAtAhead(SameRecording):
    """A recording whose frames were looked at by workers before they are yielded.

    Give it to `map_recording` as its recording and as `ahead`.
    """

    def __init__(
        self, recording: PendingRecording, workers: Workers, origin: DetectionOrigin | None
    ) -> None:
        """Prepare to read a recording once.

        Args:
            recording: where the frames come from.
            workers: who looks at them.
            origin: of the detections; None for a map without objects.
        """
        super().__init__(recording)
        self._pending = recording
        self._workers = workers
        self._origin = origin
        self._current = Looked()
        self._warned: set[str] = set()

    def begin(self, mapper: Mapper) -> None:
        """Look at frames as this mapper would, from now on."""
        self._look = Look(
            self._origin,
            mapper.perceiver.perception,
            mapper.perceiver.occupancy,
            mapper.corrects_poses,
            mapper.perceiver.is_watched,
            self._workers.threads,
        )
        self._decided = copy.copy(mapper.keyframes)  # up to the newest frame that was yielded
        self._expected = copy.copy(mapper.keyframes)  # up to the newest one that was sent

    def frames(self, on_bad: OnBadFrame | None = None) -> Iterator[RgbdFrame]:
        """Yield the frames in order of time; see `Recording.frames`."""
        sent: deque[_Sent] = deque()
        try:
            for pending in self._pending.pending(on_bad):
                sent.append(self._send(pending))
                if len(sent) > _PER_WORKER * self._workers.count:
                    yield from self._received(sent, on_bad)
            while sent:
                yield from self._received(sent, on_bad)
        finally:
            for each in sent:
                each.future.cancel()

    def perceive(self, frame: RgbdFrame, perceiver: Perceiver) -> Perceived:
        """Return what the frame that was yielded last shows.

        Args:
            frame: the frame, perhaps with a corrected pose.
            perceiver: looks at it, as far as no worker has done so.

        Raises:
            HypermapError: As the perceiver does.
        """
        looked = self._current
        if looked.error is not None:
            raise looked.error
        if looked.frame is None or looked.found is None:
            return perceiver(frame)
        is_same_pose = np.array_equal(looked.frame.map_T_camera, frame.map_T_camera)
        if looked.perceived is not None and is_same_pose:
            return looked.perceived
        return perceiver.perceived(frame, looked.found)

    def _send(self, pending: PendingFrame) -> _Sent:
        pose = pending.map_T_camera
        is_keyframe = pose is None or self._expected.accept(pose, pending.stamp)
        return _Sent(pending, is_keyframe, self._submit(pending, is_keyframe))

    def _submit(self, pending: PendingFrame, is_keyframe: bool) -> Future[Looked]:
        return self._workers.submit(look_at, pending, self._look, is_keyframe)

    def _received(self, sent: deque[_Sent], on_bad: OnBadFrame | None) -> Iterator[RgbdFrame]:
        """Yield the next frame, unless it could not be read."""
        first = sent.popleft()
        looked = self._current = first.future.result()
        self._log_warnings(looked)
        is_keyframe = (
            looked.frame is not None
            and looked.is_usable
            and looked.error is None
            and self._decided.accept(looked.frame.map_T_camera, looked.frame.stamp)
        )
        if is_keyframe != first.is_keyframe:
            self._expect_anew(sent)
        if looked.frame is not None:
            yield looked.frame
        elif looked.error is not None:
            if on_bad is None:
                raise looked.error
            on_bad(first.pending.stamp, looked.error)

    def _expect_anew(self, sent: deque[_Sent]) -> None:
        """Let workers look at those frames that will be keyframes after all."""
        self._expected = copy.copy(self._decided)
        for each in sent:
            pose, stamp = each.pending.map_T_camera, each.pending.stamp
            if pose is not None and self._expected.accept(pose, stamp) and not each.is_keyframe:
                each.is_keyframe, each.future = True, self._submit(each.pending, True)

    def _log_warnings(self, looked: Looked) -> None:
        """Log what workers have logged, each kind of line once, as one process would."""
        for line in looked.warnings:
            kind = re.sub(r"\d+", "#", line)  # stamps have more digits later
            if kind not in self._warned:
                self._warned.add(kind)
                _log.warning("%s", line)
