"""Killed processes: rounds continue, and no published trust is lost or changed."""

import functools
import itertools
import time

import numpy as np
import pytest
from loopback import Listener, Raters, keys, managed, own_domain, process, until
from manager_cases import replay_journal
from refusals import refuses

from roletrust_env import make_scenario
from roletrust_env.trust import make_trust_model
from roletrust_env.world.roster import Roster
from roletrust_manager.admission.keys import make_keys
from roletrust_manager.admission.validation import MANAGER
from roletrust_manager.dds.nodes.agent_nodes import run_camera_node, run_rater_node
from roletrust_manager.dds.nodes.manager_node import run_manager_node
from roletrust_manager.dds.nodes.run_loop import Timeline
from roletrust_manager.journal.lines import read_journal
from roletrust_manager.team import Team

pytestmark = pytest.mark.live
__all__ = ["keys", "own_domain"]

ROBOTS = make_scenario("paper-3x3").change(perturbations=())
PERIOD = 500_000_000


def write_report(path, line):
    """Write a report of a manager with its time, at which it begins to listen."""
    with path.open("a") as file:
        print(time.time_ns(), line, file=file)


def robots(folder):
    """Return functions that start the nodes of the paper's robots, by name."""
    roster, timeline = Roster.of(ROBOTS), Timeline(time.time_ns() // PERIOD * PERIOD, PERIOD)
    make_keys(folder / "keys", [MANAGER, *roster.rater_names, *roster.provider_names])
    report = functools.partial(write_report, folder / "reports")
    shared = {"scenario": ROBOTS, "timeline": timeline, "keys": folder / "keys"}
    starts = {
        "manager": functools.partial(
            managed, folder, period=PERIOD, team=Team(*axes(roster)), report=report
        )
    }
    for name in roster.rater_names:
        starts[name] = functools.partial(process, run_rater_node, name=name, **shared)
    for name in roster.provider_names:
        starts[name] = functools.partial(process, run_camera_node, name=name, **shared)
    return starts


def axes(roster):
    return roster.rater_names, roster.provider_names


def test_rounds_continue_when_nodes_are_killed_at_random_times(tmp_path):
    random, starts = np.random.default_rng(0), robots(tmp_path)
    pairs, downs, continued, reports = pairs_of(starts, random), [], 0, tmp_path / "reports"
    assert sum(map(len, pairs)) == 20
    with Listener() as listener:
        running = {name: start() for name, start in starts.items()}
        until(
            lambda: listener.heard and not listener.heard[-1][1].missing,
            "the team does not find each other",
        )
        for pair in pairs:
            for victim in pair:
                time.sleep(random.uniform(0, 2 * PERIOD / 1e9))
                running[victim].kill()
                running[victim].join()
                downs += [time.time_ns()] * (victim == "manager")
                running[victim] = starts[victim]()
            continued += "manager" in pair
            until(lambda: lines(reports) == continued, "it does not come back")  # noqa: B023
            listener.wait_for(4)
        for one in running.values():
            one.terminate()
            one.join()
    entries = list(read_journal(tmp_path / "journal"))
    listener.agrees_with(entries)
    assert (
        replay_journal(make_trust_model("role-trust"), tmp_path / "journal").trust
        == entries[-1].trust
    )
    ups = [int(line.split()[0]) for line in reports.read_text().splitlines() if "continues" in line]
    away = list(zip(downs, ups, strict=True))
    for last, entry in itertools.pairwise(entries):
        begun = max(
            [last.stamp, *(up for down, up in away if down <= entry.closed and up >= last.stamp)]
        )
        assert entry.stamp - begun <= 2 * PERIOD, (last.round, entry.missing)
    assert {name for entry in entries[-4:] for name in entry.ratings} == {"sr_0", "sr_1", "sr_2"}


def pairs_of(starts, random):
    """Return pairs of nodes to kill, one soon after the other: each node twice and the manager
    eight times."""
    others = [name for name in starts if name != "manager"]
    first, second = random.permutation(others).tolist(), random.permutation(others).tolist()
    managers = [
        ("manager", name) if random.random() < 0.5 else (name, "manager")
        for name in (*first, *second[:2])
    ]
    return random.permutation([*managers, second[2:4], second[4:]]).tolist()


def lines(path):
    return path.read_text().count("continues") if path.exists() else 0


def test_a_second_manager_is_refused_in_one_line(tmp_path, keys):
    with Raters(keys) as raters:
        first = managed(tmp_path)
        raters.wait_for(2)
        with refuses(ValueError, "/trust"):
            run_manager_node(
                make_trust_model("role-trust"), tmp_path / "other", period=PERIOD, keys=keys
            )
        assert not (tmp_path / "other").exists()
        raters.wait_for(2)
        first.terminate()
        first.join()


def test_one_of_two_managers_that_start_together_continues(tmp_path, keys):
    with Raters(keys) as raters:
        both = [managed(tmp_path, journal=tmp_path / name) for name in ("one", "other")]
        until(lambda: any(not one.is_alive() for one in both), "both go on")
        (alive,) = [one for one in both if one.is_alive()]
        raters.wait_for(4)
        assert alive.is_alive()
        alive.terminate()
        alive.join()
