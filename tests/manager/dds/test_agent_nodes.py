"""Cameras and raters as nodes that do not end by themselves, by a clock that a test moves, without
middleware."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import cv2
import numpy as np
import pytest
from machine import PERIOD, SHORT, Machine, end, send_pictures
from typer.testing import CliRunner

from roletrust_env import Policy
from roletrust_experiments.cli import app
from roletrust_manager.dds.nodes import agent_nodes
from roletrust_manager.dds.nodes.agent_nodes import run_camera_node, run_rater_node
from roletrust_manager.dds.wire import messages

GUIDE = Path(__file__).parents[3] / "docs" / "guide" / "ros2"


@pytest.fixture
def machine(monkeypatch):
    return Machine(monkeypatch)


@pytest.fixture
def frames(tmp_path):
    for k in range(4):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.full((240, 320, 3), 60 * k, np.uint8))
    return tmp_path


@pytest.mark.parametrize("own", [True, False], ids=["of the scenario", "of the node"])
def test_a_camera_goes_on_after_the_rounds_of_its_scenario(own, machine, frames):
    machine.after = [(40, end)]
    theirs = SHORT.change(service="hog", frames=str(frames), playback="once")
    given = {"scenario": theirs} if own else {"frames": frames}
    assert machine.runs(run_camera_node, "sp_0", **given) == list(range(40))
    assert machine.lines == ["sp_0: runs until Ctrl-C"]
    pictures = [bytes(message.data) for message in machine.wire.sent]
    assert pictures[12] == pictures[16] != pictures[13]


def test_disturbances_come_once_also_after_the_rounds_of_the_scenario(machine, monkeypatch):
    seen = []

    class Source:
        def frame(self, camera, time_s, strength):
            seen.append(strength)
            return np.zeros((240, 320, 3), np.uint8)

    monkeypatch.setattr(agent_nodes, "open_frames", lambda *_, **__: Source())
    machine.after = [(20, end)]
    machine.runs(run_camera_node, "sp_0")
    assert {k: strength for k, strength in enumerate(seen[:20]) if strength} == {
        2: 1.0,
        3: 1.0,
        9: 0.5,
        10: 0.5,
    }


def test_a_camera_that_stood_still_goes_on_with_the_present_round(machine, frames):
    """A suspended machine or a clock that is set forward; a picture of each lost round once blocked
    the camera."""

    def stand_still():
        machine.now += 7200 * PERIOD

    machine.after = [(3, stand_still), (6, end)]
    played = machine.runs(run_camera_node, "sp_0", frames=frames)
    assert played == [0, 1, 2, 7202, 7203, 7204]


def test_a_policy_plays_in_all_rounds(machine, frames):
    qualities = []

    class Later(Policy):
        def quality(self, view, memory, random):
            qualities.append(int(view.round))
            return np.asarray(1.0), memory

    machine.after = [(10, end)]
    machine.runs(run_camera_node, "sp_0", frames=frames, policy=Later())
    assert qualities[:10] == list(range(10))


class Detector:
    """Sees the same in every picture."""

    def __init__(self, *_):
        pass

    def probability(self, jpeg):
        return 0.5


@pytest.mark.parametrize("back", [1, 4, 40])
@pytest.mark.parametrize("late", [0.0, 0.3])
def test_the_first_picture_of_a_camera_that_is_back_is_rated(late, back, machine, monkeypatch):
    """It is the last one of its round; the rater has no ratings of the camera before its first one,
    either."""
    monkeypatch.setattr(agent_nodes, "PersonDetector", Detector)
    rounds = 10 + back

    def sends(name, r):
        if r > rounds:
            end()
        return name != "sp_2" or not 3 < r <= 3 + back

    send_pictures(machine, {"sp_0": 0.0, "sp_1": 0.0, "sp_2": late}, sends)
    machine.runs(run_rater_node, "sr_0")
    ratings = [message for message in machine.wire.sent if message.__msgtype__ == messages.RATINGS]
    rated = {messages.stamp_of(message) // PERIOD: len(message.providers) for message in ratings}
    assert rated == {r: 2 if 3 < r <= 3 + back else 3 for r in range(1, rounds + 1)}


@pytest.mark.parametrize(
    ("name", "kind", "speed"), [("sp_0", messages.IMAGE, 2), ("sr_0", messages.RATINGS, 1)]
)
def test_the_command_runs_until_a_signal(name, kind, speed, machine):
    send_pictures(machine, {"sp_0": 0.0, "sp_1": 0.0, "sp_2": 0.0})
    machine.after = [(4, end)]
    settings = ["--set", f"speed={speed}", "--set", "seed=1"]
    done = CliRunner().invoke(app, ["robots", "agent", name, *settings])
    assert done.exit_code == 0, done.output
    stamps = [messages.stamp_of(one) for one in machine.wire.sent if one.__msgtype__ == kind]
    assert np.diff(stamps).tolist() == [PERIOD // speed] * (len(stamps) - 1)
    assert len(stamps) > 1


@pytest.fixture
def guide_rater(monkeypatch):
    """Return the rater of the guide, with stand-ins for ROS 2, its ratings, and a function that
    sets its clock."""
    sent, now = [], [0.0]

    class Node:
        def __init__(self, *_, **__):
            pass

        def create_publisher(self, *_):
            return SimpleNamespace(publish=sent.append)

        def create_subscription(self, *_):
            pass

        create_timer = create_subscription

    def ratings(**fields):
        return SimpleNamespace(header=SimpleNamespace(stamp=SimpleNamespace()), **fields)

    modules = {
        "rclpy": {},
        "rclpy.node": {"Node": Node},
        "roletrust_msgs": {},
        "roletrust_msgs.msg": {},
    }
    modules |= {
        name: {}
        for name in ("diagnostic_msgs", "diagnostic_msgs.msg", "sensor_msgs", "sensor_msgs.msg")
    }
    modules["roletrust_msgs.msg"]["Ratings"] = ratings
    modules["diagnostic_msgs.msg"]["DiagnosticArray"] = modules["sensor_msgs.msg"][
        "CompressedImage"
    ] = None
    modules["signing"] = {"read_key": None, "sign_ratings": None}
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location("guide_rater", GUIDE / "rater.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    return module.Rater("sr_7", "sp_0,sp_1"), sent, now


def test_the_rater_of_the_guide_goes_on_without_a_camera(guide_rater):
    """It once rated nothing more, and kept each picture for good."""
    rater, sent, now = guide_rater

    def look(camera, r):
        rater.look(
            camera,
            SimpleNamespace(
                header=SimpleNamespace(stamp=SimpleNamespace(sec=r, nanosec=0)), data=b"1"
            ),
        )

    for r in range(1, 1001):
        now[0] = r + 0.0
        look("sp_0", r)
        if not 10 <= r < 990:
            look("sp_1", r)
        now[0] = r + 0.21
        rater.rate()
        look("sp_1", r)  # too late, or for the second time
    assert [ratings.header.stamp.sec for ratings in sent] == list(range(1, 1001))
    assert sum(len(ratings.providers) for ratings in sent) == 2000 - 980
    assert not rater._rounds
