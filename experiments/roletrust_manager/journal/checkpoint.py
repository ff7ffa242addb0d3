"""Signed checkpoints of a journal: its size and its root hash, in the formats of
https://c2sp.org/tlog-checkpoint and https://c2sp.org/signed-note.
"""

import base64
import re
from hashlib import sha256
from typing import NamedTuple

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from roletrust_env.errors import short
from roletrust_manager.admission.keys import is_forgeable
from roletrust_manager.journal.merkle import HASH_SIZE

_ED25519 = b"\x01"  # the type of the signature
_ID_SIZE = 4
_SIZE = re.compile(r"0|[1-9][0-9]{0,18}")
_SIGNATURE = re.compile(r"— (\S+) (\S+)")


class Checkpoint(NamedTuple):
    """State of a journal.

    Attributes:
        origin: Name of the journal, such as `roletrust/NAME`, without spaces and plus signs.
        size: Number of events.
        root: Root hash of their Merkle tree, 32 bytes.
    """

    origin: str
    size: int
    root: bytes


def sign_checkpoint(checkpoint: Checkpoint, private_key: Ed25519PrivateKey) -> str:
    """Return the text of a checkpoint with one signature, named after its origin.

    Raises:
        ValueError: The origin, the size or the root is invalid.
    """
    origin, size, root = checkpoint
    _check_name(origin)
    if not _SIZE.fullmatch(str(size)):
        raise ValueError(f"size must be in [0, 10^19), got {size}")
    if len(root) != HASH_SIZE:
        raise ValueError(f"root must have {HASH_SIZE} bytes, got {len(root)}")
    text = f"{origin}\n{size}\n{_encode(root)}\n"
    signature = private_key.sign(text.encode())
    key_id = _key_id(origin, private_key.public_key())
    return f"{text}\n— {origin} {_encode(key_id + signature)}\n"


def read_checkpoint(text: str, public_key: Ed25519PublicKey) -> Checkpoint:
    """Return the checkpoint of a text that a key has signed under the name of the origin.

    Signatures of other keys are ignored, as the format requires: they may be of witnesses.

    Raises:
        ValueError: The text is not such a checkpoint, the key has not signed it, one of its
            signatures is wrong, or anybody could have signed it, see `is_forgeable`.
    """
    body, _, signatures = text.rpartition("\n\n")
    lines = body.split("\n")
    if len(lines) != 3 or not signatures.endswith("\n"):
        raise ValueError(
            "a checkpoint has the lines origin, size, root, an empty line and signatures, got "
            f"{short(repr(text))}"
        )
    origin, size, root = lines
    _check_name(origin)
    if not _SIZE.fullmatch(size):
        raise ValueError(f"size must be a number without leading zeros, got {short(repr(size))}")
    checkpoint = Checkpoint(origin, int(size), _decode(root))
    if len(checkpoint.root) != HASH_SIZE:
        raise ValueError(f"root must have {HASH_SIZE} bytes, got {short(repr(root))}")
    if is_forgeable(public_key):
        raise ValueError(f"anybody can sign with the key {verifier_key(origin, public_key)}")
    key_id = _key_id(origin, public_key)
    signed = False
    for line in signatures[:-1].split("\n"):
        name, known_id, signature = _read_signature(line)
        if (name, known_id) == (origin, key_id):
            try:
                public_key.verify(signature, f"{body}\n".encode())
            except InvalidSignature:
                raise ValueError(f"the signature is wrong: {short(repr(line))}") from None
            signed = True
    if not signed:
        raise ValueError(
            f"the checkpoint must be signed by the key {origin}+{key_id.hex()}, got "
            f"{short(repr(signatures))}"
        )
    return checkpoint


def verifier_key(name: str, public_key: Ed25519PublicKey) -> str:
    """Return a public key as the text NAME+ID+KEY of a signed note.

    Raises:
        ValueError: The name is empty, or has a space or a plus sign.
    """
    _check_name(name)
    encoded = _encode(_ED25519 + public_key.public_bytes_raw())
    return f"{name}+{_key_id(name, public_key).hex()}+{encoded}"


def read_verifier_key(text: str) -> Ed25519PublicKey:
    """Return the public key of a text that `verifier_key` has made.

    Raises:
        ValueError: The text is none, or is of another kind of key.
    """
    name, _, rest = text.partition("+")
    data = _decode(rest.partition("+")[2])
    key = Ed25519PublicKey.from_public_bytes(data[1:]) if len(data) == 33 else None
    if key is None or verifier_key(name, key) != text:
        raise ValueError(f"a key is NAME+ID+KEY of ed25519, got {short(repr(text))}")
    return key


def _key_id(name: str, public_key: Ed25519PublicKey) -> bytes:
    """Return SHA-256(name || 0x0A || 0x01 || public key)[:4]."""
    data = name.encode() + b"\n" + _ED25519 + public_key.public_bytes_raw()
    return sha256(data).digest()[:_ID_SIZE]


def _read_signature(line: str) -> tuple[str, bytes, bytes]:
    """Return the name of the key, its identifier and the signature."""
    matched = _SIGNATURE.fullmatch(line)
    if matched is None:
        raise ValueError(f"a signature is '— NAME BASE64', got {short(repr(line))}")
    name, encoded = matched.groups()
    _check_name(name)
    data = _decode(encoded)
    return name, data[:_ID_SIZE], data[_ID_SIZE:]


def _check_name(name: str) -> None:
    if not name.isprintable() or not name or " " in name or "+" in name:
        raise ValueError(
            f"a name must be printable, without spaces and plus signs, got {short(repr(name))}"
        )


def _encode(data: bytes) -> str:
    return base64.b64encode(data).decode()


def _decode(text: str) -> bytes:
    """Return the bytes of a text in base64, of which each value has one text only."""
    try:
        data = base64.b64decode(text, validate=True)
    except ValueError:
        data = b""
    if _encode(data) != text:
        raise ValueError(f"base64 must be canonical, got {short(repr(text))}")
    return data
