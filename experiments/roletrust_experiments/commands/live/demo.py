"""`roletrust live demo`: the paper's three robots as processes on this machine."""

import math
import multiprocessing
import os
import shutil
import statistics
import time
import webbrowser
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.progress import Progress

from roletrust_env import Game, JointPolicy, Scenario, make_scenario
from roletrust_env.evaluation.curves import Curves
from roletrust_env.interrupts import without_interrupts
from roletrust_env.storage.files import prepare_folder, write_json
from roletrust_env.storage.provenance import describe, describe_policies
from roletrust_env.trust import TrustModel, make_trust_model
from roletrust_experiments.commands.console import console, progress_bar, stage, tell, tracked
from roletrust_experiments.commands.extras import require_live
from roletrust_experiments.commands.figures import claims_table
from roletrust_experiments.commands.live.options import SLOWEST, Browser, Port, Speed, period_ns
from roletrust_experiments.commands.live.processes import NodeProcesses
from roletrust_experiments.commands.live.view import address, require_view
from roletrust_experiments.paper.figures import Attack, Paper, papers
from roletrust_experiments.playing.games import track_curves
from roletrust_manager.admission import clock
from roletrust_manager.journal.lines import JournalEntry, read_journal
from roletrust_manager.page.waiting import WaitingPage
from roletrust_manager.team import PublishedTrust, Team

_NICENESS = 19  # the simulation gives way to the robots
_PAPER = make_scenario("paper-3x3-hog")
_DISCOVERY_S = 4.0  # nodes find each other within that time
_POLL_S = 0.25
_STEADY_S = 20.0  # trust is steady that long after an attack's start, by the scenario's clock
_LAST_PERIODS = 4  # the last rounds close within them
_ASIDE_S = (
    10.0  # after the rounds, the simulation has so long before it is played without giving way
)
_HEADROOM = (
    2.5  # least ratio of a round to the time that its pictures take: other processes need some, too
)


