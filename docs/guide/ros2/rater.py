"""A rater in plain rclpy: `python rater.py NAME CAMERA,CAMERA,... [KEY]`."""

import sys
from collections import defaultdict

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from roletrust_msgs.msg import Ratings
from sensor_msgs.msg import CompressedImage
from signing import read_key, sign_ratings


class Rater(Node):
    """Rates each round when the pictures of all cameras have arrived, and logs what the manager refuses."""

    def __init__(self, name, cameras, key=None):
        super().__init__("assess", namespace=f"/{name}")
        self._name, self._cameras, self._key = name, cameras.split(","), key and read_key(key)
        self._rounds, self._ratings = defaultdict(dict), self.create_publisher(Ratings, "ratings", 10)
        for camera in self._cameras:
            topic = f"/{camera}/image_raw/compressed"
            self.create_subscription(CompressedImage, topic, lambda image, camera=camera: self.look(camera, image), 10)
        self.create_subscription(DiagnosticArray, "/diagnostics", self.hear, 10)

    def look(self, camera, image):
        """Rate a picture: here by the size of its JPEG, since a blurred picture has a small one."""
        seen = self._rounds[image.header.stamp.sec, image.header.stamp.nanosec]
        seen[camera] = min(1.0, len(image.data) / 50_000)
        if len(seen) == len(self._cameras):
            ratings = Ratings(rater=self._name, providers=list(seen), values=list(seen.values()))
            ratings.header.stamp = image.header.stamp
            if self._key:
                sign_ratings(ratings, self._key)
            self._ratings.publish(ratings)
            self._rounds.clear()

    def hear(self, diagnostics):
        """Log the refusals of this rater's messages."""
        counts = [f"{pair.key}: {pair.value}" for pair in diagnostics.status[0].values]
        if refused := [count for count in counts if count.startswith(f"{self._name}: ")]:
            self.get_logger().warning(f"refused: {', '.join(refused)}", throttle_duration_sec=10)


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(Rater(*sys.argv[1:]))
