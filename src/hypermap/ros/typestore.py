"""The message and service types of our nodes without any ROS: ROS 2's, made by rosbags.

The classes behave like those of rospy and rclpy: every field has ROS's default, so a message is
made by `cls()` or `cls(field=value)` and filled by assignment. A service is a pair of messages.
"""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.recordings.bag.definitions import DETECTION_TYPES
from hypermap.ros.definitions import PACKAGE, package_folder

# Source: common_interfaces, nav2_msgs, grid_map_msgs and rtabmap_msgs of ROS 2 Jazzy; map_msgs 2.4.
_MESSAGES = {
    "map_msgs/msg/OccupancyGridUpdate": (
        "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data"
    ),
    "grid_map_msgs/msg/GridMapInfo": (
        "float64 resolution\nfloat64 length_x\nfloat64 length_y\ngeometry_msgs/Pose pose"
    ),
    "grid_map_msgs/msg/GridMap": (
        "std_msgs/Header header\ngrid_map_msgs/GridMapInfo info\nstring[] layers\n"
        "string[] basic_layers\nstd_msgs/Float32MultiArray[] data\n"
        "uint16 outer_start_index\nuint16 inner_start_index"
    ),
    "rtabmap_msgs/msg/Link": (
        "int32 from_id\nint32 to_id\nint32 type\ngeometry_msgs/Transform transform\n"
        "float64[36] information"
    ),
    "rtabmap_msgs/msg/MapGraph": (
        "std_msgs/Header header\ngeometry_msgs/Transform map_to_odom\nint32[] poses_id\n"
        "geometry_msgs/Pose[] poses\nrtabmap_msgs/Link[] links"
    ),
    "nav2_msgs/msg/CostmapFilterInfo": (
        "std_msgs/Header header\nuint8 type\nstring filter_mask_topic\n"
        "float32 base\nfloat32 multiplier"
    ),
}
_SERVICES = {
    "nav_msgs/GetMap": "---\nnav_msgs/OccupancyGrid map",
    "nav_msgs/GetPlan": (
        "geometry_msgs/PoseStamped start\ngeometry_msgs/PoseStamped goal\nfloat32 tolerance\n"
        "---\nnav_msgs/Path plan"
    ),
    "std_srvs/Empty": "---",
    "std_srvs/SetBool": "bool data\n---\nbool success\nstring message",
    "std_srvs/Trigger": "---\nbool success\nstring message",
}
_FILLER = "structure_needs_at_least_one_member"  # what ROS 2 sends for a message without fields
_DEFAULTS: dict[tuple[str, str], Any] = {("geometry_msgs/msg/Quaternion", "w"): 1.0}
_SCALARS = {"string": str, "wstring": str, "bool": bool, "float32": float, "float64": float}
_DTYPES = {"bool": "?", "byte": "u1", "char": "u1", "octet": "u1"}


# Two threads that need a type for the first time would make it twice, and mix up both.
_MAKING = threading.RLock()


def typestore() -> Typestore:
    """Return the types, named as "nav_msgs/msg/GetMap_Request"."""
    with _MAKING:
        return _typestore()


@cache
def _typestore() -> Typestore:
    store = get_typestore(Stores.ROS2_JAZZY)
    texts = {**DETECTION_TYPES, **_MESSAGES}
    services = dict(_SERVICES)
    for file in sorted(package_folder().glob("msg/*.msg")):
        texts[f"{PACKAGE}/msg/{file.stem}"] = file.read_text()
    for file in sorted(package_folder().glob("srv/*.srv")):
        services[f"{PACKAGE}/{file.stem}"] = file.read_text()
    for name, text in services.items():
        halves = text.split("---\n") if "---\n" in text else text.split("---")
        for half, suffix in zip(halves, ("_Request", "_Response"), strict=True):
            texts[f"{name.replace('/', '/msg/')}{suffix}"] = half
    types: dict[str, Any] = {}
    for name, text in texts.items():
        types |= get_types_from_msg(text, name)
    store.register(types)
    return store


def message_class(type_name: str) -> type[Any]:
    """Return the class of a message, as of "nav_msgs/OccupancyGrid".

    Raises:
        HypermapError: If the type is unknown.

    >>> message_class("geometry_msgs/PointStamped")(header=message_class("std_msgs/Header")()).point
    Point(x=0.0, y=0.0, z=0.0)
    """
    package, _, name = type_name.replace("/msg/", "/").partition("/")
    return _class(f"{package}/msg/{name}")


def request_class(type_name: str) -> type[Any]:
    """Return the class of a service's request, as of "nav_msgs/GetMap"; raises as above."""
    return message_class(f"{type_name.replace('/srv/', '/')}_Request")


def response_class(type_name: str) -> type[Any]:
    """Return the class of a service's response, as of "nav_msgs/GetMap"; raises as above."""
    return message_class(f"{type_name.replace('/srv/', '/')}_Response")


