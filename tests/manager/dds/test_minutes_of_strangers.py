"""Minutes of the paper's team without keys, among many unknown cameras. Run by `make test-soak`."""

import numpy as np
import pytest
from loopback import Listener, managed, own_domain, process, until
from process_load import cpu_s
from test_strange_cameras import strange_cameras

from roletrust_env import make_scenario
from roletrust_env.world.roster import Roster
from roletrust_manager.admission.validation import MAX_STRANGERS
from roletrust_manager.dds.nodes.agent_nodes import run_camera_node, run_rater_node
from roletrust_manager.dds.nodes.run_loop import Timeline
from roletrust_manager.journal.lines import read_journal
from roletrust_manager.team import Team

pytestmark = pytest.mark.soak
__all__ = ["own_domain"]

SCENARIO = make_scenario("paper-3x3").change(perturbations=())
TEAM = Team(Roster.of(SCENARIO).rater_names, Roster.of(SCENARIO).provider_names)
PERIOD, MINUTE = 500_000_000, 120  # nanoseconds, and rounds


def test_unknown_cameras_make_no_rating_late(tmp_path):
    shared = {"scenario": SCENARIO, "timeline": Timeline.aligned(PERIOD)}
    manager = managed(tmp_path, period=PERIOD, team=TEAM, keys=None)
    for name in TEAM.providers:
        process(run_camera_node, name=name, **shared)
    raters = [process(run_rater_node, name=name, **shared) for name in TEAM.raters]
    phases = []

    def measure(what, rounds):
        first, before = (
            len(listener.heard),
            np.array([cpu_s(one.pid) for one in (*raters, manager)]),
        )
        listener.wait_for(rounds)
        spent = (np.array([cpu_s(one.pid) for one in (*raters, manager)]) - before) / rounds
        phases.append((what, listener.heard[first][1].round, listener.heard[-1][1].round, spent))

    with Listener() as listener:
        until(
            lambda: listener.heard and not listener.heard[-1][1].missing,
            "the team does not find each other",
        )
        measure("before", MINUTE // 2)
        for count in (12, 200):
            stranger = process(strange_cameras, count=count, period=PERIOD)
            measure(f"{count} cameras", MINUTE)
            stranger.kill()
            stranger.join()
            measure("after", MINUTE // 2)
    entries = list(read_journal(tmp_path / "journal"))
    listener.agrees_with(entries)
    usual = phases[0][3]
    for what, first, last, spent in phases:
        rounds = entries[first : last + 1]
        ages = [(entry.closed - entry.stamp) / 1e6 for entry in rounds]
        print(
            f"{what}: {len(rounds)} rounds, closed {max(ages):.0f} ms after their stamp at most; "
            "CPU time a round of"
        )
        print("  raters and manager:", ", ".join(f"{one * 1000:.0f} ms" for one in spent))
        assert [entry.round for entry in rounds if set(entry.ratings) != set(TEAM.raters)] == []
        assert np.diff([entry.stamp for entry in rounds]).max() == PERIOD
        assert (spent[:3] < 1.1 * usual[:3] + 0.005).all()
    assert len(entries[-1].team.providers) <= len(TEAM.providers) + MAX_STRANGERS
