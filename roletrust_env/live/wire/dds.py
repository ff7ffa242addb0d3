"""DDS as ROS 2 uses it, without ROS 2: names, qualities of service, type hashes, and who has which topics.

Messages are bytes here (CDR, see `messages`), so that what is signed, sent and recorded is the same.
"""

import os
import re
import time
from collections import Counter
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import DDSException, InstanceState, Policy, Qos, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl_types
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.interfaces import Nodetype

from roletrust_env.live.wire import messages

_LOOPBACK = '<General><Interfaces><NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces></General>'

# Fast DDS, whose vendor is 1.15, says more of its types than Cyclone can match, and ROS 2 compares by name and hash.
_COMPATIBLE = "<Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility>"

_MILLISECOND = 1_000_000
_ANY = ViewState.Any | InstanceState.Any | SampleState.NotRead
_AT_ONCE = 1000  # messages that are taken in one go
_LAST_DOMAIN = 232  # beyond, there are no ports for it
_TOPIC = re.compile(r"rt(/[A-Za-z_][A-Za-z0-9_]*)+")  # as ROS 2 names them; others' names are not even valid here
_DISCOVERY = "rmw_dds_common/msg/ParticipantEntitiesInfo"

idl: Any = idl_types  # what stands in brackets there is made as the program runs

_PLAIN = {"string": str, "bool": bool, "char": idl.uint8}
"""Types that the middleware calls otherwise; a `char` of ROS 2 is a byte."""

_domains: dict[int, Domain] = {}


class Writer:
    """Publishes messages of one topic."""

    def __init__(self, writer: Any, carrier: type[Any]) -> None:
        self._writer, self._carrier = writer, carrier

    def write(self, message: Any) -> None:
        """Publish a message."""
        self.write_raw(messages.encode(message))

    def write_raw(self, raw: bytes) -> None:
        """Publish a message that is CDR already."""
        self._writer.write(self._carrier.wrap(raw))

    @property
    def guid(self) -> str:
        """By which it is known."""
        return str(self._writer.guid)

    @property
    def readers(self) -> int:
        """How many readers it has now."""
        return int(self._writer.get_publication_matched_status().current_count)


class Reader:
    """Hears messages of one topic.

    Attributes:
        cut_off: messages that were thrown away, since somebody sent too many.
    """

    def __init__(self, reader: Any, quota: "Quota | None" = None) -> None:
        self._reader, self._quota = reader, quota
        self.cut_off = 0

    def take(self) -> list[bytes]:
        """What came since the last time, as CDR, in order of arrival."""
        samples = [sample for sample in self._reader.take(_AT_ONCE) if not isinstance(sample, InvalidSample)]
        if self._quota is not None:
            now = time.monotonic()
            kept = [one for one in samples if self._quota.admits(one.sample_info.publication_handle, now)]
            self.cut_off += len(samples) - len(kept)
            samples = kept
        return [sample.raw for sample in samples]

    @property
    def writers(self) -> int:
        """How many writers it has now."""
        return int(self._reader.get_subscription_matched_status().current_count)


class Quota:
    """How many messages a writer may send; one that sends more is not heard until it sends fewer.

    Args:
        most: messages in a second.
    """

    def __init__(self, most: int) -> None:
        self._most, self._second = most, 0
        self._counts: Counter[int] = Counter()
        self._over: frozenset[int] = frozenset()

    def admits(self, writer: int, now: float) -> bool:
        """Whether a message is heard that comes from a writer at a time, seconds."""
        if int(now) != self._second:
            self._over = frozenset(one for one, count in self._counts.items() if count > self._most)
            self._second, self._counts = int(now), Counter()
        self._counts[writer] += 1
        return writer not in self._over and self._counts[writer] <= self._most


class Publication(NamedTuple):
    """A topic that somebody publishes, by its name in ROS 2, such as `/sr_0/ratings`, and its type."""

    topic: str
    kind: str