def stamp(nanoseconds: int) -> Any:
    """Return a time as messages carry it."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return message_class("builtin_interfaces/Time")(sec=seconds, nanosec=rest)


def encode(message: Any) -> bytes:
    """Return a message as CDR, byte for byte as ROS 2 sends it.

    Arrays of numbers may be numpy arrays, lists, `array.array` or bytes.

    Raises:
        HypermapError: If a field holds what its type cannot.
    """
    name = message.__msgtype__
    try:
        _make_arrays(message, name)
        return bytes(typestore().serialize_cdr(message, name))
    except (SerdeError, ValueError, TypeError, AttributeError, OverflowError) as error:
        raise HypermapError(f"this is not a valid {name}: {error}") from error
    except Exception as error:  # struct.error has no better base
        if type(error).__module__ != "struct":
            raise
        raise HypermapError(f"this is not a valid {name}: {error}") from error


def decode(data: bytes, cls: type[Any]) -> Any:
    """Return the message that CDR holds.

    Raises:
        HypermapError: If the bytes are no message of that class.
    """
    name: str = cls.__msgtype__
    if not _fields(name):
        return cls()
    try:
        return typestore().deserialize_cdr(data, name)
    except (SerdeError, IndexError, AssertionError) as error:
        raise HypermapError(f"these {len(data)} bytes are not a valid {name}: {error}") from None


def definition(cls: type[Any]) -> str:
    """Return the full text of a type and of all types within it, as a `ros2msg` schema."""
    return typestore().generate_msgdef(cls.__msgtype__, ros_version=2)[0]


class _Message:
    """What all messages can do; fields and constants come with the type."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(
            np.array_equal(getattr(self, field.name), getattr(other, field.name))
            for field in dataclasses.fields(self)  # type: ignore[arg-type]
        )

    __hash__ = None  # type: ignore[assignment]


def _class(name: str) -> type[Any]:
    """Return the class of a type, instead of the one of rosbags, which has no defaults."""
    with _MAKING:
        return _made_class(name)


@cache
def _made_class(name: str) -> type[Any]:
    store = typestore()
    if name not in store.types:
        known = [other.replace("/msg/", "/") for other in store.types]
        short = name.replace("/msg/", "/")
        raise HypermapError(f"the type {short!r} is unknown; {did_you_mean(short, known)}")
    constants, kinds = store.fielddefs[name]
    fields = [
        (field, Any, dataclasses.field(default_factory=_default(name, field, kind)))
        for field, kind in kinds
    ]
    found = dataclasses.make_dataclass(
        name.rpartition("/")[2],
        fields,
        bases=(_Message,),
        namespace={"__msgtype__": name, **{key: value for key, _, value in constants}},
        eq=False,
        slots=True,
    )
    store.types[name] = found
    return found


def _fields(name: str) -> Sequence[tuple[str, Any]]:
    """Return names and kinds of a type's fields, without the filler of an empty one."""
    fields = typestore().fielddefs[name][1]
    return () if [field for field, _ in fields] == [_FILLER] else fields


def _default(owner: str, field: str, kind: Any) -> Callable[[], Any]:
    """Return what makes a field's default."""
    if (owner, field) in _DEFAULTS:
        value = _DEFAULTS[owner, field]
        return lambda: value
    node, rest = kind
    if node == Nodetype.NAME:
        return _class(rest)
    if node == Nodetype.BASE:
        return _SCALARS.get(rest[0], int)
    inner, count = rest
    one = _default("", "", inner)  # so that what is decoded is of our classes, all the way down
    if node == Nodetype.SEQUENCE:
        return list
    dtype = _dtype(inner)
    if dtype is not None:
        return lambda: np.zeros(count, dtype)
    return lambda: [one() for _ in range(count)]


def _dtype(kind: Any) -> str | None:
    """Return the numpy type of a number; None for texts and messages."""
    node, rest = kind
    if node != Nodetype.BASE or rest[0] in ("string", "wstring"):
        return None
    kind_name: str = rest[0]
    return _DTYPES.get(kind_name, kind_name)


@cache
def _array_fields(name: str) -> list[tuple[str, str | None, str | None]]:
    """Return the fields that are or hold arrays of numbers.

    Each with the numpy type of the array, or else the type of the messages that hold one.
    """
    found: list[tuple[str, str | None, str | None]] = []
    for field, kind in _fields(name):
        node, rest = kind
        inner = kind if node in (Nodetype.BASE, Nodetype.NAME) else rest[0]
        if inner is not kind and _dtype(inner) is not None:
            found.append((field, _dtype(inner), None))
        elif inner[0] == Nodetype.NAME and _array_fields(inner[1]):
            found.append((field, None, inner[1]))
    return found


def _make_arrays(message: Any, name: str) -> None:
    """Turn what stands for an array of numbers into one, as rosbags needs it."""
    for field, dtype, inner in _array_fields(name):
        value = getattr(message, field)
        if dtype is not None:
            setattr(message, field, _array(value, dtype))
        elif inner is not None:
            for item in value if isinstance(value, (list, tuple)) else (value,):
                _make_arrays(item, inner)


def _array(value: Any, dtype: str) -> np.ndarray[Any, Any]:
    if isinstance(value, (bytes, bytearray, memoryview)):
        return np.frombuffer(value, dtype)
    return np.ascontiguousarray(value, dtype).ravel()
