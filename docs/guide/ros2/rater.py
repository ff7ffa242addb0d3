"""A rater in plain rclpy: `python rater.py NAME CAMERA,CAMERA,... [KEY]`."""

import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from roletrust_msgs.msg import Ratings
from sensor_msgs.msg import CompressedImage
from signing import read_key, sign_ratings

DEADLINE_S = 0.2  # after the first picture of a round; the manager waits 0.35 s for ratings


class Rater(Node):
    """Rates each round when its pictures have arrived or are too late, and logs what the manager
    refuses.
    """

    def __init__(self, name, cameras, key=None):
        super().__init__("assess", namespace=f"/{name}")
        self._name, self._cameras, self._key = name, cameras.split(","), key and read_key(key)
        self._rounds, self._last = (
            {},
            (0, 0),
        )  # open rounds by their stamps, and the last one that was rated
        self._ratings = self.create_publisher(Ratings, "ratings", 10)
        self.create_timer(DEADLINE_S / 4, self.rate)
        for camera in self._cameras:
            topic = f"/{camera}/image_raw/compressed"
            self.create_subscription(
                CompressedImage, topic, lambda image, camera=camera: self.look(camera, image), 10
            )
        self.create_subscription(DiagnosticArray, "/diagnostics", self.hear, 10)

    def look(self, camera, image):
        """Rate a picture: here by the size of its JPEG, since a blurred picture has a small one."""
        stamp = image.header.stamp.sec, image.header.stamp.nanosec
        if stamp > self._last:
            _, seen = self._rounds.setdefault(stamp, (time.monotonic(), {}))
            seen[camera] = min(1.0, len(image.data) / 50_000)
            self.rate()

    def rate(self):
        """Rate the newest round that has all pictures or is due; older ones are over by then."""
        for stamp, (began, seen) in sorted(self._rounds.items(), reverse=True):
            if len(seen) == len(self._cameras) or time.monotonic() > began + DEADLINE_S:
                ratings = Ratings(
                    rater=self._name, providers=list(seen), values=list(seen.values())
                )
                ratings.header.stamp.sec, ratings.header.stamp.nanosec = stamp
                if self._key:
                    sign_ratings(ratings, self._key)
                self._ratings.publish(ratings)
                self._last = stamp
                self._rounds = {later: one for later, one in self._rounds.items() if later > stamp}
                return

    def hear(self, diagnostics):
        """Log the refusals of this rater's messages."""
        counts = [f"{pair.key}: {pair.value}" for pair in diagnostics.status[0].values]
        if refused := [count for count in counts if count.startswith(f"{self._name}: ")]:
            self.get_logger().warning(f"refused: {', '.join(refused)}", throttle_duration_sec=10)


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(Rater(*sys.argv[1:]))
