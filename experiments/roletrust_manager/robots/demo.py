"""The paper's three robots as processes on this machine, next to a simulation of the same run."""

import math
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from roletrust_env import Game, JointPolicy, Policy, make_scenario
from roletrust_env.evaluation.curves import Curves, record_curves
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.parameters import whole_number
from roletrust_env.storage.files import prepare_folder
from roletrust_env.world.vision.detector import best_margin, detector_view
from roletrust_env.world.vision.frames import open_frames
from roletrust_manager.admission import clock
from roletrust_manager.admission.keys import make_keys
from roletrust_manager.admission.validation import MANAGER
from roletrust_manager.dds.nodes.agent_nodes import run_camera_node, run_rater_node
from roletrust_manager.dds.nodes.manager_node import run_manager_node
from roletrust_manager.dds.nodes.recorder_node import run_recorder_node
from roletrust_manager.dds.nodes.run_loop import (
    SECOND,
    SLOWEST,
    Timeline,
    print_line,
    round_period,
)
from roletrust_manager.journal.lines import JournalEntry, read_journal
from roletrust_manager.page.browser import open_page
from roletrust_manager.robots.processes import NodeProcesses
from roletrust_manager.team import Team

SCENARIO = make_scenario("paper-3x3-hog")
"""Scenario of the demo."""

_PORT = 5006
_DISCOVERY_S = 4.0  # nodes find each other within that time
_POLL_S = 0.25
_LAST_PERIODS = 4  # the last rounds close within them
_TRIALS = 8
_HEADROOM = 2.5  # least ratio of a round to the time for its pictures; other processes need some
_WINDOW = 20  # number of the last rounds that show whether rounds keep up
_LATE = 3  # rounds until one is certainly closed

Progress = Callable[[str, float], object]


class DemoResult(NamedTuple):
    """What a demo has measured.

    Attributes:
        speed: Speed of the run relative to the scenario's clock.
        rounds: Rounds in the journal of the manager.
        measured: Curves of the team. Rewards and delivered quality are not known, NaN.
        simulated: Curves of a simulation of the same run.
    """

    speed: float
    rounds: list[JournalEntry]
    measured: Curves
    simulated: Curves

    @property
    def partial(self) -> int:
        """Number of rounds in which a rater is missing."""
        return sum(bool(entry.missing) for entry in self.rounds)

    @property
    def delays_ms(self) -> list[float]:
        """Times from the picture to the resulting trust in complete rounds, milliseconds."""
        return [(entry.closed - entry.stamp) / 1e6 for entry in self.rounds if not entry.missing]


def run_demo(
    out: Path,
    policies: Mapping[str, Policy],
    *,
    speed: float = 1.0,
    seed: int = 0,
    view: bool = True,
    report: Callable[[str], object] = print_line,
    progress: Progress = lambda stage, share: None,
) -> DemoResult:
    """Run the paper's team as seven processes on DDS, and simulate the same run.

    Args:
        out: Folder for `journal.jsonl`, `recording` and `keys`; an earlier journal and recording
            are replaced.
        policies: Policies of the attackers, by the names of agents.
        speed: Speed relative to the scenario's clock, from 0.1 to 20; a slow machine lowers it.
        seed: Random seed of the noise in pictures and on links, 0 or more.
        view: Whether the browser shows a page of the run.
        report: Function that shows a line to the user.
        progress: Function of the stage of the work and of its share that is done, in [0, 1].

    Raises:
        ValueError: The speed or the seed is not allowed, this machine is too slow, a process has
            failed, or most of the last rounds lack a rater.
        OSError: The folder cannot be written.
    """
    round_period(SCENARIO.period_s, speed)
    seed = whole_number("seed", seed)
    prepare_folder(out)
    speed = _possible_speed(speed, report)
    timeline = _run_team(out, policies, speed, seed, view, report, progress)
    rounds = [
        entry
        for entry in read_journal(out / "journal.jsonl")
        if timeline.round(entry.stamp) < SCENARIO.max_cycles
    ]
    return DemoResult(
        speed, rounds, _measured(rounds, timeline), _simulated(policies, seed, progress)
    )


def _possible_speed(speed: float, report: Callable[[str], object]) -> float:
    """Return the speed at which this machine is fast enough, and say if it is lower."""
    team, period_s = Team.of(SCENARIO), SCENARIO.period_s
    work = _work_s(len(team.raters), len(team.providers))
    possible = math.floor(100 * period_s / (_HEADROOM * work)) / 100
    if possible >= speed:
        return speed
    slow = (
        "this machine is too slow, or too busy: raters take "
        f"{work:.2g} s for the pictures of a round"
    )
    if possible < SLOWEST:
        longest_s = period_s / SLOWEST / _HEADROOM
        raise ValueError(f"{slow}, and it must be {longest_s:.2g} s or less")
    report(f"{slow}. A round takes {period_s / possible:.2g} s, with speed {possible:g}.")
    return possible


