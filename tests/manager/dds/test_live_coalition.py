"""Members of a trained coalition as nodes of a team with real people detection. Run by `make
test-live`."""

import time

import numpy as np
import pytest
from domains import own_dds_domain

from roletrust_env import make_scenario
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.trust import make_trust_model
from roletrust_manager.admission.keys import make_keys
from roletrust_manager.admission.validation import MANAGER
from roletrust_manager.dds.nodes.agent_nodes import run_camera_node, run_rater_node
from roletrust_manager.dds.nodes.manager_node import run_manager_node
from roletrust_manager.dds.nodes.run_loop import Timeline
from roletrust_manager.journal.lines import read_journal
from roletrust_manager.robots.processes import NodeProcesses
from roletrust_manager.team import Team

pytestmark = pytest.mark.live

PERIOD, ROUNDS, PATIENCE_S = 500_000_000, 12, 120
RULES = make_scenario("paper-3x3").change(perturbations=())
TEAM = Team(("sr_0", "sr_1", "sr_2"), ("sp_0", "sp_1", "sp_2"))
ATTACKS = [
    "sr_2=learned:path=universal-raters",
    "sp_2=learned:path=universal-providers,accomplices=[sp_2]",
]


def test_a_trained_rater_lies_and_loses_its_trust_beside_a_trained_camera(tmp_path):
    policies, journal = parse_attacks(ATTACKS, RULES), tmp_path / "journal"
    make_keys(tmp_path, [MANAGER, *TEAM.raters, *TEAM.providers])
    with own_dds_domain(), NodeProcesses() as nodes:
        model = make_trust_model("role-trust")
        nodes.start(
            "manager",
            run_manager_node,
            model=model,
            journal=journal,
            period=PERIOD,
            team=TEAM,
            keys=tmp_path,
        )
        for names, run in ((TEAM.raters, run_rater_node), (TEAM.providers, run_camera_node)):
            for name in names:
                nodes.start(
                    name, run, name=name, scenario=RULES, policy=policies.get(name), keys=tmp_path
                )
        nodes.ready()
        nodes.begin("manager")
        nodes.begin(*TEAM.raters, *TEAM.providers, timeline=Timeline.aligned(PERIOD))
        end = time.monotonic() + PATIENCE_S
        while len(complete := complete_rounds(journal)) < ROUNDS:
            assert time.monotonic() < end, f"{len(complete)} rounds of all raters"
            nodes.check()
            time.sleep(0.2)
    truth, lies = (
        np.array([entry.ratings[name] for entry in complete]) for name in ("sr_0", "sr_2")
    )
    assert truth.min() > 0.7  # the camera, too, serves well in this small team
    assert np.median(lies) < 0.1
    assert complete[-1].trust.tor[2] < complete[-1].trust.tor[0] - 0.2


def complete_rounds(journal):
    """Return the rounds in which each rater has rated each camera."""
    if not journal.exists() or not journal.stat().st_size:
        return []
    entries = read_journal(journal)
    return [
        entry
        for entry in entries
        if all(None not in entry.ratings.get(name, [None]) for name in TEAM.raters)
    ]
