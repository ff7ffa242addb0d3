"""The paper's team as processes of this machine, from the first round to the last."""

import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from rich.progress import Progress

from roletrust_env import Scenario, make_scenario
from roletrust_env.live.journal import Entry, read_journal
from roletrust_env.live.trust_tracker import Team
from roletrust_env.trust import TrustModel, make_trust_model
from roletrust_env.world.roster import Roster
from roletrust_experiments.commands.live.options import period_ns
from roletrust_experiments.commands.live.processes import Processes
from roletrust_experiments.paper.figures import Attack, Paper, paper_of

_PAPER = make_scenario("paper-3x3-hog")
_MEET_S = 4.0  # in which nodes find each other
_LOOK_S = 0.25
_STEADY_S = 20.0  # from an attack's start, by the scenario's clock
_AFTER = 4  # periods in which the last rounds come in


@dataclass(frozen=True)
class Plan:
    """What is to be run.

    Attributes:
        attack: which of the paper's.
        seconds: when it ends, by the scenario's clock: so long after the attack's start that trust is steady.
        speed: how much faster than the scenario's clock.
        signed: whether raters have keys.
        seed: of the noise in pictures and on links.
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
        """Who is in it, how long it lasts, and when the target moves fast."""
        return _PAPER.change(max_cycles=round(self.seconds / _PAPER.period_s))

    @property
    def paper(self) -> Paper:
        """Who attacks, and what the paper says of it."""
        return paper_of(self.attack, _PAPER.period_s)

    @property
    def model(self) -> TrustModel[Any]:
        """The paper's trust model."""
        return make_trust_model("role-trust", lam=self.scenario.lam, initial=self.scenario.initial_trust)

    @property
    def period(self) -> int:
        """Between rounds, nanoseconds."""
        return period_ns(self.scenario.period_s, self.speed)


class Lived(NamedTuple):
    """What the robots left behind.

    Attributes:
        entries: the manager's rounds.
        start: of round 0, nanoseconds since 1970.
    """

    entries: list[Entry]
    start: int


def run_team(plan: Plan, out: Path, port: int | None, progress: Progress) -> Lived:
    """Run the team.

    Args:
        plan: what is to be run.
        out: folder for the journal, the recording and the keys; those of an earlier run make way.
        port: of the page to watch it on; None for none.
        progress: where to show how far it is.

    Raises:
        ValueError: a process has failed, or the machine is too slow for a single round.
    """
    from roletrust_env.live.nodes.assess import run_assess
    from roletrust_env.live.nodes.cam import run_cam
    from roletrust_env.live.nodes.manage import run_manager
    from roletrust_env.live.nodes.record import run_record
    from roletrust_env.live.nodes.running import SECOND, Timeline
    from roletrust_env.live.wire.keys import make_keys
    from roletrust_experiments.view.server import run_view

    scenario, policies, period = plan.scenario, plan.paper.policies, plan.period
    roster, journal, keys = Roster.of(scenario), out / "journal.jsonl", out / "keys" if plan.signed else None
    team = Team(roster.rater_names, roster.provider_names)
    journal.unlink(missing_ok=True)
    shutil.rmtree(out / "recording", ignore_errors=True)
    out.mkdir(parents=True, exist_ok=True)
    if keys is not None:
        make_keys(keys, team.raters)
    task = progress.add_task("Starting the nodes", total=None)
    with Processes() as nodes:
        nodes.start("manager", run_manager, model=plan.model, journal=journal, period=period, team=team, keys=keys)
        nodes.start("recorder", run_record, folder=out / "recording", images=False)
        for name in team.raters:
            policy = policies.get(name)
            nodes.start(name, run_assess, name=name, scenario=scenario, policy=policy, keys=keys, seed=plan.seed)
        for name in team.providers:
            nodes.start(name, run_cam, name=name, scenario=scenario, policy=policies.get(name), seed=plan.seed)
        if port is not None:
            watched = {"period_s": period / SECOND, "speed": plan.speed, "attackers": tuple(policies)}
            nodes.start("view", run_view, port=port, **watched)
        began = time.monotonic()
        nodes.ready()
        meet_s = max(_MEET_S, (time.monotonic() - began) / 2)  # what was slow to start is slow to meet
        nodes.begin("manager", "recorder", *(["view"] if port is not None else []))
        start = time.time_ns() + round(meet_s * SECOND)
        nodes.begin(*team.raters, *team.providers, timeline=Timeline(start, period))
        progress.update(task, description="Rounds", total=scenario.max_cycles)
        while nodes.running(*team.providers):
            nodes.check()
            progress.update(task, completed=_rounds(journal))
            time.sleep(_LOOK_S)
        time.sleep(_AFTER * period / SECOND)
        nodes.check()
    entries = list(read_journal(journal))
    if not entries:
        raise ValueError(
            f"no round came together: this machine is too slow for --speed {plan.speed:g}, take a lower one"
        )
    return Lived(entries, start)


def _rounds(journal: Path) -> int:
    """How many rounds there are so far."""
    return sum(1 for _ in read_journal(journal)) if journal.exists() and journal.stat().st_size else 0
