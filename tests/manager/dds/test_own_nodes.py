"""The camera and the rater of the guide in plain rclpy, in a team with keys. Run by `make
test-ros2`."""

import contextlib
import time

import cv2
import numpy as np
import pytest
from domains import own_dds_domain
from guests import guest
from ros2_environment import HOUSE, ros2_environment

from roletrust_env import make_scenario
from roletrust_env.trust import make_trust_model
from roletrust_manager.admission.keys import make_keys
from roletrust_manager.admission.validation import MANAGER, RefusalReason
from roletrust_manager.dds.nodes.agent_nodes import run_camera_node, run_rater_node
from roletrust_manager.dds.nodes.manager_node import run_manager_node
from roletrust_manager.dds.nodes.run_loop import Timeline
from roletrust_manager.journal.lines import read_journal
from roletrust_manager.robots.processes import NodeProcesses
from roletrust_manager.team import Team

pytestmark = pytest.mark.ros2

NODES = HOUSE / "docs" / "guide" / "ros2"
PERIOD, ROUNDS = 500_000_000, 20
PATIENCE_S = 120
RULES = make_scenario("paper-3x3").change(perturbations=())
TEAM = Team(("sr_0", "sr_1", "sr_2"), ("sp_0", "sp_1", "sp_2"))


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Return the rounds of a team with nodes of the guide, and what its rater said while it had no
    key.

    `sp_2` and `sr_2` are the nodes of the guide; then `sr_1` is its rater without a key.
    """
    home, folder = ros2_environment(), tmp_path_factory.mktemp("own")
    make_keys(folder, [MANAGER, *TEAM.raters, *TEAM.providers])
    picture = np.random.default_rng(0).integers(0, 255, (240, 320, 3), np.uint8)
    cv2.imwrite(str(folder / "picture.jpg"), picture)
    journal, said, guests = folder / "journal", folder / "said", contextlib.ExitStack()

    def start(*command):
        with said.open("a") as lines:
            options = {"cwd": NODES, "env": home.environment(domain), "stderr": lines}
            return guests.enter_context(guest([home.python, *command], **options))

    def wait(holds):
        end = time.monotonic() + PATIENCE_S
        while not holds():
            assert time.monotonic() < end, said.read_text()
            nodes.check()
            time.sleep(0.5)

    with own_dds_domain() as domain, NodeProcesses() as nodes, guests:
        model = make_trust_model("role-trust")
        nodes.start(
            "manager",
            run_manager_node,
            model=model,
            journal=journal,
            period=PERIOD,
            team=TEAM,
            keys=folder,
        )
        nodes.start("sr_0", run_rater_node, name="sr_0", scenario=RULES, keys=folder)
        nodes.start("sp_0", run_camera_node, name="sp_0", scenario=RULES, keys=folder)
        nodes.ready()
        nodes.begin("manager")
        nodes.begin("sr_0", "sp_0", timeline=Timeline.aligned(PERIOD))
        start("camera.py", "sp_2", folder / "picture.jpg", folder / "sp_2.key")
        rater = start("rater.py", "sr_2", "sp_0,sp_2", folder / "sr_2.key")
        wait(lambda: rounds_of_both(journal) >= ROUNDS)
        rater.kill()
        start("rater.py", "sr_1", "sp_0,sp_2")
        wait(lambda: "sr_1: unsigned" in said.read_text())
    return list(read_journal(journal)), said.read_text()


def rounds_of_both(journal):
    """Return the number of rounds with our rater and full ratings of that of the guide.

    A rating is missing where a picture came after the end of its round.
    """
    there = journal.exists() and journal.stat().st_size
    return (
        sum("sr_0" in entry.ratings and rated_both(entry) for entry in read_journal(journal))
        if there
        else 0
    )


def rated_both(entry):
    """Return whether the rater of the guide rated both of its providers."""
    row = entry.ratings.get("sr_2")
    return row is not None and row[0] is not None and row[2] is not None


def test_ratings_of_the_rater_count(played):
    entries, _ = played
    rated = [entry.ratings["sr_2"] for entry in entries if rated_both(entry)]
    assert len(rated) >= ROUNDS
    assert all(0 < value <= 1 for row in rated for value in (row[0], row[2]))


def test_pictures_of_the_camera_are_rated(played):
    entries, _ = played
    place = TEAM.providers.index("sp_2")
    rated = [entry.ratings["sr_0"][place] for entry in entries if "sr_0" in entry.ratings]
    assert sum(value is not None for value in rated) >= ROUNDS


def test_ratings_without_a_signature_are_refused_and_the_rater_says_so(played):
    entries, said = played
    assert not any("sr_1" in entry.ratings for entry in entries)
    assert "sr_1: unsigned" in said
    assert not any(
        f"sr_2: {reason}" in said for reason in (RefusalReason.UNSIGNED, RefusalReason.MIS_SIGNED)
    )
