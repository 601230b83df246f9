"""What the semantic mapper listens to: messages that belong together become work."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import partial
from typing import Any

from hypermap.core.errors import FormatError
from hypermap.recordings.messages.detections import detections_of
from hypermap.recordings.messages.header import nanoseconds
from hypermap.ros.mapper.settings import CAMERA_INFO, LiveSettings
from hypermap.ros.mapper.statistics import Fate, Statistics
from hypermap.ros.mapper.synchronizer import MatchedMessages, Synchronizer
from hypermap.ros.port import Message, Port
from hypermap.ros.throttle import Throttle

_QUEUE = 10  # messages of a topic that may wait for us; we take them at once
_LACKING = {"color": Fate.NO_COLOR, "detections": Fate.NO_DETECTIONS, "": Fate.TOO_OLD}


@dataclass(frozen=True)
class QueuedFrame:
    """A frame to be mapped.

    Attributes:
        match: its messages.
        arrived: when its depth came [s], by `time.monotonic`.
    """

    match: MatchedMessages
    arrived: float

    @property
    def geometry(self) -> Any:
        """The depth image or cloud."""
        return self.match.items[""]


class LiveInputs:
    """The subscriptions, and the synchronisation of their messages."""

    def __init__(
        self,
        port: Port,
        settings: LiveSettings,
        statistics: Statistics,
        log: Throttle,
        on_frame: Callable[[QueuedFrame], None],
        on_camera_info: Callable[[Message], None],
        on_color_info: Callable[[Message], None],
        on_jump: Callable[[], None],
    ) -> None:
        """Subscribe.

        Args:
            port: the middleware.
            settings: names and types of the topics.
            statistics: counts frames that are lost here.
            log: says why.
            on_frame: takes what is complete, in order of time but for small disorder.
            on_camera_info: takes the intrinsics.
            on_color_info: takes those of the color images, where they are needed.
            on_jump: called when the clock has jumped back, before anything newer comes.
        """
        self._settings = settings
        self._statistics = statistics
        self._log = log
        self._on_frame = on_frame
        self._on_jump = on_jump
        self._lock = threading.Lock()
        self._next_due = 0  # ns
        others: dict[str, tuple[str, str, Callable[[Message], None]]] = {}
        if settings.detections_topic:
            others["detections"] = (
                settings.detections_topic,
                settings.detections_type,
                self._take_detections,
            )
        if settings.color_topic and (settings.register or not others):
            others["color"] = (settings.color_topic, settings.color_type, self._take_color)
        self._synchronizer = Synchronizer(tuple(others), settings.slop, settings.patience)
        subscribe = partial(port.subscribe, queue=_QUEUE)
        with ExitStack() as begun:  # which is closed again where a subscription cannot be made
            if settings.info_topic:
                info = port.subscribe(settings.info_topic, CAMERA_INFO, on_camera_info)
                begun.enter_context(closing(info))
            if settings.color_info_topic:
                info = port.subscribe(settings.color_info_topic, CAMERA_INFO, on_color_info)
                begun.enter_context(closing(info))
            for stream in others.values():
                begun.enter_context(closing(subscribe(*stream)))
            geometry = settings.geometry_topic, settings.geometry_type, self._take_geometry
            begun.enter_context(closing(subscribe(*geometry)))
            self._subscriptions = begun.pop_all()

    def close(self) -> None:
        """Listen no more."""
        self._subscriptions.close()

    def _take_geometry(self, message: Message) -> None:
        arrived = time.monotonic()
        stamp = nanoseconds(message.header.stamp)
        if stamp == 0:
            self._statistics.count(Fate.UNUSABLE)
            self._log.log(
                "warning",
                "no stamp",
                f"{self._settings.geometry_topic}: the messages have no time stamp, so nothing "
                "tells where the camera was",
            )
            return
        self._add("", stamp, (message, arrived))

    def _take_color(self, message: Message) -> None:
        self._add("color", nanoseconds(message.header.stamp), message)

    def _take_detections(self, message: Message) -> None:
        try:
            stamp, detections = detections_of(message)
        except (FormatError, ValueError) as error:
            topic = self._settings.detections_topic
            self._log.log("warning", "detections", f"{topic}: {error}; this message is left out")
            return
        self._add("detections", stamp, detections)

    def _add(self, stream: str, stamp: int, item: Any) -> None:
        with self._lock:  # held until the work is handed over, so that it comes in order
            settled = self._synchronizer.add(stream, stamp, item)
            if settled.has_jumped:
                self._next_due = 0
                for _ in range(settled.forgotten):
                    self._statistics.count(Fate.CLOCK_JUMP)
                self._on_jump()
            for lacking in settled.lost:
                self._statistics.count(_LACKING[lacking])
            for match in settled.matches:
                if match.stamp < self._next_due:
                    self._statistics.count(Fate.RATE)
                    continue
                self._next_due = self._due_after(match.stamp)
                geometry, arrived = match.items[""]
                items = {**match.items, "": geometry}
                self._on_frame(
                    QueuedFrame(MatchedMessages(match.stamp, items, match.stamps), arrived)
                )

    def _due_after(self, stamp: int) -> int:
        """Return the stamp from which on the next frame is taken."""
        if self._settings.max_rate == 0:
            return 0
        period = round(1e9 / self._settings.max_rate)
        # A tenth of a period is the camera's jitter; on average the rate holds all the same.
        return max(self._next_due + period, stamp + period - period // 10)
