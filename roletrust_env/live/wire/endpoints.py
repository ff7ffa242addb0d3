"""Readers and writers of DDS whose messages are bytes, and whose types go by their names, as those of ROS 2 do."""

import ctypes
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from cyclonedds.core import Entity
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl_types
from cyclonedds.topic import Topic
from rosbags.interfaces import Nodetype

from roletrust_env.live.wire import messages

idl: Any = idl_types  # its generic types are built at run time, which type checkers cannot follow

_PLAIN = {"string": str, "bool": bool, "char": idl.uint8}
"""Types with another name in the middleware; a `char` of ROS 2 is a byte."""

_WORDS = 32  # of the middleware's description of a type that are searched
_one_at_a_time = threading.Lock()


def make_endpoint(make: type[Any], participant: Any, topic: str, kind: str, qos: Any) -> tuple[Any, type[Any]]:
    """Return a reader or writer of a topic, and the type of its messages.

    It announces the name of its type but not the definition, as ROS 2 on Cyclone DDS does. Fast DDS, the other
    middleware of ROS 2, asks for an announced definition, and never connects if the answer is lost on a busy machine.

    Args:
        make: `DataReader` or `DataWriter`.
        participant: Participant of the reader or writer.
        topic: Name of the topic in DDS.
        kind: Type of its messages, such as `std_msgs/msg/Float64`.
        qos: Quality of service.
    """
    carrier = _carrier(kind)
    with _one_at_a_time:  # topics share a description, and a new topic needs the definition
        described = Topic(participant, topic, carrier)
        with _without_definition(described, carrier):
            return make(participant, described, qos), carrier


class _Definition(ctypes.Structure):
    """A part of the middleware's description of a type; it begins with the type in Python."""

    _fields_ = (
        ("python_type", ctypes.c_void_p),
        ("keys", ctypes.c_bool * 3),
        ("information", ctypes.c_void_p),
        ("information_size", ctypes.c_uint32),
        ("mapping", ctypes.c_void_p),
        ("mapping_size", ctypes.c_uint32),
    )


@contextmanager
def _without_definition(topic: Any, carrier: type[Any]) -> Iterator[None]:
    """Hide the definition of a topic's type; the middleware has no setting for that."""
    description = ctypes.c_void_p()
    library: Any = Entity._dll_handle
    library.dds_get_entity_sertype(ctypes.c_int32(topic._ref), ctypes.byref(description))
    sizes = tuple(map(len, carrier.__idl__._xt_bytedata))
    found = None
    for place in range(_WORDS):
        part = _Definition.from_address((description.value or 0) + place * ctypes.sizeof(ctypes.c_void_p))
        if part.python_type == id(carrier) and (part.information_size, part.mapping_size) == sizes:
            found = part
            break
    if found is None:  # a version of the middleware with another description: the definition is announced
        yield
        return
    found.information_size = 0
    try:
        yield
    finally:
        found.information_size = sizes[0]


@cache
def _idl(kind: str) -> type[Any]:
    """Return the middleware's description of a type: its name and fields."""
    fields = {name: _field_type(*field) for name, field in messages.typestore().fielddefs[kind][1]}
    package, _, name = kind.split("/")
    return make_idl_struct(name, f"{package}.msg.dds_.{name}_", fields)


def _field_type(node: Nodetype, detail: Any) -> Any:
    """Return the middleware's type of a field."""
    if node == Nodetype.NAME:
        return _idl(detail)
    if node == Nodetype.BASE:
        name, bound = detail
        plain = _PLAIN.get(name) or getattr(idl, name)
        return idl.bounded_str[bound] if bound else plain
    item, count = detail
    if node == Nodetype.ARRAY:
        return idl.array[_field_type(*item), count]
    return idl.sequence[_field_type(*item), count] if count else idl.sequence[_field_type(*item)]


@cache
def _carrier(kind: str) -> type[Any]:
    """Return a type whose messages are bytes, so that the middleware does not convert them."""
    carrier = _idl(kind)

    def wrap(raw: bytes, **_: Any) -> Any:
        message = object.__new__(carrier)
        message.raw = bytes(raw)
        return message

    carrier.serialize = lambda message, **_: message.raw
    carrier.wrap = carrier.deserialize = carrier.deserialize_key = staticmethod(wrap)
    return carrier
