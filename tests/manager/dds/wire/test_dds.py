"""DDS nodes within one process: messages arrive unchanged."""

import os
import time
from types import SimpleNamespace

import pytest
from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.sub import DataReader
from domains import own_dds_domain
from fake_wire import FixedSigner
from process_load import memory_mb
from refusals import refuses

from roletrust_manager.dds.wire import dds, messages
from roletrust_manager.dds.wire.dds import _ONCE, Node, Publication, Quota, Reader, make_endpoint

PATIENCE_S = 120.0  # far more than a busy machine takes


@pytest.fixture(scope="module", autouse=True)
def _own_domain():
    with own_dds_domain():
        yield


def until(holds):
    """Call a function until its result is true, and return the result."""
    end = time.monotonic() + PATIENCE_S
    while not (found := holds()) and time.monotonic() < end:
        time.sleep(0.01)
    return found


@pytest.mark.parametrize(
    ("kind", "made"),
    [
        (messages.NUMBER, lambda: messages.make(messages.NUMBER, data=0.25)),
        (messages.IMAGE, lambda: messages.picture_message(5, "sp_0", bytes(range(250)) * 160)),
        (
            messages.RATINGS,
            lambda: messages.ratings_message("sr_0", 5, {"sp_0": 0.5}, FixedSigner(b"signed")),
        ),
    ],
)
def test_bytes_arrive_as_they_were_sent(kind, made):
    topic = f"/of_{kind.rpartition('/')[2].lower()}"
    speaks, hears = Node("speaks", "/a"), Node("hears", "/b")
    writer, reader = speaks.writer(topic, kind), hears.reader(topic, kind)
    assert until(lambda: writer.readers == 1 and reader.writers == 1)
    raw = messages.encode(made())
    for _ in range(5):
        writer.write_raw(raw)
    got = []
    assert until(lambda: got.extend(reader.take()) or len(got) == 5)
    padded = [one[: len(raw)] for one in got]  # the middleware pads to four bytes
    assert padded == [raw] * 5


def test_publications_are_discovered_by_their_names_in_ros():
    looks, speaks = Node("looks"), Node("assess", "/sr_7")
    writer, found = speaks.writer("/sr_7/ratings", messages.RATINGS), []
    wanted = "/sr_7/ratings", messages.RATINGS, str(speaks._participant.guid)
    assert until(lambda: found.extend(looks.discover()) or Publication(*wanted) in found)
    assert until(lambda: Publication(*wanted) in looks.publications())
    del writer
    assert until(lambda: Publication(*wanted) not in looks.publications())


@pytest.mark.parametrize("builtin", [BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription])
def test_types_are_announced_by_name_alone(builtin):
    """Fast DDS asks for a definition that is announced, and never connects if the answer is
    lost."""
    looks, speaks = Node("looks"), Node("speaks")
    announced = BuiltinDataReader(looks._participant, builtin)
    kinds = [messages.TRUST, messages.RATINGS, messages.RATINGS]
    made = [speaks.writer(f"/by_name_{k}", kind) for k, kind in enumerate(kinds)]
    made += [speaks.reader(f"/by_name_{k}", kind) for k, kind in enumerate(kinds)]
    found = {}

    def complete():
        found.update({one.topic_name: one.type_id for one in announced.take(100) if one.topic_name})
        return {f"rt/by_name_{k}" for k in range(3)} <= found.keys()

    assert until(complete)
    assert {name: found[name] for name in found if found[name]} == {}


def test_waiting_ends_when_a_message_arrives():
    speaks, hears = Node("speaks", "/c"), Node("hears", "/d")
    writer, reader = (
        speaks.writer("/wakes", messages.NUMBER),
        hears.reader("/wakes", messages.NUMBER),
    )
    assert until(lambda: writer.readers == 1 and reader.writers == 1)
    hears.discover()
    writer.write(messages.make(messages.NUMBER, data=1.0))
    began = time.monotonic()
    hears.wait(PATIENCE_S)
    assert time.monotonic() - began < PATIENCE_S
    assert until(reader.take)


def test_nodes_announce_their_topics():
    looks, cam = Node("looks"), Node("cam", "/sp_7")
    kind = "rmw_dds_common/msg/ParticipantEntitiesInfo"
    reader = Reader(
        make_endpoint(DataReader, looks._participant, "ros_discovery_info", kind, _ONCE)[0]
    )
    cam.writer("/sp_7/image_raw/compressed", messages.IMAGE)
    nodes = []

    def complete():
        for raw in reader.take():
            nodes.extend(messages.decode(raw, kind).node_entities_info_seq)
        return any(
            node.node_namespace == "/sp_7" and len(node.writer_gid_seq) == 1 for node in nodes
        )

    assert until(complete)


