"""The part of a live node that maps what other sensors measure."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hypermap.core.errors import FrameError, HypermapError
from hypermap.core.value_layer import ValueLayer
from hypermap.recordings.messages.header import as_seconds, clean_frame, nanoseconds
from hypermap.recordings.samples import ValueSource
from hypermap.recordings.samples.fields import Reading, reading_of
from hypermap.recordings.samples.measured import Measured, checked, reasons
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.outputs import OnDemand
from hypermap.ros.mapper.repeating import Repeating
from hypermap.ros.mapper.settings import LiveSettings
from hypermap.ros.port import Closable, Message, Port
from hypermap.ros.server.layer_topics import Kind, kinds_of
from hypermap.ros.throttle import Throttle
from hypermap.ros.topic_names import topic_name

if TYPE_CHECKING:
    from hypermap.values.growing import GrowingLayer

_PERIOD = 0.1  # s between looks at what has come
_LOOK_FOR_TYPES = 1.0  # s
_PATIENCE = 2.0  # s that a sample waits for its pose
_WAITING = 10_000  # samples that may wait; older ones are dropped
_NEW_WALLS = 30.0  # s after which a field is solved from scratch for the map of now
_SHARE = 10.0  # times as long as solving took, until the next time


class LiveValues:
    """Takes samples from topics, finds where they were taken, and makes layers of the map.

    A separate thread does everything except receiving messages. A sample changes the layer
    immediately. The field is solved from scratch if `GrowingLayer` asks for it or the map has
    changed, as long as this takes at most a tenth of the time, and at the end.
    """

    def __init__(
        self, port: Port, settings: LiveSettings, live_map: LiveMap, log: Throttle
    ) -> None:
        self._port, self._settings, self._map, self._log = port, settings, live_map, log
        self._untyped = [ValueSource.parse(text) for text in settings.values]
        self._next_look = self._next_publish = 0.0
        self._quantities: list[_Quantity] = []
        self._repeating: Repeating | None = None
        if self._untyped:
            names = ", ".join(source.topic for source in self._untyped)
            port.log("info", f"waiting for samples on {names}")
            self._repeating = Repeating("values", self._look, _PERIOD, log, "a sample failed")

    def close(self) -> None:
        """Take in what has come, and make the layers of all samples and the map at the end."""
        if self._repeating is not None:
            self._repeating.close()
        for quantity in self._quantities:
            quantity.close(self._map)

    def _look(self) -> None:
        """Do what there is to do now."""
        now = time.monotonic()
        if self._untyped and now >= self._next_look:
            self._next_look = now + _LOOK_FOR_TYPES
            self._untyped = [each for each in self._untyped if not self._begin(each)]
        for quantity in self._quantities:
            quantity.take()
            quantity.solve_if_due(self._map)
        if now >= self._next_publish:
            self._next_publish = now + 1 / self._settings.publish_rate
            for quantity in self._quantities:
                quantity.publish()

    def _begin(self, source: ValueSource) -> bool:
        """Listen to a topic whose type is known; return whether there is no more to wait for."""
        type_name = self._port.topic_type(source.topic)
        if type_name is None:
            return False
        try:
            quantity = _Quantity(self._port, self._settings, source, type_name, self._log)
            quantity.begin(self._map)
        except HypermapError as error:
            self._port.log("error", f"{source.topic}: {error}; its samples are not mapped")
            return True
        self._quantities.append(quantity)
        return True


@dataclass(frozen=True)
class _Arrived:
    """A number, the stamp [ns] and frame of its sensor, and when it arrived [s]."""

    value: float
    stamp: int
    frame: str
    arrived: float


class _Quantity:
    """One topic, from its messages to its layer; see `LiveValues`."""

    def __init__(
        self,
        port: Port,
        settings: LiveSettings,
        source: ValueSource,
        type_name: str,
        log: Throttle,
    ) -> None:
        self._port, self._settings, self._source, self._log = port, settings, source, log
        self._type_name = type_name
        self._reading: Reading = reading_of(type_name.replace("/", "/msg/", 1), source.field)
        self._map_frame = clean_frame(settings.map_frame)
        self._waiting: deque[_Arrived] = deque(maxlen=_WAITING)
        self._next_stamp = 0  # ns, from which on the next sample is taken
        self._solved = (0.0, -1)  # until when not to solve again, and the map's revision then
        self._opened: list[Closable] = []

    def begin(self, live_map: LiveMap) -> None:
        """Begin the layer, and listen.

        Raises:
            HypermapError: If the layer cannot have these samples.
        """
        name = self._source.name(self._reading.quantity)
        self._unit_of_map = live_map.values.unit_of(name)
        unit = self._measured([]).unit
        self._layer: GrowingLayer = live_map.values.begin(name, name, unit)
        self._topics = [
            (kind, OnDemand(self._port, topic_name(name, kind.suffix), kind.type_name))
            for kind in kinds_of(ValueLayer, self._port)
        ]
        topic = self._source.topic
        listener = self._port.subscribe(topic, self._type_name, self._receive, queue=100)
        self._opened = [listener, *(each for _, each in self._topics)]
        self._port.log("info", f"{topic}: its samples become the layer {name!r}")

    def take(self) -> None:
        """Give the layer the samples whose places are known by now."""
        points: list[tuple[float, float]] = []
        found: list[_Arrived] = []
        later: list[_Arrived] = []
        for _ in range(len(self._waiting)):
            sample = self._waiting.popleft()
            try:
                pose = self._port.lookup(self._map_frame, sample.frame, sample.stamp)
            except FrameError as error:
                if time.monotonic() - sample.arrived < _PATIENCE:
                    later.append(sample)
                    continue
                topic = self._source.topic
                self._log.log("warning", topic, f"{topic}: a sample has no pose: {error}")
                continue
            points.append((float(pose[0, 3]), float(pose[1, 3])))
            found.append(sample)
        self._waiting.extendleft(reversed(later))
        if found:
            measured = self._measured(found, points)
            if measured.left_out:
                text = f"{self._source.topic}: left out: {reasons(measured.left_out)}"
                self._log.log("warning", (self._source.topic, "left out"), text)
            self._layer.add(measured.samples)

    def solve_if_due(self, live_map: LiveMap) -> None:
        """Solve the field from scratch if samples or the map ask for it, and it is not too soon."""
        until, revision = self._solved
        now = time.monotonic()
        has_new_walls = live_map.revision != revision and now >= until + _NEW_WALLS
        if now < until or not (self._layer.is_due or (has_new_walls and revision >= 0)):
            return
        self._solve(live_map)

    def publish(self) -> None:
        """Publish the layer if it has changed and someone listens."""
        for kind, topic in self._topics if self._layer.revision else ():
            topic.publish(self._layer.revision, partial(self._message, kind))

    def close(self, live_map: LiveMap) -> None:
        """Listen no more, and bring all samples that have come into the layer."""
        for closable in self._opened:
            closable.close()
        self.take()
        if self._layer.is_new:
            self._solve(live_map)
        live_map.values.end(self._layer.name)

    def _message(self, kind: Kind) -> Message:
        layer = self._layer.layer() or ValueLayer(self._layer.name, self._map_frame)
        return kind.make(layer, self._port, self._port.now())

    def _solve(self, live_map: LiveMap) -> None:
        revision, began = live_map.revision, time.monotonic()
        try:
            self._layer.solve(live_map.walls())
        except HypermapError as error:
            text = f"{self._source.topic}: the layer has no values yet: {error}"
            self._log.log("info", (self._source.topic, "solve"), text)
        took = time.monotonic() - began
        self._solved = time.monotonic() + _SHARE * took, revision

    def _receive(self, message: Message) -> None:
        """Note what a message says; its place is looked up later."""
        header = getattr(message, "header", None)
        stamp = 0 if header is None else nanoseconds(header.stamp)
        stamp = stamp or self._port.now()
        rate = self._settings.values_rate
        period = round(1e9 / rate) if rate else 0
        if self._next_stamp - period <= stamp < self._next_stamp:
            return
        self._next_stamp = stamp + period
        named = "" if header is None else header.frame_id
        frame = clean_frame(self._source.sensor_frame or named or self._settings.base_frame)
        try:
            value = self._reading.read(message)
        except HypermapError as error:
            topic = self._source.topic
            self._log.log("error", (topic, "field"), f"{topic}: {error}")
            return
        self._waiting.append(_Arrived(value, stamp, frame, time.monotonic()))

    def _measured(
        self, arrived: Sequence[_Arrived], points: Sequence[tuple[float, float]] = ()
    ) -> Measured:
        """Return samples in the unit of the layer.

        Raises:
            HypermapError: If it is not known to be theirs times a number.
        """
        columns: dict[str, Any] = {
            "points_xy": np.array(points, np.float64).reshape(-1, 2),
            "values": np.array([each.value for each in arrived], np.float64),
            "stamps": np.array([as_seconds(each.stamp) for each in arrived], np.float64),
        }
        limit = self._source.censored_below
        measured = checked(**columns, censored_below=limit, unit=self._reading.unit)
        unit = self._source.unit or self._unit_of_map or None
        return measured.in_unit(unit, self._source.sample_unit).in_unit(self._unit_of_map or None)
