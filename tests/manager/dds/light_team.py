"""Robots with little load: cameras with pictures of one colour, and raters that do not look at
them."""

import time

import cv2
import numpy as np

from roletrust_manager.admission.keys import Signer
from roletrust_manager.dds.nodes.run_loop import run_until_signal
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.dds import Node


def run_robots(places, providers, keys, period):
    """Run a camera `sp_k` and a rater `sr_k` for each index until a signal ends the process."""
    node, signers = (
        Node("robots", f"/robots_{places[0]}"),
        {k: Signer(keys, f"sr_{k}") for k in places},
    )
    cameras = {k: node.writer(f"/sp_{k}/image_raw/compressed", messages.IMAGE) for k in places}
    raters = {k: node.writer(f"/sr_{k}/ratings", messages.RATINGS) for k in places}
    random = np.random.default_rng(places[0])
    with run_until_signal() as active:
        while active:
            stamp = (time.time_ns() // period + 1) * period
            active.sleep_until(stamp)
            for k in places:
                shade = np.full((48, 64, 3), random.integers(256), np.uint8)
                jpeg = cv2.imencode(".jpg", shade)[1].tobytes()
                cameras[k].write(
                    messages.picture_message(stamp, f"sp_{k}", jpeg, Signer(keys, f"sp_{k}"))
                )
                ratings = {name: float(random.uniform(0.3, 1)) for name in providers}
                raters[k].write(messages.ratings_message(f"sr_{k}", stamp, ratings, signers[k]))
