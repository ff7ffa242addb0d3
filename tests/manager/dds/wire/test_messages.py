from contextlib import suppress

import numpy as np
import pytest
from fake_wire import FixedSigner
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from roletrust_manager.dds.wire import messages
from roletrust_manager.journal.lines import JournalEntry
from roletrust_manager.team import Team, Trust

NAMES = st.from_regex(r"[a-z_0-9]{1,12}", fullmatch=True)


@pytest.mark.parametrize("stamp", [2**31 * 10**9, -(2**31) * 10**9 - 1, 10**30])
def test_a_time_that_is_no_stamp_of_ros_is_an_error_of_one_line(stamp):
    with refuses(ValueError, "2038-01-19"):
        messages.ratings_message("sr_0", stamp, {})


@given(
    NAMES,
    st.integers(0, 2**31 * 10**9 - 1),
    st.dictionaries(NAMES, st.floats(width=64)),
    st.binary(max_size=64),
)
def test_ratings_come_back_as_they_were(rater, stamp, ratings, signature):
    raw = messages.encode(messages.ratings_message(rater, stamp, ratings, FixedSigner(signature)))
    read = messages.read_ratings_message(raw)
    unsigned = messages.encode(messages.ratings_message(rater, stamp, ratings))
    assert read.envelope == (rater, stamp, unsigned, signature, "")
    assert list(read.providers) == list(ratings)
    np.testing.assert_array_equal(read.values, list(ratings.values()))
    assert messages.signed_message(read.envelope) == raw


@given(st.binary(max_size=200))
def test_invalid_bytes_raise_a_value_error(raw):
    try:
        messages.read_ratings_message(raw)
    except ValueError:
        return
    assert raw[:2] in (b"\x00\x00", b"\x00\x01")  # random bytes can be a message


@given(st.integers(0, 100), st.integers(0, 255))
def test_a_wrong_byte_gives_another_message_or_an_error(place, byte):
    raw = bytearray(
        messages.encode(
            messages.ratings_message(
                "sr_0", 10**18, {"sp_0": 0.5, "sp_1": 1.0}, FixedSigner(b"x" * 16)
            )
        )
    )
    raw[place % len(raw)] = byte
    with suppress(ValueError):
        messages.read_ratings_message(bytes(raw))


def test_as_many_ratings_as_providers_are_read():
    message = messages.ratings_message("sr_0", 5, {"sp_0": 0.5, "sp_1": 1.0})
    for providers in (["sp_0"], ["sp_0", "sp_1", "sp_2"]):
        message.providers = providers
        with refuses(ValueError, "roletrust_msgs/msg/Ratings"):
            messages.read_ratings_message(messages.encode(message))


def test_trust_is_read_as_it_was_written():
    team = Team(("sr_0", "both"), ("sp_0", "both"))
    entry = JournalEntry(
        7, 1_500_000_001, 0, team, {}, ("sr_0",), Trust((0.25, 0.5), (0.75, 1.0), (0.6,))
    )
    read = messages.decode(messages.encode(messages.trust_message(entry)), messages.TRUST)
    assert (read.round, messages.stamp_of(read)) == (7, 1_500_000_001)
    assert (read.raters, read.providers, read.both, read.missing) == (
        ["sr_0", "both"],
        ["sp_0", "both"],
        ["both"],
        ["sr_0"],
    )
    assert (read.tor.tolist(), read.top.tolist(), read.toa.tolist()) == (
        [0.25, 0.5],
        [0.75, 1.0],
        [0.6],
    )


@pytest.mark.parametrize(
    ("kind", "known"),
    [  # hashes of ROS 2 Kilted
        (
            messages.NUMBER,
            "RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a",
        ),
        (messages.IMAGE, "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a"),
    ],
)
def test_the_hashes_of_types_are_those_of_ros(kind, known):
    assert messages.type_hash(kind) == known


def test_the_package_for_colcon_has_every_message():
    build = (messages.PACKAGE / "CMakeLists.txt").read_text()
    for path in messages.PACKAGE.glob("msg/*.msg"):
        assert f'"msg/{path.name}"' in build
        assert f"roletrust_msgs/msg/{path.stem}" in messages.typestore().types


@pytest.mark.parametrize("warns", [False, True])
def test_diagnostics_warn_of_refused_ratings(warns):
    message = messages.diagnostics_message(5, "manager", warns, {"next round": "7"}, None)
    (status,) = messages.decode(messages.encode(message), messages.DIAGNOSTICS).status
    assert (status.level, status.name, status.message) == (
        int(warns),
        "manager",
        "refuses ratings" if warns else "OK",
    )
    assert [(pair.key, pair.value) for pair in status.values] == [("next round", "7")]


def test_a_picture_names_its_camera():
    message = messages.picture_message(1_500_000_001, "sp_0", bytes(range(9)))
    read = messages.decode(messages.encode(message), messages.IMAGE)
    assert (read.header.frame_id, read.format, bytes(read.data)) == (
        "sp_0",
        "jpeg",
        bytes(range(9)),
    )
    assert messages.stamp_of(read) == 1_500_000_001
