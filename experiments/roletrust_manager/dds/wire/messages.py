"""Messages of ROS 2 without ROS 2: CDR according to the definitions in `.msg` files, and their
signatures (ed25519).

The project's own types have a field for the signature. ROS 2's types have none: a picture has its
signature behind the JPEG, where every decoder ignores it, and diagnostics have it as their last
value. So each message is complete, and all tools of ROS 2 can read it.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from roletrust_manager.admission.keys import Signer
from roletrust_manager.admission.validation import MANAGER, Envelope, RatingMessage
from roletrust_manager.dds.wire import topics
from roletrust_manager.journal.lines import JournalEntry
from roletrust_manager.team import PublishedTrust

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
IMAGE = "sensor_msgs/msg/CompressedImage"
RATINGS = "roletrust_msgs/msg/Ratings"
TRUST = "roletrust_msgs/msg/Trust"
NUMBER = "std_msgs/msg/Float64"

PACKAGE = Path(__file__).parent.parent / "roletrust_msgs"
"""Folder of the ROS 2 package with the project's own messages, which colcon builds."""

_SECOND = 1_000_000_000
_LAST_SECOND = 2**31
_MARK = b"ed25519"  # between a JPEG and its signature
_SIZE = 64  # of a signature, bytes
_SIGNATURE = "signature"


class TrustMessage(NamedTuple):
    """A message of the manager.

    Attributes:
        trust: Trust after a round.
        envelope: Origin of the message.
    """

    trust: PublishedTrust
    envelope: Envelope


class PictureMessage(NamedTuple):
    """A message of a camera.

    Attributes:
        jpeg: Picture.
        envelope: Origin of the message: the camera, and the time stamp of its service.
    """

    jpeg: bytes
    envelope: Envelope


class DiagnosticsMessage(NamedTuple):
    """A message with the state of one node.

    Attributes:
        values: State, such as the number of refusals by sender and reason.
        envelope: Origin of the message, with the name of the node.
    """

    values: dict[str, str]
    envelope: Envelope