class Node:
    """A node of ROS 2: a participant of its own, that others see by its name.

    Args:
        name: such as `cam`.
        namespace: such as `/sp_0`, or `/`.
        network: whether it speaks to other machines; if not, to this one only. Where `CYCLONEDDS_URI` is set, what that
            says is what counts.

    The domain is that of `ROS_DOMAIN_ID`, 0 if it is not set.

    Raises:
        ValueError: one of these variables is not as it must be.
    """

    def __init__(self, name: str, namespace: str = "/", *, network: bool = False) -> None:
        self._participant = _participant(network)
        self._name, self._namespace = name, namespace
        self._found = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._waitset = WaitSet(self._participant)
        self._conditions: list[ReadCondition] = []
        self._attach(self._found)
        self._gids: dict[str, list[Any]] = {"reader": [], "writer": []}
        topic, carrier = self._topic("ros_discovery_info", _DISCOVERY)
        self._introduction = Writer(DataWriter(self._participant, topic, _ONCE), carrier)
        self._introduce()

    def writer(self, topic: str, kind: str, *, depth: int = 10) -> Writer:
        """A writer of a topic.

        Args:
            topic: its name in ROS 2.
            kind: its type, such as `std_msgs/msg/Float64`.
            depth: messages that are kept for a reader that is slow.
        """
        made, carrier = self._topic("rt" + topic, kind)
        writer = DataWriter(self._participant, made, _qos(kind, depth))
        self._gids["writer"].append(writer.guid)
        self._introduce()
        return Writer(writer, carrier)

    def reader(self, topic: str, kind: str, *, depth: int = 10, quota: Quota | None = None) -> Reader:
        """A reader of a topic, with a quota for each of its writers if one is given. Arguments as for `writer`."""
        made, _ = self._topic("rt" + topic, kind)
        reader = DataReader(self._participant, made, _qos(kind, depth))
        self._attach(reader)
        self._gids["reader"].append(reader.guid)
        self._introduce()
        return Reader(reader, quota)

    def wait(self, seconds: float) -> None:
        """Sleep until there is something to take or discover, or the time is over."""
        self._waitset.wait(max(0, int(seconds * 1000)) * _MILLISECOND)

    def writers_of(self, topic: str) -> list[str]:
        """All writers of a topic that are known now, also of this node, by their GUIDs; the least first."""
        known = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication).read(_AT_ONCE)
        return sorted(str(sample.key) for sample in known if sample.topic_name == "rt" + topic)

    def discover(self) -> list[Publication]:
        """What is published since the last time, also by this node, and by others a second time."""
        found = []
        for sample in self._found.take(_AT_ONCE):
            topic, kind = sample.topic_name, sample.type_name
            if topic is not None and _TOPIC.fullmatch(topic):  # of one that ended nothing is told
                parts = kind.replace("::dds_::", "::").removesuffix("_").split("::")
                found.append(Publication(topic.removeprefix("rt"), "/".join(parts)))
        return found

    def _topic(self, name: str, kind: str) -> tuple[Any, type[Any]]:
        carrier = _carrier(kind)
        return Topic(self._participant, name, carrier), carrier

    def _attach(self, reader: Any) -> None:
        self._conditions.append(ReadCondition(reader, _ANY))
        self._waitset.attach(self._conditions[-1])

    def _introduce(self) -> None:
        """Tell ROS 2 whose the topics are, so that `ros2 node list` has the node."""
        gids = {kind: [_gid(guid) for guid in guids] for kind, guids in self._gids.items()}
        node = messages.make(
            "rmw_dds_common/msg/NodeEntitiesInfo",
            node_namespace=self._namespace,
            node_name=self._name,
            reader_gid_seq=gids["reader"],
            writer_gid_seq=gids["writer"],
        )
        self._introduction.write(
            messages.make(_DISCOVERY, gid=_gid(self._participant.guid), node_entities_info_seq=[node])
        )


def _participant(network: bool) -> Any:
    """Who takes part in the domain; to this machine only, unless it is said otherwise."""
    said, uri = os.environ.get("ROS_DOMAIN_ID") or "0", os.environ.get("CYCLONEDDS_URI")
    if not (said.isascii() and said.isdecimal() and int(said) <= _LAST_DOMAIN):
        raise ValueError(f"ROS_DOMAIN_ID is {said!r}; it must be a whole number from 0 to {_LAST_DOMAIN}")
    domain = int(said)
    try:
        if domain not in _domains and not uri:
            inside = _COMPATIBLE + ("" if network else _LOOPBACK)
            _domains[domain] = Domain(domain, f"<CycloneDDS><Domain>{inside}</Domain></CycloneDDS>")
        return DomainParticipant(domain, Qos(Policy.Userdata(b"enclave=/;")))
    except DDSException as error:
        why = f"CYCLONEDDS_URI is {uri!r}: is it a configuration, or a file of one?" if uri else str(error)
        raise ValueError(f"the middleware cannot take part in ROS_DOMAIN_ID {domain}; {why}") from None


@cache
def _idl(kind: str) -> type[Any]:
    """What the middleware tells others of a type: its name and fields."""
    fields = {name: _field(*field) for name, field in messages.typestore().fielddefs[kind][1]}
    package, _, name = kind.split("/")
    return make_idl_struct(name, f"{package}.msg.dds_.{name}_", fields)


def _field(node: Nodetype, inside: Any) -> Any:
    """The middleware's type of a field."""
    if node == Nodetype.NAME:
        return _idl(inside)
    if node == Nodetype.BASE:
        name, bound = inside
        plain = _PLAIN.get(name) or getattr(idl, name)
        return idl.bounded_str[bound] if bound else plain
    item, count = inside
    if node == Nodetype.ARRAY:
        return idl.array[_field(*item), count]
    return idl.sequence[_field(*item), count] if count else idl.sequence[_field(*item)]


@cache
def _carrier(kind: str) -> type[Any]:
    """A type as the middleware knows it, but with messages that are bytes already."""
    carrier = _idl(kind)

    def wrap(raw: bytes, **_: Any) -> Any:
        message = object.__new__(carrier)
        message.raw = bytes(raw)
        return message

    carrier.serialize = lambda message, **_: message.raw
    carrier.wrap = carrier.deserialize = carrier.deserialize_key = staticmethod(wrap)
    return carrier


_QOS = Qos(Policy.DataRepresentation(use_cdrv0_representation=True))


_ONCE = Qos(Policy.Reliability.Reliable(0), Policy.Durability.TransientLocal, Policy.History.KeepLast(1), base=_QOS)
"""What is told to whoever comes later, too."""


def _qos(kind: str, depth: int) -> Qos:
    """ROS 2's default: reliable, volatile, the last few; and the hash of the type."""
    return Qos(
        Policy.Reliability.Reliable(100 * _MILLISECOND),
        Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.Userdata(f"typehash={messages.type_hash(kind)};".encode()),
        base=_QOS,
    )


def _gid(guid: Any) -> Any:
    return messages.make("rmw_dds_common/msg/Gid", data=np.frombuffer(guid.bytes, np.uint8))
