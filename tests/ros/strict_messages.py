"""ROS 2 messages as rclpy has them: classes that check each field like rosidl's generated code.

rosidl's generated classes check types on assignment when ROS_PYTHON_CHECK_FIELDS=1 (before Jazzy:
always). Without the check, a wrong type is not refused but sent as garbage, so here all is checked.

Source: rosidl_generator_py, resource/_msg.py.em and _msg_check_fields.py.em (ros2/rosidl_python,
commits 3dbb584 and 275b8a0): which Python types a field takes, what it holds, and its default.
"""

from __future__ import annotations

import array
import collections
import math
from collections.abc import Sequence, Set
from functools import cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from hypermap.ros.typestore import typestore

# SPECIAL_NESTED_BASIC_TYPES of generate_py_impl.py: numbers that lie in array.array and numpy.
TYPE_CODES = {
    "float32": "f",
    "float64": "d",
    "int8": "b",
    "uint8": "B",
    "char": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
}
LIMITS = {"float32": 3.402823466e38, "float64": 1.7976931348623157e308}
DEFAULTS = {("geometry_msgs/msg/Quaternion", "w"): 1.0}  # Quaternion.msg

# Source: bond_core (branch ros2) and navigation2 (branch jazzy).
OF_NAV2 = {
    "bond/msg/Status": (
        "std_msgs/Header header\nstring id\nstring instance_id\nbool active\n"
        "float32 heartbeat_timeout\nfloat32 heartbeat_period"
    ),
    "nav2_msgs/msg/LoadMap_Request": "string map_url",
    "nav2_msgs/msg/LoadMap_Response": (
        "uint8 RESULT_SUCCESS=0\nuint8 RESULT_MAP_DOES_NOT_EXIST=1\n"
        "uint8 RESULT_INVALID_MAP_DATA=2\nuint8 RESULT_INVALID_MAP_METADATA=3\n"
        "uint8 RESULT_UNDEFINED_FAILURE=255\nnav_msgs/OccupancyGrid map\nuint8 result"
    ),
}


def humble_store() -> Typestore:
    """Return Humble's types, and of ours and nav2's those that it has not."""
    return _store(Stores.ROS2_HUMBLE)


def jazzy_store() -> Typestore:
    return _store(Stores.ROS2_JAZZY)


@cache
def _store(distribution: Stores) -> Typestore:
    store = get_typestore(distribution)
    ours = typestore().fielddefs
    store.register({name: ours[name] for name in ours.keys() - store.fielddefs.keys()})
    for name, text in OF_NAV2.items():
        store.register(get_types_from_msg(text, name))
    return store


