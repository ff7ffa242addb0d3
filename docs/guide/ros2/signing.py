"""Signatures for nodes in plain rclpy; needs the package cryptography.

A signature of ratings covers the message in CDR with zeros as padding; the padding of rclpy itself
has arbitrary bytes.
"""

import struct
from pathlib import Path

from cryptography.hazmat.primitives.serialization import load_pem_private_key


def read_key(path):
    """Return the private key in a file of `roletrust robots keys`."""
    return load_pem_private_key(Path(path).read_bytes(), password=None)


def sign_picture(topic, image, key):
    """Append the signature to the picture of a `CompressedImage` whose stamp is set."""
    stamp = image.header.stamp
    signed = f"{topic} {stamp.sec}.{stamp.nanosec:09d}\n".encode() + bytes(image.data)
    image.data.frombytes(b"ed25519" + key.sign(signed))


def sign_ratings(ratings, key):
    """Fill the signature of a `Ratings` message that is otherwise complete."""
    stamp, raw = ratings.header.stamp, bytearray()
    put(raw, "<i", stamp.sec)
    put(raw, "<I", stamp.nanosec)
    put_text(raw, ratings.header.frame_id)
    put_text(raw, ratings.rater)
    put(raw, "<I", len(ratings.providers))
    for provider in ratings.providers:
        put_text(raw, provider)
    put(raw, "<I", len(ratings.values))
    for value in ratings.values:
        put(raw, "<d", value)
    put(raw, "<I", 0)
    ratings.signature = key.sign(b"\x00\x01\x00\x00" + bytes(raw))


def put(raw, form, value):
    """Append a number, aligned to its size."""
    raw += bytes(-len(raw) % struct.calcsize(form)) + struct.pack(form, value)


def put_text(raw, text):
    """Append a text with its length."""
    encoded = text.encode() + b"\x00"
    put(raw, "<I", len(encoded))
    raw += encoded
