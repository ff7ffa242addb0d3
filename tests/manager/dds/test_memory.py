"""The memory of a manager on real middleware, and of agents by an injected clock. Run by `make
test-soak`."""

import gc
import os
import time
from statistics import median

import cv2
import numpy as np
import pytest
from loopback import team
from machine import Machine, end, send_pictures
from process_load import memory_mb

from roletrust_env.world.vision.frames import open_frames
from roletrust_manager.dds.nodes.agent_nodes import run_camera_node, run_rater_node
from roletrust_manager.dds.wire import messages

pytestmark = pytest.mark.soak
__all__ = ["team"]


def test_a_manager_does_not_grow(team):
    """The growth is that of the median from the first half minute to the second."""
    taken, before = [], len(team.heard)
    for _ in range(120):
        time.sleep(0.5)
        taken.append(memory_mb(team.manager.pid))
    grown = median(taken[60:]) - median(taken[:60])
    print(f"{len(team.heard) - before} rounds: {taken[-1]:.0f} MB, grown by {grown:.2f} MB")
    assert len(team.heard) - before > 200
    assert grown < 0.1


class LastMessage(list):
    """Messages of which only the last is kept."""

    count = 0

    def append(self, message):
        self.count += 1
        self[:] = [message]

    def __len__(self):
        return self.count


@pytest.mark.parametrize(
    ("run", "name", "rounds"), [(run_camera_node, "sp_0", 6000), (run_rater_node, "sr_0", 1800)]
)
def test_an_agent_does_not_grow(run, name, rounds, monkeypatch):
    """A camera on the rendered scene, and a rater of three cameras, one of which is away for a
    while."""
    machine, taken = Machine(monkeypatch), []
    machine.wire.sent = LastMessage()
    picture = open_frames(None, duration_s=1.0, period_s=0.5).frame(0, 0.0, 0.0)
    jpeg = cv2.imencode(".jpg", np.ascontiguousarray(picture[..., ::-1]))[1].tobytes()
    send_pictures(
        machine,
        dict.fromkeys(("sp_0", "sp_1", "sp_2"), 0.0),
        lambda camera, r: camera != "sp_2" or not 300 < r < 900,
        jpeg,
    )

    def measure():
        gc.collect()
        taken.append(memory_mb(os.getpid()))

    machine.after = [(rounds // 6, measure), (rounds, measure), (rounds + 1, end)]
    write = machine.write
    machine.write = lambda message: (
        None if message.__msgtype__ == messages.DIAGNOSTICS else write(message)
    )
    machine.runs(run, name)
    grown = taken[1] - taken[0]
    print(
        f"{rounds} rounds of {name}: {taken[1]:.0f} MB, grown by {grown:.2f} MB in the last "
        f"{rounds - rounds // 6}"
    )
    assert grown < 1
