"""The run of the paper's team as processes on this machine."""

import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from rich.progress import Progress

from roletrust_env import Scenario, make_scenario
from roletrust_env.live.journal import JournalEntry, read_journal
from roletrust_env.live.trust_tracker import Team
from roletrust_env.trust import TrustModel, make_trust_model
from roletrust_env.world.roster import Roster
from roletrust_experiments.commands.live.options import period_ns
from roletrust_experiments.commands.live.processes import NodeProcesses
from roletrust_experiments.paper.figures import Attack, Paper, paper_of

_PAPER = make_scenario("paper-3x3-hog")
_DISCOVERY_S = 4.0  # nodes find each other within that time
_POLL_S = 0.25
_STEADY_S = 20.0  # trust is steady that long after an attack's start, by the scenario's clock
_LAST_PERIODS = 4  # the last rounds close within them


@dataclass(frozen=True)
class DemoPlan:
    """Settings of a run.

    Attributes:
        attack: Attack of the paper.
        seconds: End of the run by the scenario's clock, late enough after the attack's start that trust is steady.
        speed: Speed relative to the scenario's clock.
        signed: Whether all nodes sign their messages.
        seed: Random seed of the noise in pictures and on links.

    Raises:
        ValueError: The end is too early for the attack, or after that of the paper.
    """

    attack: Attack
    seconds: float
    speed: float
    signed: bool
    seed: int

    def __post_init__(self) -> None:
        least, most = self.paper.attack.start_s + _STEADY_S, _PAPER.max_cycles * _PAPER.period_s
        if not least <= self.seconds <= most:
            raise ValueError(f"seconds is {self.seconds:g}; with {self.attack} it must be from {least:g} to {most:g}")

    @property
    def scenario(self) -> Scenario:
        """Scenario of the run."""
        return _PAPER.change(max_cycles=round(self.seconds / _PAPER.period_s))

    @property
    def paper(self) -> Paper:
        """Attack and claims of the paper."""
        return paper_of(self.attack, _PAPER.period_s)

    @property
    def model(self) -> TrustModel[Any]:
        """Trust model of the paper."""
        return make_trust_model("role-trust", lam=self.scenario.lam, initial=self.scenario.initial_trust)

    @property
    def period(self) -> int:
        """Time between rounds, nanoseconds."""
        return period_ns(self.scenario.period_s, self.speed)


class DemoRun(NamedTuple):
    """Result of a run.

    Attributes:
        entries: Rounds in the manager's journal.
        start: Start of round 0, nanoseconds since 1970.
    """

    entries: list[JournalEntry]
    start: int


def run_team(plan: DemoPlan, out: Path, port: int | None, progress: Progress) -> DemoRun:
    """Run the team.

    Args:
        plan: Settings of the run.
        out: Folder for the journal, the recording and the keys; those of an earlier run are replaced.
        port: Port of the page that shows the run; None for no page.
        progress: Progress bar.

    Raises:
        ValueError: A process has failed, or the machine is too slow for a single round.
    """
    from roletrust_env.live.nodes.agent_nodes import run_camera_node, run_rater_node
    from roletrust_env.live.nodes.manager_node import run_manager_node
    from roletrust_env.live.nodes.recorder_node import run_recorder_node
    from roletrust_env.live.nodes.run_loop import SECOND, Timeline
    from roletrust_env.live.validation import MANAGER
    from roletrust_env.live.wire.keys import make_keys
    from roletrust_experiments.view.server import run_view_server

    scenario, policies, period = plan.scenario, plan.paper.policies, plan.period
    roster, journal, keys = Roster.of(scenario), out / "journal.jsonl", out / "keys" if plan.signed else None
    team = Team(roster.rater_names, roster.provider_names)
    journal.unlink(missing_ok=True)
    shutil.rmtree(out / "recording", ignore_errors=True)
    out.mkdir(parents=True, exist_ok=True)
    if keys is not None:
        make_keys(keys, [MANAGER, *team.raters, *team.providers])
    task = progress.add_task("Starting the nodes", total=None)
    with NodeProcesses() as nodes:
        nodes.start("manager", run_manager_node, model=plan.model, journal=journal, period=period, team=team, keys=keys)
        nodes.start("recorder", run_recorder_node, folder=out / "recording", images=False)
        for name in team.raters:
            policy = policies.get(name)
            nodes.start(name, run_rater_node, name=name, scenario=scenario, policy=policy, keys=keys, seed=plan.seed)
        for name in team.providers:
            policy = policies.get(name)
            nodes.start(name, run_camera_node, name=name, scenario=scenario, policy=policy, keys=keys, seed=plan.seed)
        if port is not None:
            watched = {"period_s": period / SECOND, "speed": plan.speed, "attackers": tuple(policies)}
            nodes.start("view", run_view_server, port=port, team=team, keys=keys, **watched)
        started = time.monotonic()
        nodes.ready()
        discovery_s = max(
            _DISCOVERY_S, (time.monotonic() - started) / 2
        )  # on a busy machine, discovery is slow as well
        nodes.begin("manager", "recorder", *(["view"] if port is not None else []))
        start = time.time_ns() + round(discovery_s * SECOND)
        nodes.begin(*team.raters, *team.providers, timeline=Timeline(start, period))
        progress.update(task, description="Rounds", total=scenario.max_cycles)
        while nodes.running(*team.providers):
            nodes.check()
            progress.update(task, completed=_rounds(journal))
            time.sleep(_POLL_S)
        time.sleep(_LAST_PERIODS * period / SECOND)
        nodes.check()
    entries = list(read_journal(journal))
    if not entries:
        raise ValueError(
            f"no round was completed: this machine is too slow for --speed {plan.speed:g}; use a lower speed"
        )
    return DemoRun(entries, start)


def _rounds(journal: Path) -> int:
    """Return the number of rounds so far."""
    return sum(1 for _ in read_journal(journal)) if journal.exists() and journal.stat().st_size else 0
