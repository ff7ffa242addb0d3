"""Messages as ROS 2 has them, made and read without ROS 2: CDR by the definitions in `.msg` files."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from roletrust_env.live.journal import Entry, Published
from roletrust_env.live.rating_validation import Ratings

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
IMAGE = "sensor_msgs/msg/CompressedImage"
RATINGS = "roletrust_msgs/msg/Ratings"
TRUST = "roletrust_msgs/msg/Trust"
NUMBER = "std_msgs/msg/Float64"

PACKAGE = Path(__file__).parent.parent / "roletrust_msgs"
"""The ROS 2 package of the project's own messages, which colcon builds."""

_SECOND = 1_000_000_000


@cache
def typestore() -> Typestore:
    """The types of ROS 2 Kilted, and the project's own."""
    store = get_typestore(Stores.ROS2_KILTED)
    for path in sorted(PACKAGE.glob("msg/*.msg")):
        store.register(get_types_from_msg(path.read_text(encoding="utf-8"), f"roletrust_msgs/msg/{path.stem}"))
    return store


def make(kind: str, **fields: Any) -> Any:
    """A message of a type, such as `std_msgs/msg/Float64`."""
    return typestore().types[kind](**fields)


def encode(message: Any) -> bytes:
    """A message as CDR, little-endian, with its header of encapsulation."""
    return bytes(typestore().serialize_cdr(message, message.__msgtype__, little_endian=True))


def decode(raw: bytes, kind: str) -> Any:
    """A message of its CDR.

    Raises:
        ValueError: it is not one of that type.
    """
    try:
        return typestore().deserialize_cdr(raw, kind)
    except (SerdeError, IndexError, OverflowError, MemoryError) as error:
        raise ValueError(f"{len(raw)} bytes are no {kind}: {error}") from None


def type_hash(kind: str) -> str:
    """The hash by which ROS 2 tells whether two nodes mean the same by a type, `RIHS01_...`."""
    return typestore().hash_rihs01(kind)


def header(stamp: int, frame: str = "") -> Any:
    """A header with a stamp, nanoseconds."""
    time = make("builtin_interfaces/msg/Time", sec=stamp // _SECOND, nanosec=stamp % _SECOND)
    return make("std_msgs/msg/Header", stamp=time, frame_id=frame)


def stamp_of(message: Any) -> int:
    """The stamp of a message with a header, nanoseconds."""
    return int(message.header.stamp.sec) * _SECOND + int(message.header.stamp.nanosec)


def ratings_message(rater: str, stamp: int, ratings: dict[str, float], signature: bytes = b"") -> Any:
    """What a rater says of the services of a round."""
    return make(
        RATINGS,
        header=header(stamp),
        rater=rater,
        providers=list(ratings),
        values=np.array(list(ratings.values()), np.float64),
        signature=np.frombuffer(signature, np.uint8),
    )


def read_ratings(raw: bytes) -> Ratings:
    """What a rater says, and the bytes that it signed.

    Raises:
        ValueError: the bytes are no such message.
    """
    message = decode(raw, RATINGS)
    signature = bytes(message.signature)
    message.signature = np.empty(0, np.uint8)
    values = message.values.tolist()
    return Ratings(message.rater, stamp_of(message), message.providers, values, encode(message), signature)


def trust_message(entry: Entry) -> Any:
    """The trust after a round."""
    return make(
        TRUST,
        header=header(entry.stamp),
        round=entry.round,
        raters=list(entry.team.raters),
        tor=_numbers(entry.trust.tor),
        providers=list(entry.team.providers),
        top=_numbers(entry.trust.top),
        both=list(entry.team.both),
        toa=_numbers(entry.trust.toa),
        missing=list(entry.missing),
    )


def read_trust(raw: bytes) -> Published:
    """The trust after a round, as it was published.

    Raises:
        ValueError: the bytes are no such message.
    """
    said = decode(raw, TRUST)
    if (len(said.raters), len(said.providers)) != (len(said.tor), len(said.top)):
        raise ValueError(f"{len(raw)} bytes are no {TRUST}: there are not as many values as names")
    tor = dict(zip(said.raters, said.tor.tolist(), strict=True))
    top = dict(zip(said.providers, said.top.tolist(), strict=True))
    return Published(said.round, stamp_of(said), tor, top, tuple(said.missing))


def image_message(stamp: int, camera: str, jpeg: NDArray[np.uint8]) -> Any:
    """A picture of a camera."""
    return make(IMAGE, header=header(stamp, camera), format="jpeg", data=jpeg)


def diagnostics_message(stamp: int, name: str, warns: bool, values: dict[str, str]) -> Any:
    """How a node is, for ROS 2's tools."""
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
