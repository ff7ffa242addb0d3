"""Signed checkpoints against the formats of C2SP, computed here from the specification."""

import base64
from hashlib import sha256

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from refusals import refuses

from roletrust_manager.journal.checkpoint import (
    Checkpoint,
    read_checkpoint,
    read_verifier_key,
    sign_checkpoint,
    verifier_key,
)

KEY = Ed25519PrivateKey.from_private_bytes(bytes(range(32)))
PUBLIC = KEY.public_key()
OTHER = Ed25519PrivateKey.from_private_bytes(bytes(32))
ROOT = bytes(range(100, 132))
CHECKPOINT = Checkpoint("roletrust/trust", 20852163, ROOT)
BODY = "roletrust/trust\n20852163\nZGVmZ2hpamtsbW5vcHFyc3R1dnd4eXp7fH1+f4CBgoM=\n"


def signature_line(body, name="roletrust/trust", key=KEY):
    public = key.public_key().public_bytes_raw()
    key_id = sha256(name.encode() + b"\x0a\x01" + public).digest()[:4]
    return f"— {name} {base64.b64encode(key_id + key.sign(body.encode())).decode()}\n"


def signed(body):
    return f"{body}\n{signature_line(body)}"


def test_a_checkpoint_is_a_signed_note():
    assert sign_checkpoint(CHECKPOINT, KEY) == signed(BODY)
    assert read_checkpoint(signed(BODY), PUBLIC) == CHECKPOINT


def test_the_key_of_the_go_library_is_written_as_there():
    published = "PeterNeumann+c74f20a3+ARpc2QcUPDhMQegwxbzhKqiBfsVkmqq/LDE4izWy10TW"
    key = Ed25519PublicKey.from_public_bytes(base64.b64decode(published.split("+", 2)[2])[1:])
    assert verifier_key("PeterNeumann", key) == published
    assert read_verifier_key(published) == key
    for wrong in ("", "a+b+c", published[:-4], published.replace("c74", "c75")):
        with refuses(ValueError):
            read_verifier_key(wrong)


@pytest.mark.parametrize("size", [0, 1, 10**19 - 1])
def test_sizes_return(size):
    checkpoint = CHECKPOINT._replace(size=size)
    assert read_checkpoint(sign_checkpoint(checkpoint, KEY), PUBLIC) == checkpoint


def test_signatures_of_other_keys_are_ignored():
    witness = signature_line(BODY, "witness.example/w", OTHER)
    namesake = signature_line(BODY, key=OTHER)
    wrong = signature_line("another text\n", "witness.example/w", OTHER)
    own = signature_line(BODY)
    same_id = own.replace("roletrust/trust", "witness.example/w")
    others = witness + namesake + wrong + same_id
    for lines in (others + own, own + others, own + own):
        assert read_checkpoint(f"{BODY}\n{lines}", PUBLIC) == CHECKPOINT


def test_a_checkpoint_of_another_key_is_refused():
    text = f"{BODY}\n{signature_line(BODY, key=OTHER)}"
    assert read_checkpoint(text, OTHER.public_key()) == CHECKPOINT
    key_id = sha256(b"roletrust/trust\n\1" + PUBLIC.public_bytes_raw()).hexdigest()[:8]
    known = f"roletrust/trust+{key_id}"
    with refuses(ValueError, known):
        read_checkpoint(text, PUBLIC)
    with refuses(ValueError, known):  # the same signature, but under another name
        read_checkpoint(signed(BODY).replace("— roletrust/trust", "— roletrust/other"), PUBLIC)
    with refuses(ValueError, known):  # the same key, but another name
        read_checkpoint(f"{BODY}\n{signature_line(BODY, 'roletrust/other')}", PUBLIC)


@pytest.mark.parametrize(
    ("part", "other"),
    [
        ("roletrust/trust\n2", "roletrust/trust\n3"),
        ("ZGVm", "ZGVn"),
    ],
)
def test_a_changed_body_is_refused(part, other):
    line = signature_line(BODY)
    changed = BODY.replace(part, other)
    assert changed != BODY
    with refuses(ValueError, line.strip()):
        read_checkpoint(f"{changed}\n{line}", PUBLIC)


def test_every_changed_byte_of_a_signature_is_refused():
    name, _, encoded = signature_line(BODY).rstrip("\n").rpartition(" ")
    data = base64.b64decode(encoded)
    assert len(data) == 68
    for at in range(68):
        changed = data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]
        line = f"{name} {base64.b64encode(changed).decode()}"
        with refuses(ValueError, "roletrust/trust"):
            read_checkpoint(f"{BODY}\n{line}\n", PUBLIC)
    for short in (data[:3], data[:4], data[:-1], data + b"\0"):
        line = f"{name} {base64.b64encode(short).decode()}"
        with refuses(ValueError, line):
            read_checkpoint(f"{BODY}\n{line}\n", PUBLIC)


