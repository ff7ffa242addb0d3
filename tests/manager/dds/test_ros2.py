"""A team with a rater written for ROS 2, which interoperates with the other nodes. Run by `make
test-ros2`."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from domains import own_dds_domain
from guests import guest
from ros2_environment import ros2_environment

from roletrust_baselines import BadMouthing
from roletrust_env import make_scenario
from roletrust_env.trust import make_trust_model
from roletrust_env.world.group import AgentGroup
from roletrust_env.world.roster import Roster
from roletrust_manager.admission.keys import make_keys
from roletrust_manager.admission.validation import MANAGER
from roletrust_manager.dds.nodes.agent_nodes import run_camera_node, run_rater_node
from roletrust_manager.dds.nodes.manager_node import run_manager_node
from roletrust_manager.dds.nodes.run_loop import Timeline
from roletrust_manager.dds.wire import messages
from roletrust_manager.journal.lines import read_journal
from roletrust_manager.robots.processes import NodeProcesses
from roletrust_manager.team import Team

pytestmark = pytest.mark.ros2

PERIOD, ROUNDS, LEVEL = 500_000_000, 40, 0.2
SR, SP = AgentGroup(role="SR", count=5, noise=0.005), AgentGroup(role="SP", count=3)
RULES = make_scenario("paper-3x3").change(agents=(SR, SP), perturbations=(), max_cycles=2000)
TEAM = Team(Roster.of(RULES).rater_names, Roster.of(RULES).provider_names)
OURS, THEIRS = "sr_2", "sr_4"
MEMORY = 8
PEER = Path(__file__).parent / "clients" / "ros2.py"


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Return the rounds of a team, and the report of its ROS 2 rater."""
    home, folder = ros2_environment(), tmp_path_factory.mktemp("ros2")
    make_keys(folder, [MANAGER, *TEAM.raters, *TEAM.providers])
    journal, report = folder / "journal", folder / "report.json"
    with own_dds_domain() as domain, NodeProcesses() as nodes:
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
        for name in TEAM.raters[:-1]:
            policy = BadMouthing(level=LEVEL) if name == OURS else None
            nodes.start(name, run_rater_node, name=name, scenario=RULES, policy=policy, keys=folder)
        for name in TEAM.providers:
            nodes.start(name, run_camera_node, name=name, scenario=RULES, keys=folder)
        nodes.ready()
        command = [home.python, PEER, THEIRS, folder / f"{THEIRS}.key", LEVEL, ROUNDS, report]
        with guest(command, env=home.environment(domain)) as peer:
            nodes.begin("manager")
            nodes.begin(*TEAM.raters[:-1], *TEAM.providers, timeline=Timeline.aligned(PERIOD))
            assert peer.wait(300) == 0
        nodes.check()
    return list(read_journal(journal)), json.loads(report.read_text()), home


def test_it_lists_nodes_topics_and_types_with_true_hashes(played):
    _, report, home = played
    around = report["around"]
    nodes = {"/manager", *(f"/{name}/assess" for name in TEAM.raters)}
    assert nodes <= around["nodes"].keys()
    assert around["nodes"]["/manager"]["/trust"] == around["topics"]["/trust"] == [messages.TRUST]
    assert around["nodes"]["/manager"]["/diagnostics"] == [messages.DIAGNOSTICS]
    assert around["nodes"]["/manager"]["/sr_0/tor"] == [messages.NUMBER]
    published = {"/sr_0/ratings": [messages.RATINGS], "/diagnostics": [messages.DIAGNOSTICS]}
    assert around["nodes"]["/sr_0/assess"] == published
    for topic, kind in (("/trust", messages.TRUST), ("/sr_0/ratings", messages.RATINGS)):
        described = home.messages / "share" / f"{kind}.json"
        hashes = {
            one["type_name"]: one["hash_string"]
            for one in json.loads(described.read_text())["type_hashes"]
        }
        assert around["hashes"][topic] == [hashes[kind]]
    assert (
        around["hashes"][f"/{THEIRS}/ratings"] == around["hashes"]["/sr_0/ratings"]
    )  # published by ROS 2 and by this project


def test_it_receives_trust_and_pictures_without_loss(played):
    entries, report, _ = played
    rounds = [trust[0] for trust in report["trust"]]
    assert rounds == list(range(rounds[0], rounds[-1] + 1))
    assert len(rounds) >= ROUNDS
    by_round = {entry.round: entry.trust for entry in entries}
    for number, raters, tor, providers, top in report["trust"]:
        assert (raters, providers) == (list(TEAM.raters), list(TEAM.providers))
        assert (tuple(tor), tuple(top)) == (by_round[number].tor, by_round[number].top)
    mine, said = (
        [entry.trust.tor[TEAM.raters.index(THEIRS)] for entry in entries],
        report["numbers"],
    )
    assert len(said) >= ROUNDS
    assert any(mine[start : start + len(said)] == said for start in range(len(mine)))
    for camera in TEAM.providers:
        stamps = [stamp for stamp, *_ in report["images"][camera]]
        assert {after - before for before, after in pairwise(stamps)} == {PERIOD}
        assert len(stamps) > 0.8 * ROUNDS
        assert {(start, kind) for _, start, kind in report["images"][camera]} == {("ffd8", "jpeg")}


def test_its_trust_equals_that_of_our_own_rater(played):
    entries, *_ = played
    assert all(set(entry.ratings.get(THEIRS, [LEVEL])) == {LEVEL} for entry in entries)
    both = [OURS in entry.ratings and THEIRS in entry.ratings for entry in entries]
    assert np.mean(both[both.index(True) :]) > 0.9, [entry.missing for entry in entries]
    tor = np.array([entry.trust.tor for entry in entries])
    ours, theirs = TEAM.raters.index(OURS), TEAM.raters.index(THEIRS)
    long = [
        k for k in range(MEMORY, len(both)) if all(both[k - MEMORY : k + 1])
    ]  # long enough after a missing rating that it has no effect
    assert len(long) > ROUNDS / 4
    np.testing.assert_allclose(tor[long, theirs], tor[long, ours], rtol=0, atol=0.01)
    assert tor[-1, theirs] < tor[-1, 0] - 0.1