class StrictTypes:
    """The strict classes of a distribution's types, named as "nav_msgs/OccupancyGrid"."""

    def __init__(self, store: Typestore) -> None:
        self.store = store
        self.get = cache(self._make)

    def message(self, type_name: str) -> type[Any]:
        return self.get(type_name.replace("/", "/msg/"))

    def service(self, type_name: str) -> type[Any]:
        """Return a class with the halves `Request` and `Response`, as of "nav_msgs/GetMap"."""
        halves = {half: self.message(f"{type_name}_{half}") for half in ("Request", "Response")}
        return type(type_name.partition("/")[2], (), halves)

    def _make(self, name: str) -> type[Any]:
        constants, fields = self.store.fielddefs[name]
        fields = [field for field in fields if field[0] != "structure_needs_at_least_one_member"]
        members: dict[str, Any] = {
            "__slots__": tuple(f"_{field}" for field, _ in fields),
            "TYPES": self,
            "TYPE_NAME": name,
            "FIELDS": dict(fields),
            "__init__": _init,
            "__eq__": _eq,
            "__hash__": None,
        }
        for constant, kind, value in constants:
            members[constant] = bytes([value]) if kind in ("byte", "octet") else value
        for field, kind in fields:
            members[field] = _property(self, field, kind)
        return type(name.rpartition("/")[2], (), members)

    def checked(self, kind: Any, value: Any, field: str) -> Any:
        """Return what a field holds after an assignment, or refuse it."""
        node, rest = kind
        if node == Nodetype.NAME:
            assert isinstance(value, self.get(rest)), f"{field} must be a {rest}, got {value!r}"
            return value
        if node == Nodetype.BASE:
            return _scalar(rest[0], value, field)
        inner, count = rest
        code = TYPE_CODES.get(inner[1][0]) if inner[0] == Nodetype.BASE else None
        is_fixed = node == Nodetype.ARRAY
        if code and not is_fixed and isinstance(value, array.array):
            assert value.typecode == code, (
                f"{field} must have type code {code}, got {value.typecode}"
            )
            return value
        if code and is_fixed and isinstance(value, np.ndarray):
            assert value.dtype == np.dtype(code), f"{field} must be of {code}, got {value.dtype}"
            assert value.size == count, f"{field} must have {count} numbers, got {value.size}"
            return value
        assert isinstance(value, (Sequence, Set)), f"{field} must be a sequence, got {type(value)}"
        assert not isinstance(value, (str, collections.UserString)), f"{field} must be a sequence"
        if is_fixed:
            assert len(value) == count, f"{field} must have {count} items, got {len(value)}"
        elif count:
            assert len(value) <= count, f"{field} may have {count} items, got {len(value)}"
        for item in value:
            self.checked(inner, item, f"{field}[]")
        if code:
            return np.array(value, np.dtype(code)) if is_fixed else array.array(code, value)
        return value

    def default(self, owner: str, field: str, kind: Any) -> Any:
        if (owner, field) in DEFAULTS:
            return DEFAULTS[owner, field]
        node, rest = kind
        if node == Nodetype.NAME:
            return self.get(rest)()
        if node == Nodetype.BASE:
            return _scalar_default(rest[0])
        inner, count = rest
        if node == Nodetype.SEQUENCE:
            return []
        return [self.default("", "", inner) for _ in range(count)]

    # On the wire

    def to_cdr(self, message: Any) -> bytes:
        """Check a message with all that is in it, as it is sent, and return its CDR."""
        return bytes(self.store.serialize_cdr(self._plain(message), message.TYPE_NAME))

    def from_cdr(self, data: bytes, name: str) -> Any:
        return self._strict(self.store.deserialize_cdr(data, name), name)

    def _plain(self, message: Any) -> Any:
        values = {
            field: self._plain_value(kind, self.checked(kind, getattr(message, field), field))
            for field, kind in message.FIELDS.items()
        }
        if not values and self.store.fielddefs[message.TYPE_NAME][1]:
            values["structure_needs_at_least_one_member"] = 0
        return self.store.types[message.TYPE_NAME](**values)

    def _plain_value(self, kind: Any, value: Any) -> Any:
        node, rest = kind
        if node == Nodetype.NAME:
            return self._plain(value)
        if node == Nodetype.BASE:
            return value[0] if rest[0] in ("byte", "octet") else value
        inner = rest[0]
        if isinstance(value, (array.array, np.ndarray)):
            return np.array(value)
        if inner == (Nodetype.BASE, ("bool", 0)):
            return np.array(value, bool)
        return [self._plain_value(inner, item) for item in value]

    def _strict(self, message: Any, name: str) -> Any:
        made = self.get(name)()
        for field, kind in made.FIELDS.items():
            setattr(made, field, self._strict_value(kind, getattr(message, field)))
        return made

    def _strict_value(self, kind: Any, value: Any) -> Any:
        node, rest = kind
        if node == Nodetype.NAME:
            return self._strict(value, rest)
        if node == Nodetype.BASE:
            return bytes([value]) if rest[0] in ("byte", "octet") else value
        inner = rest[0]
        code = TYPE_CODES.get(inner[1][0]) if inner[0] == Nodetype.BASE else None
        if code and node == Nodetype.SEQUENCE:
            return array.array(code, np.asarray(value, np.dtype(code)).tobytes())
        if isinstance(value, np.ndarray):
            return value if code else value.tolist()
        return [self._strict_value(inner, item) for item in value]


def _init(self: Any, **given: Any) -> None:
    unknown = given.keys() - self.FIELDS.keys()
    assert not unknown, f"Invalid arguments passed to constructor: {', '.join(sorted(unknown))}"
    for field, kind in self.FIELDS.items():
        value = given[field] if field in given else self.TYPES.default(self.TYPE_NAME, field, kind)
        node, rest = kind
        code = (
            TYPE_CODES.get(rest[0][1][0]) if node in (Nodetype.SEQUENCE, Nodetype.ARRAY) else None
        )
        if code and node == Nodetype.SEQUENCE:
            value = array.array(code, value)  # as the generated constructor does, so numpy may pass
        elif code:
            value = np.array(value, np.dtype(code))
        setattr(self, field, value)


def _eq(self: Any, other: Any) -> bool:
    return type(self) is type(other) and all(
        np.array_equal(getattr(self, field), getattr(other, field)) for field in self.FIELDS
    )


def _property(types: StrictTypes, field: str, kind: Any) -> property:
    def read(message: Any) -> Any:
        return getattr(message, f"_{field}")

    def write(message: Any, value: Any) -> None:
        object.__setattr__(message, f"_{field}", types.checked(kind, value, field))

    return property(read, write)


def _scalar(kind: str, value: Any, field: str) -> Any:
    got = f"{field} ({kind}) got {value!r} of {type(value).__name__}"
    if kind in ("string", "wstring"):
        assert isinstance(value, str), got
    elif kind == "bool":
        assert isinstance(value, bool), got
    elif kind in ("byte", "octet"):
        assert isinstance(value, (bytes, bytearray, memoryview)), got
        assert len(value) == 1, got
    elif kind in LIMITS:
        assert isinstance(value, float), got
        bound = LIMITS[kind]
        assert not (value < -bound or value > bound) or math.isinf(value), got
    else:
        assert isinstance(value, int), got
        limits = np.iinfo(np.dtype(TYPE_CODES[kind]))
        assert limits.min <= value <= limits.max, got
    return value


def _scalar_default(kind: str) -> Any:
    if kind in ("byte", "octet"):
        return bytes([0])
    return {"string": "", "wstring": "", "bool": False, "float32": 0.0, "float64": 0.0}.get(kind, 0)