@pytest.mark.parametrize(
    "size", ["007", "+7", "-7", "7 ", "0x7", "7_0", "", "\u0667", "00", "9" * 20]
)
def test_a_size_that_is_not_canonical_is_refused(size):
    with refuses(ValueError, "size", repr(size)):
        read_checkpoint(signed(BODY.replace("20852163", size)), PUBLIC)


@pytest.mark.parametrize(
    "root",
    [
        "ZGVmZ2hpamtsbW5vcHFyc3R1dnd4eXp7fH1+f4CBgoN=",  # the same bytes, another text
        "ZGVmZ2hpamtsbW5vcHFyc3R1dnd4eXp7fH1-f4CBgoM=",
        "ZGVmZ2hpamtsbW5vcHFyc3R1dnd4eXp7fH1+f4CBgoM",
        "ZGVmZ2hpamtsbW5vcHFyc3R1dnd4eXp7fH1+f4CBgoM= ",
        "ZGVmZ2hpamtsbW5vcHFyc3R1dnd4eXp7fH1+f4CBgg==",  # 31 bytes
        "ZGVmZ2hpamtsbW5vcHFyc3R1dnd4eXp7fH1+f4CBgoOE",  # 33 bytes
        "ä",
        "",
    ],
)
def test_a_root_that_is_not_canonical_is_refused(root):
    with refuses(ValueError, repr(root)):
        read_checkpoint(signed(BODY.replace(BODY.split("\n")[2], root)), PUBLIC)


@pytest.mark.parametrize(
    "origin",
    ["", "role trust", "role+trust", "role\u2003trust", "role\ttrust", "role\rtrust", "role\x7f"],
)
def test_an_origin_with_spaces_or_plus_signs_is_refused(origin):
    with refuses(ValueError, repr(origin)):
        sign_checkpoint(CHECKPOINT._replace(origin=origin), KEY)
    with refuses(ValueError, repr(origin)):
        verifier_key(origin, PUBLIC)
    with refuses(ValueError, repr(origin)):
        read_checkpoint(signed(BODY.replace("roletrust/trust", origin)), PUBLIC)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "\n\n",
        BODY,
        f"{BODY}\n",
        f"{BODY}{signature_line(BODY)}",  # no empty line
        f"{BODY}\n\n{signature_line(BODY)}",
        f"{BODY}\n{signature_line(BODY)}".rstrip("\n"),
        f"{BODY}\n{signature_line(BODY)}\n",
        f"\n{BODY}\n{signature_line(BODY)}",
        signed(f"{BODY}more\n"),
        signed(BODY).replace("\n", "\r\n"),
        signed(BODY.rpartition("\nZ")[0] + "\n"),  # no root
    ],
)
def test_another_form_is_refused(text):
    with refuses(ValueError, repr(text)):
        read_checkpoint(text, PUBLIC)


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("- roletrust/trust AAAA", "- roletrust/trust AAAA"),
        ("—roletrust/trust AAAA", "—roletrust/trust AAAA"),
        ("— roletrust/trust  AAAA", "— roletrust/trust  AAAA"),
        ("— roletrust/trust AAAA more", "— roletrust/trust AAAA more"),
        ("— roletrust/trust AAA", "AAA"),
        ("— roletrust/trust AAB=", "AAB="),
        ("— role+trust AAAA", "role+trust"),
    ],
)
def test_a_signature_of_another_form_is_refused(line, shown):
    with refuses(ValueError, repr(shown)):
        read_checkpoint(f"{BODY}\n{signature_line(BODY)}{line}\n", PUBLIC)


def test_what_is_no_checkpoint_is_not_signed():
    with refuses(ValueError, "size", -1):
        sign_checkpoint(CHECKPOINT._replace(size=-1), KEY)
    with refuses(ValueError, "size", 10**19):
        sign_checkpoint(CHECKPOINT._replace(size=10**19), KEY)
    with refuses(ValueError, "root", 31):
        sign_checkpoint(CHECKPOINT._replace(root=ROOT[:31]), KEY)


def test_a_key_with_which_anybody_can_sign_is_refused():
    weak = Ed25519PublicKey.from_public_bytes(b"\1" + bytes(31))  # the neutral element
    forged = b"\1" + bytes(63)
    weak.verify(forged, BODY.encode())
    key_id = sha256(b"roletrust/trust\n\1\1" + bytes(31)).digest()[:4]
    line = f"— roletrust/trust {base64.b64encode(key_id + forged).decode()}\n"
    with refuses(ValueError, verifier_key("roletrust/trust", weak)):
        read_checkpoint(f"{BODY}\n{line}", weak)
