"""Signatures of messages (ed25519): in a field of the project's own types, and inside messages of ROS 2's types.

ROS 2's types have no field for a signature. A picture has it behind its JPEG, where every decoder ignores it, and
diagnostics have it as their last value. So each message is complete, and all tools of ROS 2 can read it.
"""

from typing import Any, NamedTuple

import numpy as np

from roletrust_env.live.journal import PublishedTrust
from roletrust_env.live.message_validation import MANAGER, Envelope
from roletrust_env.live.nodes.topics import DIAGNOSTICS, IMAGES
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.keys import Signer

_MARK = b"ed25519"
_SIZE = 64  # of a signature, bytes
_SIGNATURE = "signature"


class Picture(NamedTuple):
    """A message of a camera.

    Attributes:
        camera: Name of the camera.
        jpeg: Picture.
        envelope: Origin of the message.
    """

    camera: str
    jpeg: bytes
    envelope: Envelope


class Report(NamedTuple):
    """A message with the state of one node.

    Attributes:
        node: Name of the node.
        values: State, such as the number of refusals by sender and reason.
        envelope: Origin of the message.
    """

    node: str
    values: dict[str, str]
    envelope: Envelope


def sign(message: Any, signer: Signer | None) -> Any:
    """Fill the field `signature` of a message and return the message; None does not sign."""
    message.signature = np.empty(0, np.uint8)
    if signer is not None:
        message.signature = np.frombuffer(signer.sign(messages.encode(message)), np.uint8)
    return message


def signed_picture(stamp: int, camera: str, jpeg: bytes, signer: Signer | None) -> Any:
    """Return a message with a picture of a camera and, behind it, the signature; None does not sign."""
    end = b"" if signer is None else _MARK + signer.sign(_picture_text(camera, stamp) + jpeg)
    return messages.image_message(stamp, camera, np.frombuffer(jpeg + end, np.uint8))


def signed_diagnostics(stamp: int, node: str, warns: bool, values: dict[str, str], signer: Signer | None) -> Any:
    """Return a message with the state of a node; the signature is its last value. None does not sign."""
    message = messages.diagnostics_message(stamp, node, warns, values)
    if signer is not None:
        signature = signer.sign(_diagnostics_text(message)).hex()
        (status,) = message.status
        status.values.append(messages.make("diagnostic_msgs/msg/KeyValue", key=_SIGNATURE, value=signature))
    return message


def read_trust(raw: bytes) -> tuple[PublishedTrust, Envelope]:
    """Read a message with the trust after a round, and its origin.

    Raises:
        ValueError: The bytes are not such a message.
    """
    trust = messages.read_trust(raw)
    message = messages.decode(raw, messages.TRUST)
    signature = bytes(message.signature)
    return trust, Envelope(MANAGER, trust.stamp, messages.encode(sign(message, None)), signature)


def read_picture(raw: bytes, camera: str) -> Picture:
    """Read a message on the topic of a camera.

    Raises:
        ValueError: The bytes are not such a message.
    """
    message = messages.decode(raw, messages.IMAGE)
    data, stamp = bytes(message.data), messages.stamp_of(message)
    jpeg, end = data[: -_SIZE - len(_MARK)], data[-_SIZE - len(_MARK) :]
    if not end.startswith(_MARK):
        return Picture(camera, data, Envelope(camera, stamp))
    envelope = Envelope(camera, stamp, _picture_text(camera, stamp) + jpeg, end.removeprefix(_MARK))
    return Picture(camera, jpeg, envelope)


def read_diagnostics(raw: bytes) -> Report | None:
    """Read a message with the state of one node; None if it has another number of states.

    Raises:
        ValueError: The bytes are not such a message, or its signature cannot be read.
    """
    message = messages.decode(raw, messages.DIAGNOSTICS)
    if len(message.status) != 1:
        return None
    (status,), signature = message.status, b""
    if status.values and status.values[-1].key == _SIGNATURE:
        signature = bytes.fromhex(status.values.pop().value)
    envelope = Envelope(status.name, messages.stamp_of(message), _diagnostics_text(message), signature)
    return Report(status.name, {pair.key: pair.value for pair in status.values}, envelope)


def _picture_text(camera: str, stamp: int) -> bytes:
    """Return the text that is signed before a picture, so that its signature is valid for no other message."""
    return f"/{camera}{IMAGES} {stamp // 10**9}.{stamp % 10**9:09d}\n".encode()


def _diagnostics_text(message: Any) -> bytes:
    return f"{DIAGNOSTICS}\n".encode() + messages.encode(message)