@cache
def typestore() -> Typestore:
    """Return the message types of ROS 2 Kilted and of the project."""
    store = get_typestore(Stores.ROS2_KILTED)
    for path in sorted(PACKAGE.glob("msg/*.msg")):
        store.register(
            get_types_from_msg(path.read_text(encoding="utf-8"), f"roletrust_msgs/msg/{path.stem}")
        )
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
    """Return a header with a stamp in nanoseconds.

    Raises:
        ValueError: ROS 2 has no such stamp.
    """
    if not -_LAST_SECOND <= stamp // _SECOND < _LAST_SECOND:
        raise ValueError(
            f"the time is {stamp} ns since 1970; stamps of ROS 2 end on 2038-01-19, so set the "
            "clock right"
        )
    time = make("builtin_interfaces/msg/Time", sec=stamp // _SECOND, nanosec=stamp % _SECOND)
    return make("std_msgs/msg/Header", stamp=time, frame_id=frame)


def stamp_of(message: Any) -> int:
    """Return the stamp of a message with a header, nanoseconds."""
    return int(message.header.stamp.sec) * _SECOND + int(message.header.stamp.nanosec)


def sign_message(message: Any, signer: Signer | None) -> Any:
    """Fill the field `signature` of a message and return the message; None does not sign."""
    message.signature = np.empty(0, np.uint8)
    if signer is not None:
        message.signature = np.frombuffer(signer.sign(encode(message)), np.uint8)
    return message


def signed_message(envelope: Envelope) -> bytes:
    """Return the CDR of a message with the field `signature`, its last one, from its origin."""
    size = len(envelope.signature).to_bytes(4, "little")
    return envelope.signed.removesuffix(bytes(4)) + size + envelope.signature


def ratings_message(
    rater: str, stamp: int, ratings: Mapping[str, float], signer: Signer | None = None
) -> Any:
    """Return a message with a rater's ratings of the services of one round; without a signer, it is
    not signed.
    """
    values = _numbers(ratings.values())
    unsigned = np.empty(0, np.uint8)
    message = make(
        RATINGS,
        header=header(stamp),
        rater=rater,
        providers=list(ratings),
        values=values,
        signature=unsigned,
    )
    return sign_message(message, signer)


def read_ratings_message(raw: bytes) -> RatingMessage:
    """Read a message with ratings.

    Raises:
        ValueError: The bytes are not such a message.
    """
    message = decode(raw, RATINGS)
    if len(message.providers) != len(message.values):
        raise ValueError(
            f"{len(raw)} bytes are not a valid {RATINGS}: it has not as many ratings as providers"
        )
    return RatingMessage(
        _envelope(message.rater, message), message.providers, message.values.tolist()
    )


def trust_message(entry: JournalEntry, signer: Signer | None = None) -> Any:
    """Return a message with the trust after a round; without a signer, it is not signed."""
    message = make(
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
    return sign_message(message, signer)


def read_trust_message(raw: bytes) -> TrustMessage:
    """Read a message with the trust after a round.

    Raises:
        ValueError: The bytes are not such a message.
    """
    message = decode(raw, TRUST)
    if (len(message.raters), len(message.providers)) != (len(message.tor), len(message.top)):
        raise ValueError(
            f"{len(raw)} bytes are not a valid {TRUST}: it has not as many values as names"
        )
    tor = dict(zip(message.raters, message.tor.tolist(), strict=True))
    top = dict(zip(message.providers, message.top.tolist(), strict=True))
    trust = PublishedTrust(message.round, stamp_of(message), tor, top, tuple(message.missing))
    return TrustMessage(trust, _envelope(MANAGER, message))


def picture_message(stamp: int, camera: str, jpeg: bytes, signer: Signer | None = None) -> Any:
    """Return a message with a picture of a camera and, behind it, the signature; without a signer,
    it is not signed.
    """
    end = b"" if signer is None else _MARK + signer.sign(_picture_text(camera, stamp) + jpeg)
    return make(
        IMAGE, header=header(stamp, camera), format="jpeg", data=np.frombuffer(jpeg + end, np.uint8)
    )


def read_picture_message(camera: str, raw: bytes) -> PictureMessage:
    """Read a message on the topic of a camera.

    Raises:
        ValueError: The bytes are not such a message.
    """
    message = decode(raw, IMAGE)
    data, stamp = bytes(message.data), stamp_of(message)
    jpeg, end = data[: -_SIZE - len(_MARK)], data[-_SIZE - len(_MARK) :]
    if not end.startswith(_MARK):
        return PictureMessage(data, Envelope(camera, stamp))
    signed = _picture_text(camera, stamp) + jpeg
    return PictureMessage(jpeg, Envelope(camera, stamp, signed, end.removeprefix(_MARK)))


def diagnostics_message(
    stamp: int, node: str, warns: bool, values: Mapping[str, str], signer: Signer | None
) -> Any:
    """Return a message with the state of a node; the signature is its last value. None does not
    sign.
    """
    pairs = [
        make("diagnostic_msgs/msg/KeyValue", key=key, value=value) for key, value in values.items()
    ]
    status = make(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=1 if warns else 0,
        name=node,
        message="refuses ratings" if warns else "OK",
        hardware_id="",
        values=pairs,
    )
    message = make(DIAGNOSTICS, header=header(stamp), status=[status])
    if signer is not None:
        signature = signer.sign(_diagnostics_text(message)).hex()
        pairs.append(make("diagnostic_msgs/msg/KeyValue", key=_SIGNATURE, value=signature))
    return message


def read_diagnostics_message(raw: bytes) -> DiagnosticsMessage | None:
    """Read a message with the state of one node; None if it has another number of states.

    Raises:
        ValueError: The bytes are not such a message, or its signature cannot be read.
    """
    message = decode(raw, DIAGNOSTICS)
    if len(message.status) != 1:
        return None
    (status,), signature = message.status, b""
    if status.values and status.values[-1].key == _SIGNATURE:
        signature = bytes.fromhex(status.values.pop().value)
    envelope = Envelope(status.name, stamp_of(message), _diagnostics_text(message), signature)
    return DiagnosticsMessage({pair.key: pair.value for pair in status.values}, envelope)


def _envelope(sender: str, message: Any) -> Envelope:
    """Return the origin of a message with a field for its signature."""
    signature = bytes(message.signature)
    return Envelope(sender, stamp_of(message), encode(sign_message(message, None)), signature)


def _picture_text(camera: str, stamp: int) -> bytes:
    """Return the text that is signed before a picture, so that its signature is valid for no other
    message.
    """
    return f"/{camera}{topics.IMAGES} {stamp // 10**9}.{stamp % 10**9:09d}\n".encode()


def _diagnostics_text(message: Any) -> bytes:
    return f"{topics.DIAGNOSTICS}\n".encode() + encode(message)


def _numbers(values: Any) -> NDArray[np.float64]:
    return np.array(list(values), np.float64)
