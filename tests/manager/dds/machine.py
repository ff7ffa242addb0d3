"""A machine for single nodes, without middleware, whose time passes in sleep and in waits for
messages only."""

import signal

from fake_wire import FakeWire

from roletrust_env import make_scenario
from roletrust_manager.admission import clock
from roletrust_manager.dds.nodes import agent_nodes
from roletrust_manager.dds.nodes.run_loop import Timeline
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.topics import IMAGES

PERIOD = 500_000_000
SHORT = make_scenario("paper-3x3").change(
    max_cycles=3, perturbations=[{"start": 2, "stop": 4}, {"start": 9, "stop": 11, "strength": 0.5}]
)


class Machine:
    """A machine whose time passes in sleep and in waits for messages only."""

    def __init__(self, monkeypatch):
        self.now, self.wire, self.lines, self.after = 0, FakeWire(), [], []
        monkeypatch.setattr(clock, "now", lambda: self.now)
        monkeypatch.setattr("roletrust_manager.dds.nodes.run_loop.time.sleep", self.pass_time)
        monkeypatch.setattr(agent_nodes, "Node", lambda *_, **__: self.wire)
        self.wire.wait = self.pass_time
        self.wire.writer = lambda *_: self

    def pass_time(self, seconds):
        self.now += max(1, round(seconds * 1e9))

    def write(self, message):
        """Publish a message, after which something may happen."""
        self.wire.sent.append(message)
        for act in [act for count, act in self.after if count == len(self.wire.sent)]:
            act()

    def runs(self, run, name, scenario=SHORT, **arguments):
        """Run a node and return the rounds of its messages."""
        given = {"timeline": Timeline(PERIOD, PERIOD), "report": self.lines.append, **arguments}
        run(name, scenario, **given)
        return [messages.stamp_of(message) // PERIOD - 1 for message in self.wire.sent]


def end():
    signal.raise_signal(signal.SIGTERM)


def send_pictures(machine, cameras, sends=lambda name, r: True, jpeg=b"jpeg"):
    """Let cameras send a picture in each round.

    Args:
        machine: Machine.
        cameras: Delay of the pictures of each camera, in periods.
        sends: Function that says whether a camera sends a picture in a round.
        jpeg: Picture.
    """
    machine.wire.announce(IMAGES, messages.IMAGE, *cameras)
    last = dict.fromkeys(cameras, 0)

    def wait(seconds):
        machine.pass_time(seconds)
        for name, delay in cameras.items():
            r = (machine.now - int(delay * PERIOD)) // PERIOD
            if r > last[name]:
                last[name] = r
                if sends(name, r):
                    picture = messages.encode(messages.picture_message(r * PERIOD, name, jpeg))
                    machine.wire.waiting[f"/{name}{IMAGES}"].append(picture)

    machine.wire.wait = wait
