"""Messages of ROS 2, written and read without ROS 2: CDR according to the definitions in `.msg` files."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from roletrust_env.live.journal import JournalEntry, PublishedTrust
from roletrust_env.live.rating_validation import Ratings

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
IMAGE = "sensor_msgs/msg/CompressedImage"
RATINGS = "roletrust_msgs/msg/Ratings"
TRUST = "roletrust_msgs/msg/Trust"
NUMBER = "std_msgs/msg/Float64"

PACKAGE = Path(__file__).parent.parent / "roletrust_msgs"
"""Folder of the ROS 2 package with the project's own messages, which colcon builds."""

_SECOND = 1_000_000_000


@cache
def typestore() -> Typestore:
    """Return the message types of ROS 2 Kilted and of the project."""
    store = get_typestore(Stores.ROS2_KILTED)
    for path in sorted(PACKAGE.glob("msg/*.msg")):
        store.register(get_types_from_msg(path.read_text(encoding="utf-8"), f"roletrust_msgs/msg/{path.stem}"))
    return store


def make(kind: str, **fields: Any) -> Any:
    """Return a message of a type such as `std_msgs/msg/Float64`."""
    return typestore().types[kind](**fields)


def encode(message: Any) -> bytes:
    """Return a message as CDR, little-endian, with its encapsulation header."""
    return bytes(typestore().serialize_cdr(message, message.__msgtype__, little_endian=True))


def decode(raw: bytes, kind: str) -> Any:
    """Return the message of some CDR bytes.

    Raises:
        ValueError: The bytes are not a message of that type.
    """
    try:
        return typestore().deserialize_cdr(raw, kind)
    except (SerdeError, IndexError, OverflowError, MemoryError) as error:
        raise ValueError(f"{len(raw)} bytes are not a valid {kind}: {error}") from None


def type_hash(kind: str) -> str:
    """Return the hash `RIHS01_...` by which ROS 2 nodes compare their definitions of a type."""
    return typestore().hash_rihs01(kind)


def header(stamp: int, frame: str = "") -> Any:
    """Return a header with a stamp in nanoseconds."""
    time = make("builtin_interfaces/msg/Time", sec=stamp // _SECOND, nanosec=stamp % _SECOND)
    return make("std_msgs/msg/Header", stamp=time, frame_id=frame)


def stamp_of(message: Any) -> int:
    """Return the stamp of a message with a header, nanoseconds."""
    return int(message.header.stamp.sec) * _SECOND + int(message.header.stamp.nanosec)


def ratings_message(rater: str, stamp: int, ratings: dict[str, float], signature: bytes = b"") -> Any:
    """Return a message with a rater's ratings of the services of one round."""
    return make(
        RATINGS,
        header=header(stamp),
        rater=rater,
        providers=list(ratings),
        values=np.array(list(ratings.values()), np.float64),
        signature=np.frombuffer(signature, np.uint8),
    )


def read_ratings(raw: bytes) -> Ratings:
    """Read a message with ratings.

    Returns:
        The ratings, the signature, and the bytes that it covers.

    Raises:
        ValueError: The bytes are not such a message.
    """
    message = decode(raw, RATINGS)
    signature = bytes(message.signature)
    message.signature = np.empty(0, np.uint8)
    values = message.values.tolist()
    return Ratings(message.rater, stamp_of(message), message.providers, values, encode(message), signature)


def trust_message(entry: JournalEntry) -> Any:
    """Return a message with the trust after a round."""
    return make(
        TRUST,
        header=header(entry.stamp),
        round=entry.round,
        raters=list(entry.team.raters),
        tor=_numbers(entry.trust.tor),
        providers=list(entry.team.providers),
        top=_numbers(entry.trust.top),
        both=list(entry.team.dual_role),
        toa=_numbers(entry.trust.toa),
        missing=list(entry.missing),
        signature=np.empty(0, np.uint8),
    )


def read_trust(raw: bytes) -> PublishedTrust:
    """Read a message with the trust after a round.

    Raises:
        ValueError: The bytes are not such a message.
    """
    message = decode(raw, TRUST)
    if (len(message.raters), len(message.providers)) != (len(message.tor), len(message.top)):
        raise ValueError(f"{len(raw)} bytes are not a valid {TRUST}: it has not as many values as names")
    tor = dict(zip(message.raters, message.tor.tolist(), strict=True))
    top = dict(zip(message.providers, message.top.tolist(), strict=True))
    return PublishedTrust(message.round, stamp_of(message), tor, top, tuple(message.missing))


def image_message(stamp: int, camera: str, jpeg: NDArray[np.uint8]) -> Any:
    """Return a message with a picture of a camera."""
    return make(IMAGE, header=header(stamp, camera), format="jpeg", data=jpeg)


def diagnostics_message(stamp: int, name: str, warns: bool, values: dict[str, str]) -> Any:
    """Return a message with the state of a node, for the tools of ROS 2."""
    status = make(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=1 if warns else 0,
        name=name,
        message="refuses ratings" if warns else "OK",
        hardware_id="",
        values=[make("diagnostic_msgs/msg/KeyValue", key=key, value=value) for key, value in values.items()],
    )
    return make(DIAGNOSTICS, header=header(stamp), status=[status])


def _numbers(values: tuple[float, ...]) -> NDArray[np.float64]:
    return np.array(values, np.float64)