def _work_s(raters: int, providers: int) -> float:
    """Return the longest time in seconds, of a few trials, that raters took for the pictures of all
    providers.
    """
    cv2.setNumThreads(1)  # as in the nodes
    frame = open_frames(None, duration_s=1.0, period_s=1.0).frame(0, 0.0, 0.0)
    taken_s = []

    def rate(rater: int) -> None:
        for _ in range(providers):
            best_margin(detector_view(np.ascontiguousarray(frame)))

    with ThreadPoolExecutor(raters) as threads:  # OpenCV releases the lock of Python
        for _ in range(_TRIALS):
            began = time.monotonic()
            list(threads.map(rate, range(raters)))
            taken_s.append(time.monotonic() - began)
    return max(taken_s[1:])  # the first has to load the detector


def _silent(line: str) -> None:
    """Show nothing of what a node reports."""


def _run_team(
    out: Path,
    policies: Mapping[str, Policy],
    speed: float,
    seed: int,
    view: bool,
    report: Callable[[str], object],
    progress: Progress,
) -> Timeline:
    """Run the nodes until their rounds are over, and return the times of the rounds."""
    team, period = Team.of(SCENARIO), round_period(SCENARIO.period_s, speed)
    journal, keys = out / "journal.jsonl", out / "keys"
    journal.unlink(missing_ok=True)
    shutil.rmtree(out / "recording", ignore_errors=True)
    make_keys(keys, [MANAGER, *team.raters, *team.providers])
    with NodeProcesses() as nodes:
        started = time.monotonic()
        of_team: dict[str, Any] = {"team": team, "keys": keys}
        if view:
            from roletrust_manager.page.page import run_view_server

            with open_page(_PORT, report) as listening:
                nodes.start(
                    "view",
                    run_view_server,
                    listening=listening,
                    period_s=period / SECOND,
                    speed=speed,
                    attackers=tuple(policies),
                    **of_team,
                )
        model = parse_trust_model("role-trust", SCENARIO)
        of_manager = {"journal": journal, "period": period, "report": _silent, **of_team}
        nodes.start("manager", run_manager_node, model=model, **of_manager)
        nodes.start(
            "recorder", run_recorder_node, folder=out / "recording", images=False, report=_silent
        )
        first = len(nodes.names)
        of_agent: dict[str, Any] = {"scenario": SCENARIO, "keys": keys, "seed": seed}
        for run, names in ((run_rater_node, team.raters), (run_camera_node, team.providers)):
            for name in names:
                policy = policies.get(name)
                nodes.start(name, run, name=name, policy=policy, report=_silent, **of_agent)
        for done, name in enumerate(nodes.names):
            progress("Starting", done / len(nodes.names))
            nodes.ready(name)
        nodes.begin(*nodes.names[:first])
        # discovery is slow on a busy machine, too
        discovery_s = max(_DISCOVERY_S, (time.monotonic() - started) / 2)
        timeline = Timeline(clock.now() + round(discovery_s * SECOND), period)
        nodes.begin(*nodes.names[first:], timeline=timeline)
        _watch(nodes, journal, timeline, progress)
    return timeline


def _watch(nodes: NodeProcesses, journal: Path, timeline: Timeline, progress: Progress) -> None:
    """Wait until all rounds are over.

    Raises:
        ValueError: A process has failed, or most of the last rounds lack a rater.
    """
    end = timeline.begin(SCENARIO.max_cycles + _LAST_PERIODS)
    while (now := clock.now()) < end:
        nodes.check()
        is_begun = journal.exists() and journal.stat().st_size
        entries = list(read_journal(journal)) if is_begun else []
        progress("Rounds", len(entries) / SCENARIO.max_cycles)
        if (lacking := _incomplete(entries, timeline, now)) > _WINDOW // 2:
            raise ValueError(
                f"this machine has become too slow, or too busy: {lacking} of the last {_WINDOW} "
                f"rounds, of {timeline.period / SECOND:.2g} s each, lack a rater; a lower speed "
                "makes rounds longer"
            )
        time.sleep(_POLL_S)


def _incomplete(entries: Sequence[JournalEntry], timeline: Timeline, now: int) -> int:
    """Return how many of the last `_WINDOW` rounds lack a rater, or were not closed at all; 0
    before so many rounds.
    """
    last = timeline.round(now) - _LATE
    if last < _WINDOW:
        return 0
    complete = {timeline.round(entry.stamp) for entry in entries if not entry.missing}
    return len(set(range(last - _WINDOW, last)) - complete)


def _measured(rounds: Sequence[JournalEntry], timeline: Timeline) -> Curves:
    """Return the curves of a team by the scenario's clock. The trust after the services of round r
    is at r + 1 periods.
    """
    published, nan = [entry.published for entry in rounds], math.nan
    tor, top = (
        np.array([[trust.get(name, nan) for name in trusts[-1]] for trust in trusts])[..., None]
        for trusts in ([one.tor for one in published], [one.top for one in published])
    )
    numbers = np.array([timeline.round(one.stamp) for one in published])
    trust = np.concatenate([tor, top], axis=1)
    return Curves(
        (numbers + 1) * SCENARIO.period_s,
        tor,
        top,
        trust,
        np.full_like(trust, nan),
        np.full_like(top, nan),
    )


def _simulated(policies: Mapping[str, Policy], seed: int, progress: Progress) -> Curves:
    """Return the curves of a game with the same attackers."""
    game, done = Game(SCENARIO), 0

    def advance(_: object) -> None:
        nonlocal done
        done += 1
        progress("Simulating", done / SCENARIO.max_cycles)

    return record_curves(JointPolicy(game, policies), seed, on_round=advance)
