"""What rclpy's nodes work with, in the fake: quality of service, time, parameters, log, errors."""

from __future__ import annotations

import enum
import inspect
import time as wall
from collections.abc import Callable
from typing import Any

# rclpy.qos


class InvalidQoSProfileException(Exception):
    pass


class HistoryPolicy(enum.IntEnum):
    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2


class ReliabilityPolicy(enum.IntEnum):
    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2


class DurabilityPolicy(enum.IntEnum):
    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2


class QoSProfile:
    def __init__(self, **kwargs: Any) -> None:
        self.history = HistoryPolicy(kwargs.pop("history", HistoryPolicy.KEEP_LAST))
        self.depth = kwargs.pop("depth")
        self.reliability = ReliabilityPolicy(kwargs.pop("reliability", ReliabilityPolicy.RELIABLE))
        self.durability = DurabilityPolicy(kwargs.pop("durability", DurabilityPolicy.VOLATILE))
        assert isinstance(self.depth, int)
        assert not kwargs, kwargs


def compatible(offered: QoSProfile, asked: QoSProfile) -> bool:
    """Source: the ROS 2 documentation, About Quality of Service settings, compatibilities."""
    return not (
        (
            asked.reliability == ReliabilityPolicy.RELIABLE
            and offered.reliability == ReliabilityPolicy.BEST_EFFORT
        )
        or (
            asked.durability == DurabilityPolicy.TRANSIENT_LOCAL
            and offered.durability == DurabilityPolicy.VOLATILE
        )
    )


# rclpy.time, rclpy.duration, rclpy.clock


class Duration:
    def __init__(self, *, seconds: float = 0, nanoseconds: int = 0) -> None:
        assert isinstance(nanoseconds, int)
        self.nanoseconds = int(seconds * 1e9) + nanoseconds


class Time:
    def __init__(self, *, seconds: float = 0, nanoseconds: int = 0) -> None:
        assert isinstance(nanoseconds, int)
        self.nanoseconds = int(seconds * 1e9) + nanoseconds
        if self.nanoseconds < 0:
            raise ValueError("Nanoseconds value must not be negative")


class JumpThreshold:
    def __init__(
        self,
        *,
        min_forward: Duration | None,
        min_backward: Duration | None,
        on_clock_change: bool = True,
    ) -> None:
        if min_backward is not None and min_backward.nanoseconds >= 0:
            raise ValueError("min_backward must be a negative non-zero duration")


class JumpHandle:
    def __init__(self, clock: Clock, callback: Callable[[Any], None]) -> None:
        self.clock, self.callback = clock, callback
        clock.jumps.append(self)

    def unregister(self) -> None:
        self.clock.jumps.remove(self)


class ClockType(enum.IntEnum):
    ROS_TIME = 1
    SYSTEM_TIME = 2
    STEADY_TIME = 3


class OwnClock:
    """A clock that belongs to no node."""

    def __init__(self, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> None:
        self.clock_type = clock_type


class Clock:
    def __init__(self, graph: Any) -> None:
        self.graph, self.jumps = graph, list[JumpHandle]()

    def now(self) -> Time:
        return Time(nanoseconds=wall.time_ns() if self.graph.time is None else self.graph.time)

    def create_jump_callback(
        self,
        threshold: JumpThreshold,
        *,
        pre_callback: Callable[[], None] | None = None,
        post_callback: Callable[[Any], None] | None = None,
    ) -> JumpHandle:
        assert post_callback is not None
        return JumpHandle(self, post_callback)


# rclpy.exceptions


class NameValidationException(Exception):
    pass


class InvalidTopicNameException(NameValidationException):
    pass


class ParameterException(Exception):
    pass


class InvalidHandle(RuntimeError):
    pass


class ExternalShutdownException(Exception):
    pass


# rclpy.parameter


class ParameterType(enum.Enum):
    NOT_SET, BOOL, INTEGER, DOUBLE, STRING, BYTE_ARRAY = range(6)
    BOOL_ARRAY, INTEGER_ARRAY, DOUBLE_ARRAY, STRING_ARRAY = range(6, 10)

    @classmethod
    def from_parameter_value(cls, value: Any) -> ParameterType:
        for kind, found in ((bool, cls.BOOL), (int, cls.INTEGER), (float, cls.DOUBLE)):
            if isinstance(value, kind):
                return found
        if isinstance(value, str):
            return cls.STRING
        assert isinstance(value, (list, tuple)), f"no parameter can be {value!r}"
        kinds = ((bytes, cls.BYTE_ARRAY), (bool, cls.BOOL_ARRAY), (int, cls.INTEGER_ARRAY))
        for kind, found in (*kinds, (float, cls.DOUBLE_ARRAY), (str, cls.STRING_ARRAY)):
            if all(isinstance(item, kind) for item in value):  # so an empty list is one of bytes
                return found
        raise TypeError(f"The given value is not a list of one of the allowed types '{value}'.")


class Parameter:
    def __init__(self, name: str, type_: Any = None, value: Any = None) -> None:
        self.name, self.value = name, value
        self.type_ = type_ or ParameterType.from_parameter_value(value)


# rclpy.callback_groups


class CallbackGroup:
    pass


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    pass


class ReentrantCallbackGroup(CallbackGroup):
    pass


# rclpy.logging

LEVELS = ("debug", "info", "warning", "error")


class Logger:
    """Remembers the level of each place in the code, and refuses another one there."""

    def __init__(self, graph: Any) -> None:
        self._graph, self._places = graph, dict[Any, str]()

    def _log(self, level: str, message: str) -> bool:
        assert isinstance(message, str)
        frame = inspect.currentframe().f_back.f_back  # type: ignore[union-attr]
        place = (frame.f_code, frame.f_lasti)  # type: ignore[union-attr]
        if self._places.setdefault(place, level) != level:
            raise ValueError("Logger severity cannot be changed between calls.")
        self._graph.logged.append((level, message))
        return True

    def debug(self, message: str, **kwargs: Any) -> bool:
        return self._log("debug", message)

    def info(self, message: str, **kwargs: Any) -> bool:
        return self._log("info", message)

    def warning(self, message: str, **kwargs: Any) -> bool:
        return self._log("warning", message)

    def error(self, message: str, **kwargs: Any) -> bool:
        return self._log("error", message)