@pytest.mark.parametrize(
    ("name", "said", "words"),
    [
        (
            "ROS_DOMAIN_ID",
            "seven",
            ("ROS_DOMAIN_ID", "seven"),
        ),
        ("ROS_DOMAIN_ID", "233", ("ROS_DOMAIN_ID", "233")),
        ("ROS_DOMAIN_ID", "-1", ("ROS_DOMAIN_ID", "-1")),
        ("CYCLONEDDS_URI", "file:///nowhere.xml", ("CYCLONEDDS_URI", "file:///nowhere.xml")),
    ],
)
def test_invalid_variables_are_named(name, said, words, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "99")  # a domain that this process has not joined
    monkeypatch.setenv(name, said)
    with refuses(ValueError, name, *words):
        Node("looks")


def test_an_empty_variable_does_not_open_the_network(monkeypatch):
    began = []
    monkeypatch.setattr(dds, "Domain", lambda domain, configuration: began.append(configuration))
    monkeypatch.setattr(dds, "_domains", {})
    monkeypatch.setattr(dds, "DomainParticipant", lambda *_: None)
    monkeypatch.setenv("CYCLONEDDS_URI", "")
    dds._participant(network=False)
    assert "127.0.0.1" in began[0]


@pytest.mark.parametrize(
    "topic", ["rt/a b/ratings", "rt/\x1b[31m/ratings", "rt//ratings", "rt/<b>/ratings", "rt/7/x"]
)
def test_topic_names_that_ros_does_not_allow_are_ignored(topic, monkeypatch):
    looks = Node("looks")
    samples = {"type_name": "a::msg::dds_::B_", "participant_key": 7}
    found = [
        SimpleNamespace(topic_name=name, key=name, **samples) for name in (topic, "rt/sr_0/ratings")
    ]
    monkeypatch.setattr(looks, "_builtin_reader", SimpleNamespace(take=lambda _: found))
    assert looks.discover() == [Publication("/sr_0/ratings", "a/msg/B", "7")]


def test_looking_for_writers_again_and_again_takes_no_memory():
    """A manager does it once a second. 200 looks took 15 MB when each had a reader of its own."""
    node = Node("looks")
    writers = [node.writer(f"/sr_{k}/tor", messages.NUMBER) for k in range(30)]
    assert until(lambda: len(node.publications()) >= len(writers))
    before = memory_mb(os.getpid())
    for _ in range(200):
        assert len(node.writers_of("/sr_7/tor")) == 1
        assert len(node.publications()) >= len(writers)
    assert memory_mb(os.getpid()) - before < 1


def test_a_writer_over_its_quota_is_blocked_until_it_sends_fewer():
    quota = Quota(3)
    assert [quota.allows(1, 0.2) for _ in range(3)] == [True] * 3  # as many as allowed
    assert all(quota.allows(1, 1.0) for _ in range(3))
    assert not quota.allows(1, 1.9)  # the fourth
    assert quota.allows(2, 1.9)  # of another writer
    assert [quota.allows(1, 2.0) for _ in range(3)] == [False] * 3  # blocked for the next second
    assert quota.allows(1, 3.0)  # forgiven, since it sent no more than allowed
    assert [quota.allows(1, 3.5) for _ in range(3)] == [True, True, False]
    assert not quota.allows(1, 4.0)
    assert quota.allows(1, 5.0)


def test_a_pause_of_the_reader_is_no_flood_of_the_writer():
    quota = Quota(3)
    assert [quota.allows(1, 9.0, 4.0) for _ in range(13)] == [True] * 12 + [False]
    assert [quota.allows(2, 9.5, 0.5) for _ in range(12)] == [True] * 12
    assert not quota.allows(1, 10.0, 0.5)
    assert [quota.allows(2, 10.0, 0.5) for _ in range(4)] == [True] * 3 + [False]


def test_messages_over_the_quota_are_counted():
    samples = [
        SimpleNamespace(raw=bytes([k]), sample_info=SimpleNamespace(publication_handle=k % 2))
        for k in range(10)
    ]
    reader = Reader(SimpleNamespace(take=lambda _: samples), Quota(2))
    assert reader.take() == [bytes([k]) for k in range(4)]
    assert reader.excess == 6


def test_dropped_readers_leave_nothing_behind():
    node, speaks = Node("hears"), Node("speaks")
    writer = speaks.writer("/kept", messages.NUMBER)
    kept = node.reader("/kept", messages.NUMBER)
    before = len(node._participant.children)
    for k in range(30):
        node.drop(node.reader(f"/gone_{k}", messages.NUMBER))
    assert len(node._participant.children) == before
    assert len(node._conditions) == len(node._waitset.attached) == 2
    assert len(node._gids["reader"]) == 1
    assert until(lambda: writer.readers == 1 and kept.writers == 1)
    writer.write(messages.make(messages.NUMBER, data=1.0))
    assert until(kept.take)
