"""DDS as ROS 2 uses it, without ROS 2: names, qualities of service, type hashes and discovery.

Messages are bytes here (CDR, see `messages`), so the bytes that are signed, sent and recorded are
the same.
"""

import ctypes
import os
import re
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import (
    DDSException,
    Entity,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl_types
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.interfaces import Nodetype

from roletrust_env.parameters import truth_value
from roletrust_manager.dds.wire import messages

_LOOPBACK = (
    '<General><Interfaces><NetworkInterface address="127.0.0.1" '
    'multicast="true"/></Interfaces></General>'
)

# Fast DDS (vendor 1.15) sends type information that Cyclone DDS cannot match; ROS 2 compares names
# and hashes only.
_COMPATIBLE = "<Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility>"

_MILLISECOND = 1_000_000
_LONGEST_PAUSE_S = 30.0  # of this process, after which it still takes all that has waited
_ANY = ViewState.Any | InstanceState.Any | SampleState.NotRead
_AT_ONCE = 1000  # messages in one read
_LAST_DOMAIN = 232  # DDS has no ports for higher numbers
_TOPIC = re.compile(r"rt(/[A-Za-z_][A-Za-z0-9_]*)+")  # names that ROS 2 allows; others are ignored
_DISCOVERY = "rmw_dds_common/msg/ParticipantEntitiesInfo"

_domains: dict[int, Domain] = {}
idl: Any = idl_types  # its generic types are built at run time, which type checkers cannot follow

_PLAIN = {"string": str, "bool": bool, "char": idl.uint8}
"""Types with another name in the middleware; a `char` of ROS 2 is a byte."""

_WORDS = 32  # of the middleware's description of a type that are searched
_one_at_a_time = threading.Lock()


class TopicWriter:
    """Publishes messages on one topic."""

    def __init__(self, writer: Any, carrier: type[Any]) -> None:
        self._writer, self._carrier = writer, carrier

    def write(self, message: Any) -> None:
        """Publish a message."""
        self.write_raw(messages.encode(message))

    def write_raw(self, raw: bytes) -> None:
        """Publish a message given as CDR."""
        self._writer.write(self._carrier.wrap(raw))

    @property
    def guid(self) -> str:
        """Unique identifier of the writer."""
        return str(self._writer.guid)

    @property
    def readers(self) -> int:
        """Number of readers at the moment."""
        return int(self._writer.get_publication_matched_status().current_count)


class Reader:
    """Receives messages of one topic.

    Attributes:
        excess: Number of messages discarded because a writer sent too many.
    """

    def __init__(self, reader: Any, quota: "Quota | None" = None) -> None:
        self._reader, self._quota = reader, quota
        self._taken_s, self.excess = time.monotonic(), 0

    def take(self) -> list[bytes]:
        """Return the messages since the last call as CDR, in order of arrival."""
        samples = [
            sample
            for sample in self._reader.take(_AT_ONCE)
            if not isinstance(sample, InvalidSample)
        ]
        if self._quota is not None:
            now = time.monotonic()
            pause, self._taken_s = now - self._taken_s, now
            within = [
                received
                for received in samples
                if self._quota.allows(received.sample_info.publication_handle, now, pause)
            ]
            self.excess += len(samples) - len(within)
            samples = within
        return [sample.raw for sample in samples]

    def detach(self) -> Any:
        """Return the middleware's reader, see `Node.drop`; this one has no messages from now on."""
        reader, self._reader = self._reader, None
        return reader

    @property
    def writers(self) -> int:
        """Number of writers at the moment."""
        return int(self._reader.get_subscription_matched_status().current_count)


class Quota:
    """Limits the messages of each writer. A writer that sends more is blocked until it sends fewer.

    Args:
        limit: Number of messages in a second.
    """

    def __init__(self, limit: int) -> None:
        self._limit, self._second, self._allowed = limit, 0, limit
        self._counts: Counter[int] = Counter()
        self._blocked: frozenset[int] = frozenset()

    def allows(self, writer: int, now: float, pause: float = 0.0) -> bool:
        """Return whether a writer's message is within the limit.

        Args:
            writer: Handle of the writer.
            now: Time, seconds.
            pause: Time since messages were taken before, seconds. What has waited meanwhile came in
                as much time.
        """
        if int(now) != self._second:
            self._blocked = frozenset(
                sender for sender, count in self._counts.items() if count > self._allowed
            )
            self._second, self._counts = int(now), Counter()
            self._allowed = int(self._limit * max(1.0, min(pause, _LONGEST_PAUSE_S)))
        self._counts[writer] += 1
        return writer not in self._blocked and self._counts[writer] <= self._allowed


class Publication(NamedTuple):
    """A published topic.

    Attributes:
        topic: Name of the topic in ROS 2, such as `/sr_0/ratings`.
        kind: Type of its messages.
        participant: Identifier of the process that publishes it.
    """

    topic: str
    kind: str
    participant: str = ""


class Node:
    """A node of ROS 2: a DDS participant that other nodes see by its name.

    The domain is that of `ROS_DOMAIN_ID`, or 0 if it is not set.

    Args:
        name: Name of the node, such as `cam`.
        namespace: Namespace of the node, such as `/sp_0`, or `/`.
        network: Whether to communicate with other machines, or with this one only. Ignored if
            `CYCLONEDDS_URI` is set.

    Raises:
        ValueError: `network` is no truth value, or `ROS_DOMAIN_ID` or `CYCLONEDDS_URI` is invalid.
    """

    def __init__(self, name: str, namespace: str = "/", *, network: bool = False) -> None:
        self._participant = _participant(truth_value("network", network))
        self._name, self._namespace = name, namespace
        self._builtin_reader = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._known: dict[
            str, Publication
        ] = {}  # publications at the moment, by the GUIDs of their writers
        self._new: list[Publication] = []  # those that `discover` has not returned yet
        self._waitset = WaitSet(self._participant)
        self._conditions: dict[str, ReadCondition] = {}
        self._attach(self._builtin_reader)
        self._gids: dict[str, list[Any]] = {"reader": [], "writer": []}
        self._announcement = TopicWriter(
            *make_endpoint(DataWriter, self._participant, "ros_discovery_info", _DISCOVERY, _ONCE)
        )
        self._announce()

    def writer(self, topic: str, kind: str) -> TopicWriter:
        """Return a writer of a topic.

        Args:
            topic: Name of the topic in ROS 2.
            kind: Type of its messages, such as `std_msgs/msg/Float64`.
        """
        writer, carrier = make_endpoint(
            DataWriter, self._participant, "rt" + topic, kind, _qos(kind)
        )
        self._gids["writer"].append(writer.guid)
        self._announce()
        return TopicWriter(writer, carrier)

    def reader(
        self, topic: str, kind: str, *, depth: int = 10, quota: Quota | None = None
    ) -> Reader:
        """Return a reader of a topic. Take its messages often: `wait` does not sleep while some are
        left.

        Args:
            topic: Name of the topic in ROS 2.
            kind: Type of its messages.
            depth: Number of messages that are stored until `Reader.take` is called.
            quota: Limit on the messages of each writer; None for no limit.
        """
        reader, _ = make_endpoint(
            DataReader, self._participant, "rt" + topic, kind, _qos(kind, depth)
        )
        self._attach(reader)
        self._gids["reader"].append(reader.guid)
        self._announce()
        return Reader(reader, quota)

    def drop(self, reader: Reader) -> None:
        """Stop reading a topic and free the memory of the reader."""
        old = reader.detach()
        self._waitset.detach(self._conditions[str(old.guid)])
        del self._conditions[str(old.guid)]
        self._gids["reader"].remove(old.guid)
        self._announce()

    def wait(self, seconds: float) -> None:
        """Sleep until a message or a publication arrives, but no longer than the given time."""
        self._waitset.wait(max(0, int(seconds * 1000)) * _MILLISECOND)

    def writers_of(self, topic: str) -> list[str]:
        """Return the GUIDs of all known writers of a topic, including those of this node, in
        ascending order.
        """
        self._update()
        return sorted(
            guid for guid, publication in self._known.items() if publication.topic == topic
        )

    def discover(self) -> list[Publication]:
        """Return the publications since the last call, including those of this node; a topic may be
        listed again.
        """
        self._update()
        new, self._new = self._new, []
        return new

    def publications(self) -> list[Publication]:
        """Return the publications at the moment, including those of this node."""
        self._update()
        return list(self._known.values())

    def _update(self) -> None:
        """Note the publications that began or ended. The middleware never frees a reader of them,
        so there is one.
        """
        for sample in self._builtin_reader.take(_AT_ONCE):
            if sample.topic_name is None:
                self._known.pop(str(sample.key), None)
            elif publication := _publication(sample):
                self._known[str(sample.key)] = publication
                self._new.append(publication)

    def _attach(self, reader: Any) -> None:
        condition = self._conditions[str(reader.guid)] = ReadCondition(reader, _ANY)
        self._waitset.attach(condition)

    def _announce(self) -> None:
        """Announce the node and its topics to ROS 2, so that `ros2 node list` shows it."""
        gids = {kind: [_gid(guid) for guid in guids] for kind, guids in self._gids.items()}
        node = messages.make(
            "rmw_dds_common/msg/NodeEntitiesInfo",
            node_namespace=self._namespace,
            node_name=self._name,
            reader_gid_seq=gids["reader"],
            writer_gid_seq=gids["writer"],
        )
        self._announcement.write(
            messages.make(
                _DISCOVERY, gid=_gid(self._participant.guid), node_entities_info_seq=[node]
            )
        )


def _publication(sample: Any) -> Publication | None:
    """Return the publication that a sample of discovery announces; None if ROS 2 allows no topic of
    that name.
    """
    if not _TOPIC.fullmatch(sample.topic_name):
        return None
    parts = sample.type_name.replace("::dds_::", "::").removesuffix("_").split("::")
    return Publication(
        sample.topic_name.removeprefix("rt"), "/".join(parts), str(sample.participant_key)
    )


def _participant(network: bool) -> Any:
    """Return a DDS participant, on this machine only unless the network is allowed."""
    number, uri = os.environ.get("ROS_DOMAIN_ID") or "0", os.environ.get("CYCLONEDDS_URI")
    if not (number.isascii() and number.isdecimal() and int(number) <= _LAST_DOMAIN):
        raise ValueError(
            f"ROS_DOMAIN_ID is {number!r}; it must be a whole number from 0 to {_LAST_DOMAIN}"
        )
    domain = int(number)
    try:
        if domain not in _domains and not uri:
            settings = _COMPATIBLE + ("" if network else _LOOPBACK)
            _domains[domain] = Domain(
                domain, f"<CycloneDDS><Domain>{settings}</Domain></CycloneDDS>"
            )
        return DomainParticipant(domain, Qos(Policy.Userdata(b"enclave=/;")))
    except DDSException as error:
        why = (
            f"CYCLONEDDS_URI is {uri!r}: it must be a configuration of Cyclone DDS, or the file of "
            "one"
            if uri
            else str(error)
        )
        raise ValueError(f"the middleware cannot join ROS_DOMAIN_ID {domain}; {why}") from None


_QOS = Qos(Policy.DataRepresentation(use_cdrv0_representation=True))

_ONCE = Qos(
    Policy.Reliability.Reliable(0),
    Policy.Durability.TransientLocal,
    Policy.History.KeepLast(1),
    base=_QOS,
)
"""Quality of service of messages that later readers receive as well."""


def _qos(kind: str, depth: int = 10) -> Qos:
    """Return ROS 2's default quality of service (reliable, volatile, a short history) with the hash
    of the type.
    """
    return Qos(
        Policy.Reliability.Reliable(100 * _MILLISECOND),
        Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.Userdata(f"typehash={messages.type_hash(kind)};".encode()),
        base=_QOS,
    )


def _gid(guid: Any) -> Any:
    return messages.make("rmw_dds_common/msg/Gid", data=np.frombuffer(guid.bytes, np.uint8))


def make_endpoint(
    make: type[Any], participant: Any, topic: str, kind: str, qos: Any
) -> tuple[Any, type[Any]]:
    """Return a reader or writer of a topic, and the type of its messages.

    It announces the name of its type but not the definition, as ROS 2 on Cyclone DDS does. Fast
    DDS, the other middleware of ROS 2, asks for an announced definition, and never connects if the
    answer is lost on a busy machine.

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
    type_part = None
    for place in range(_WORDS):
        part = _Definition.from_address(
            (description.value or 0) + place * ctypes.sizeof(ctypes.c_void_p)
        )
        if part.python_type == id(carrier) and (part.information_size, part.mapping_size) == sizes:
            type_part = part
            break
    if (
        type_part is None
    ):  # a version of the middleware with another description: the definition is announced
        yield
        return
    type_part.information_size = 0
    try:
        yield
    finally:
        type_part.information_size = sizes[0]


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