@dataclass(frozen=True)
class _Plan:
    """Settings of a run.

    Attributes:
        attack: Attack of the paper.
        seconds: End of the run by the scenario's clock, late enough after the attack's start that
            trust is steady.
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
            raise ValueError(
                f"seconds is {self.seconds:g}; with {self.attack} it must be from {least:g} to "
                f"{most:g}"
            )

    @property
    def scenario(self) -> Scenario:
        """Scenario of the run."""
        return _PAPER.change(max_cycles=round(self.seconds / _PAPER.period_s))

    @property
    def paper(self) -> Paper:
        """Attack and claims of the paper."""
        return papers(_PAPER.period_s)[0 if self.attack == "on-off" else 1]

    @property
    def model(self) -> TrustModel[Any]:
        """Trust model of the paper."""
        return make_trust_model(
            "role-trust", lam=self.scenario.lam, initial=self.scenario.initial_trust
        )

    @property
    def period(self) -> int:
        """Time between rounds, nanoseconds."""
        return period_ns(self.scenario.period_s, self.speed)

    def slowed(self, work_s: float) -> "_Plan":
        """Return the plan with rounds that leave time for their work; itself if they do.

        Args:
            work_s: Time that the raters take for the pictures of a round, seconds.

        Raises:
            ValueError: This machine is too slow for the slowest rounds.
        """
        speed = _PAPER.period_s / (_HEADROOM * work_s)
        if speed >= self.speed:
            return self
        if speed < SLOWEST:
            raise ValueError(
                f"this machine is too slow, or too busy: raters take {work_s:.2g} s for the "
                "pictures of a round, and "
                f"have {_PAPER.period_s / SLOWEST / _HEADROOM:.2g} s even with --speed {SLOWEST:g}"
            )
        return replace(self, speed=math.floor(100 * speed) / 100)


def demo(
    attack: Annotated[
        Attack, typer.Option(help="Attack of the paper's Figure 3 or Figure 4.")
    ] = "bad-mouthing",
    seconds: Annotated[
        float,
        typer.Option(
            help=(
                "End of the run, in seconds of the paper's clock; at least 20 s after the attack "
                "starts."
            )
        ),
    ] = 120.0,
    speed: Speed = 1.0,
    out: Annotated[
        Path, typer.Option(help="Folder for the results; it is created if it does not exist.")
    ] = Path("results/live"),
    signed: Annotated[
        bool, typer.Option("--signed/--unsigned", help="Whether all nodes sign their messages.")
    ] = True,
    view: Annotated[
        bool, typer.Option("--view/--no-view", help="Whether to serve a page that shows the run.")
    ] = True,
    port: Port = 5006,
    browser: Browser = True,
    seed: Annotated[
        int, typer.Option(min=0, help="Random seed of the noise in pictures and on links.")
    ] = 0,
) -> None:
    """Run the paper's [bold]three robots[/] as seven processes on DDS: three cameras, three raters
    and the manager.

    The run takes two minutes, or less with --speed; on a slow machine, rounds are longer.
    Meanwhile, a page in the browser shows the curves, the pictures of the cameras and the missing
    raters, and ROS 2 on this machine sees the nodes, topics and types. At the end, the command
    draws the paper's figure from the measured trust beside a simulation of the same run, and checks
    the claims of the paper.

    Written: [green]figure.png figure.csv figure-simulated.csv results.json[/];
    [green]journal.jsonl[/], the journal of the manager; [green]recording[/], all messages except
    pictures; and [green]keys[/].

    [bold]Examples[/]

    [dim]# the paper's Figure 4, in two minutes[/]
    [cyan]roletrust live demo --attack bad-mouthing[/]

    [dim]# Figure 3, three times as fast, without a page[/]
    [cyan]roletrust live demo --attack on-off --speed 3 --no-view[/]
    """
    (require_view if view else require_live)()
    plan = _Plan(attack, seconds, speed, signed, seed)
    with WaitingPage(port) if view else nullcontext() as page:
        prepare_folder(out)
        if page is not None:
            tell(f"Watch it on {address(port)}")
        if page is not None and browser:
            webbrowser.open(address(port))
        plan = _paced(plan)
        with without_interrupts():
            simulations = multiprocessing.get_context("spawn").Pool(1, os.nice, (_NICENESS,))
        with simulations as aside, progress_bar() as progress:
            simulation = aside.apply_async(_simulated, (plan,))
            entries, start = _run_team(plan, out, page, progress)
            try:
                stage(progress, "Waiting for the simulation")
                simulated = simulation.get(_ASIDE_S)
            except multiprocessing.TimeoutError:  # it gave way to all else on this machine
                aside.terminate()
                simulated = _simulated(plan, progress)
    _report(plan, entries, start, simulated, out)


def _paced(plan: _Plan) -> _Plan:
    """Return the plan with rounds for which this machine is fast enough, and say if they are
    longer.
    """
    from roletrust_experiments.commands.live.pace import work_s

    team = Team.of(plan.scenario)
    work, period_s = work_s(len(team.raters), len(team.providers)), plan.period / 1e9
    slowed = plan.slowed(work)
    if slowed is not plan:
        longer_s = slowed.period / 1e9
        tell(
            f"This machine is too slow, or too busy, for a round in {period_s:.2g} s: raters take "
            f"{work:.2g} s for its "
            f"pictures, and have {period_s / _HEADROOM:.2g} s. A round takes {longer_s:.2g} s "
            "instead (--speed "
            f"{slowed.speed:g}), and the run {slowed.scenario.max_cycles * longer_s / 60:.1f} "
            "minutes."
        )
    return slowed


def _silent(line: str) -> None:
    """Show nothing of what a node reports: the bar shows the rounds."""


def _ask(pipe: Connection) -> None:
    """Wait until the page at the other end of a pipe has left its socket."""
    pipe.send(None)
    pipe.recv()


def _simulated(plan: _Plan, progress: Progress | None = None) -> Curves:
    """Simulate the same run without robots, with a progress bar or without a word."""
    progress = progress or Progress(disable=True)
    return track_curves(
        JointPolicy(Game(plan.scenario), plan.paper.policies), plan.seed, progress, "Simulating"
    )


def _report(
    plan: _Plan, entries: list[JournalEntry], start: int, simulated: Curves, out: Path
) -> None:
    """Write and print the results."""
    from roletrust_experiments.plots.paper import write_paper

    paper, scenario = plan.paper, plan.scenario
    curves = curves_from_rounds(
        [entry.published for entry in entries], start, plan.period, scenario.period_s
    )
    measured, expected = (paper.check(seen, scenario, paper.attack) for seen in (curves, simulated))
    partial, delays = sum(bool(entry.missing) for entry in entries), _latencies_ms(entries)
    delay = statistics.median(delays) if delays else None
    caption = f"measured on DDS: {len(entries)} rounds, {partial} of them with a rater missing"
    written = write_paper(
        out, "figure", paper, {"measured": curves, "simulated": simulated}, scenario, caption
    )
    written += ["results.json", "journal.jsonl", "recording"]
    results = {
        "command": "roletrust live demo",
        **asdict(plan),
        "trust_model": describe(plan.model),
        "attackers": describe_policies(paper.policies),
        "rounds": len(entries),
        "partial_rounds": partial,
        "image_to_trust_ms": {"median": delay, "largest": max(delays, default=None)},
        "claims": [claim._asdict() for claim in measured],
        "claims_simulated": [claim._asdict() for claim in expected],
        "files": written,
    }
    write_json(out / "results.json", results)
    console.print(
        claims_table(
            "Su and Saint-Jore (2023), on DDS, seen through OpenCV's HOG people detector", measured
        )
    )
    console.print(
        "[dim]simulated: "
        + "; ".join(f"{claim.what} {claim.measured}" for claim in expected)
        + "[/]"
    )
    tell(f"{caption}; image to trust {delay or float('nan'):.0f} ms at the median", "dim")
    tell(f"Written to {out}: {', '.join(written)}")


def curves_from_rounds(
    rounds: Sequence[PublishedTrust], start: int, period: int, period_s: float
) -> Curves:
    """Return the curves of a team. Unknown values are NaN: rewards, delivered quality, and trust
    before an agent joins.

    Args:
        rounds: One or more rounds.
        start: Start of round 0, nanoseconds.
        period: Time between rounds, nanoseconds.
        period_s: Time between rounds by the scenario's clock, seconds. The trust after the services
            of round r is at (r + 1) * period_s.
    """
    number = np.array([round((published.stamp - start) / period) for published in rounds])
    raters, providers, nan = rounds[-1].tor, rounds[-1].top, float("nan")
    tor = np.array([[published.tor.get(name, nan) for name in raters] for published in rounds])[
        ..., None
    ]
    top = np.array([[published.top.get(name, nan) for name in providers] for published in rounds])[
        ..., None
    ]
    trust = np.concatenate([tor, top], axis=1)
    return Curves(
        (number + 1) * period_s, tor, top, trust, np.full_like(trust, nan), np.full_like(top, nan)
    )


def _latencies_ms(entries: Sequence[JournalEntry]) -> list[float]:
    """Return the times from the services' stamp to the resulting trust, for complete rounds,
    milliseconds.
    """
    return [(entry.closed - entry.stamp) / 1e6 for entry in entries if not entry.missing]


def _run_team(
    plan: _Plan, out: Path, page: WaitingPage | None, progress: Progress
) -> tuple[list[JournalEntry], int]:
    """Run the team.

    Args:
        plan: Settings of the run.
        out: Folder for the journal, the recording and the keys; those of an earlier run are
            replaced.
        page: Page that answers until the one that shows the run; None for no page.
        progress: Progress bar.

    Returns:
        The rounds in the manager's journal, and the start of round 0 in nanoseconds since 1970.

    Raises:
        ValueError: A process has failed, or most of the last rounds lack a rater.
    """
    from roletrust_experiments.commands.live.pace import WINDOW, incomplete, work_s
    from roletrust_manager.admission.keys import make_keys
    from roletrust_manager.admission.validation import MANAGER
    from roletrust_manager.dds.nodes.agent_nodes import run_camera_node, run_rater_node
    from roletrust_manager.dds.nodes.manager_node import run_manager_node
    from roletrust_manager.dds.nodes.recorder_node import run_recorder_node
    from roletrust_manager.dds.nodes.run_loop import SECOND, Timeline

    scenario, policies, period = plan.scenario, plan.paper.policies, plan.period
    team, journal, keys = (
        Team.of(scenario),
        out / "journal.jsonl",
        out / "keys" if plan.signed else None,
    )
    journal.unlink(missing_ok=True)
    shutil.rmtree(out / "recording", ignore_errors=True)
    out.mkdir(parents=True, exist_ok=True)
    if keys is not None:
        make_keys(keys, [MANAGER, *team.raters, *team.providers])
    with NodeProcesses() as nodes:
        manager = {
            "model": plan.model,
            "journal": journal,
            "period": period,
            "team": team,
            "keys": keys,
        }
        nodes.start("manager", run_manager_node, report=_silent, **manager)
        nodes.start(
            "recorder", run_recorder_node, folder=out / "recording", images=False, report=_silent
        )
        shared = {"scenario": scenario, "keys": keys, "seed": plan.seed, "report": _silent}
        for name in team.raters:
            nodes.start(name, run_rater_node, name=name, policy=policies.get(name), **shared)
        shared["rounds"] = scenario.max_cycles
        for name in team.providers:
            nodes.start(name, run_camera_node, name=name, policy=policies.get(name), **shared)
        started = time.monotonic()
        if page is not None:
            from roletrust_manager.page.page import run_view_server

            page.text = "Starting the nodes."
            here, far_end = multiprocessing.Pipe()
            settings: Any = {
                "team": team,
                "keys": keys,
                "attackers": tuple(policies),
                "speed": plan.speed,
            }
            settings |= {
                "listening": page.listening,
                "take": partial(_ask, far_end),
                "period_s": period / SECOND,
            }
            nodes.start("view", run_view_server, **settings)
        console.print(
            f"Starts {len(nodes.names)} processes", soft_wrap=True
        )  # at once, where no bar can move
        for name in tracked(progress, "Starting", nodes.names):
            nodes.ready(name)
        if page is not None:
            nodes.begin("view")
            while not here.poll(_POLL_S):
                nodes.check()
            page.close()
            here.send(here.recv())
        discovery_s = max(
            _DISCOVERY_S, (time.monotonic() - started) / 2
        )  # it is slow on a busy machine, too
        nodes.begin("manager", "recorder")
        timeline = Timeline(clock.now() + round(discovery_s * SECOND), period)
        nodes.begin(*team.raters, *team.providers, timeline=timeline)
        done, entries, gaps = (
            stage(progress, "Rounds", scenario.max_cycles),
            list[JournalEntry](),
            0,
        )
        end = timeline.begin(scenario.max_cycles)
        while clock.now() < end + _LAST_PERIODS * period and gaps <= WINDOW // 2:
            nodes.check(*team.providers, end=end)
            if journal.exists() and journal.stat().st_size:
                entries = list(read_journal(journal))
            done(len(entries))
            gaps = incomplete(entries, timeline, clock.now())
            time.sleep(_POLL_S)
    if gaps > WINDOW // 2:
        work = work_s(len(team.raters), len(team.providers))
        raise ValueError(
            f"this machine has become too slow, or too busy: {gaps} of the last {WINDOW} rounds "
            "lack a rater. Raters "
            f"take {work:.2g} s for the pictures of a round now, and a round has "
            f"{period / SECOND:.2g} s; a lower "
            f"--speed than {plan.speed:.2g} gives them longer"
        )
    entries = list(read_journal(journal))
    return entries, timeline.start
