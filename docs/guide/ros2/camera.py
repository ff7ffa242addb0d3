"""A camera in plain rclpy: `python camera.py NAME PICTURE.jpg [KEY]`."""

import sys
import time
from array import array
from pathlib import Path

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage
from signing import read_key, sign_picture

PERIOD_S = 0.5


class Camera(Node):
    """Publishes a picture in each round."""

    def __init__(self, name, picture, key=None):
        super().__init__("cam", namespace=f"/{name}")
        self._topic, self._key = f"/{name}/image_raw/compressed", key and read_key(key)
        self._jpeg, self._pictures = (
            Path(picture).read_bytes(),
            self.create_publisher(CompressedImage, self._topic, 10),
        )

        self.wait()

    def wait(self):
        """Wait for the next round; rounds begin at whole periods, for all cameras."""
        time.sleep(-time.time() % PERIOD_S)

    def publish(self):
        """Publish the picture with the stamp of the round."""
        image = CompressedImage(format="jpeg", data=array("B", self._jpeg))
        stamp_ns = round(time.time() / PERIOD_S) * round(PERIOD_S * 1e9)
        image.header.stamp.sec, image.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        if self._key:
            sign_picture(self._topic, image, self._key)
        self._pictures.publish(image)


if __name__ == "__main__":
    rclpy.init()
    camera = Camera(*sys.argv[1:])
    while rclpy.ok():  # a timer of ROS 2 would keep the delay of a busy machine
        camera.publish()
        camera.wait()
