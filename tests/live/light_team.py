"""Robots that cost next to nothing: a camera with a picture of one colour, a rater that looks at none."""

import multiprocessing
import time

import cv2
import numpy as np

from roletrust_env.live.nodes.run_loop import run_until_signal
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node
from roletrust_env.live.wire.keys import Signer


def run_robots(places, providers, keys, period):
    """Be the robots of some places, a camera `sp_k` and a rater `sr_k` each, until told to stop."""
    node, signers = Node("robots", f"/robots_{places[0]}"), {k: Signer(keys, f"sr_{k}") for k in places}
    cameras = {k: node.writer(f"/sp_{k}/image_raw/compressed", messages.IMAGE) for k in places}
    raters = {k: node.writer(f"/sr_{k}/ratings", messages.RATINGS) for k in places}
    random = np.random.default_rng(places[0])
    with run_until_signal() as active:
        while active:
            stamp = (time.time_ns() // period + 1) * period
            active.sleep_until(stamp)
            for k in places:
                shade = np.full((48, 64, 3), random.integers(256), np.uint8)
                cameras[k].write(messages.image_message(stamp, f"sp_{k}", cv2.imencode(".jpg", shade)[1]))
                notes = {name: float(random.uniform(0.3, 1)) for name in providers}
                signature = signers[k].sign(messages.encode(messages.ratings_message(f"sr_{k}", stamp, notes)))
                raters[k].write(messages.ratings_message(f"sr_{k}", stamp, notes, signature))


def started(run, *args, **kwargs):
    """A function in a process of its own."""
    process = multiprocessing.get_context("spawn").Process(target=run, args=args, kwargs=kwargs, daemon=True)
    process.start()
    return process
