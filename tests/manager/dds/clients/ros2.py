"""A rater for ROS 2, written with rclpy alone, which also lists nodes and topics. It needs a Python
with ROS 2.

`python ros2.py NAME KEY LEVEL ROUNDS REPORT` runs the rater NAME. It signs with that key and rates
every camera LEVEL. After that many rounds it writes the received messages and the visible nodes and
topics to the report.
"""

import json
import struct
import sys
import time
from collections import defaultdict
from pathlib import Path

import rclpy
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from rclpy.node import Node
from roletrust_msgs.msg import Ratings, Trust
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Float64

CAMERAS = ("sp_0", "sp_1", "sp_2")
PATIENCE_S = 240.0


class Assess(Node):
    """The rater, with ROS 2's default qualities of service."""

    def __init__(self, name, key, level):
        super().__init__("assess", namespace=f"/{name}")
        self._name, self._key, self._level = (
            name,
            load_pem_private_key(key.read_bytes(), password=None),
            level,
        )
        self._seen = defaultdict(set)
        self._voice = self.create_publisher(Ratings, "ratings", 10)
        self.images, self.trust, self.numbers = defaultdict(list), [], []
        for camera in CAMERAS:
            topic = f"/{camera}/image_raw/compressed"
            self.create_subscription(
                CompressedImage, topic, lambda image, camera=camera: self.look(camera, image), 10
            )
        self.create_subscription(Trust, "/trust", self.hear, 10)
        self.create_subscription(
            Float64, f"/{name}/tor", lambda number: self.numbers.append(number.data), 10
        )

    def look(self, camera, image):
        """Rate a round when its last picture has arrived."""
        stamp = image.header.stamp.sec * 10**9 + image.header.stamp.nanosec
        self.images[camera].append([stamp, bytes(image.data[:2]).hex(), image.format])
        self._seen[stamp].add(camera)
        if self._seen[stamp] == set(CAMERAS):
            message = Ratings(
                rater=self._name, providers=CAMERAS, values=[self._level] * len(CAMERAS)
            )
            message.header.stamp = image.header.stamp
            message.signature = self._key.sign(to_sign(message))
            self._voice.publish(message)

    def hear(self, trust):
        self.trust.append(
            [
                trust.round,
                list(trust.raters),
                list(trust.tor),
                list(trust.providers),
                list(trust.top),
            ]
        )

    def around(self):
        """Return the nodes, the topics and types, and the hashes of the types that ROS 2 sees."""
        topics = dict(self.get_topic_names_and_types())
        nodes = self.get_node_names_and_namespaces()
        ends = {topic: self.get_publishers_info_by_topic(topic) for topic in topics}
        return {
            "topics": topics,
            "hashes": {
                topic: sorted({str(end.topic_type_hash) for end in found})
                for topic, found in ends.items()
            },
            "nodes": {
                f"{namespace.rstrip('/')}/{name}": dict(
                    self.get_publisher_names_and_types_by_node(name, namespace)
                )
                for name, namespace in nodes
            },
        }


def to_sign(message):
    """Return the bytes of `Ratings` to sign: CDR without a signature, padded with zeros.

    The padding of rclpy's own serialization has arbitrary bytes.
    """
    stamp, providers = message.header.stamp, message.providers
    raw = bytearray(struct.pack("<iI", stamp.sec, stamp.nanosec))
    put_text(raw, message.header.frame_id)
    put_text(raw, message.rater)
    put(raw, 4, "<I", len(providers))
    for provider in providers:
        put_text(raw, provider)
    put(raw, 4, "<I", len(message.values))
    for value in message.values:
        put(raw, 8, "<d", value)
    put(raw, 4, "<I", 0)
    return b"\x00\x01\x00\x00" + bytes(raw)


def put_text(raw, text):
    encoded = text.encode() + b"\x00"
    put(raw, 4, "<I", len(encoded))
    raw += encoded


def put(raw, align, form, value):
    raw += bytes(-len(raw) % align) + struct.pack(form, value)


def main(name, key, level, rounds, report):
    rclpy.init()
    node = Assess(name, Path(key), float(level))
    end = time.monotonic() + PATIENCE_S
    while min(len(node.trust), len(node.numbers)) < int(rounds) and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    found = {
        "around": node.around(),
        "images": node.images,
        "trust": node.trust,
        "numbers": node.numbers,
    }
    Path(report).write_text(json.dumps(found), encoding="utf-8")
    rclpy.shutdown()


if __name__ == "__main__":
    main(*sys.argv[1:])
