"""Every way to attack a task, from honest play to the optimum, in one table and one picture.

Each rung of the ladder looks for an attack with the same budget of game rounds. All attacks are then measured in the
same held-out games. The score is the mean reward per round with its 95% confidence interval, over the runs or, for a
single run, over its games. The share is 0 for honest play. It is 1 for the exact optimum, for a proven bound, or for
the best attack found where neither is known.

scripted: on-off and bad-mouthing, as in the paper and as the best of a grid, or the attacks of `--attack`.
random search, CMA-ES: over the parameters that the scripted attacks declare.
universal, evolution: coalitions as one mind, ready ones of the project, and one that evolves for this task.
white-box planner: follows the gradient through the game. learned: the attackers of `--learned`, folders that
`roletrust train` has written with as many runs and the same seeds.
exact: dynamic programming, for one provider (exploit, no stealth) in a game without randomness.
best known: planned lies, for raters (damage) in a game without randomness; for one rater with a bound that no attack
exceeds.

The recipe `ladder` has three colluders in a crowd, whose trainings are those of the recipe `colluders` of the study
`pages`; half an hour on two cores for both.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from roletrust_agents.learned.methods import learned_methods
from roletrust_agents.planning.optimum import BestKnown, Exact
from roletrust_agents.planning.planner import Planner
from roletrust_agents.training.coalition_methods import EvolutionSearch
from roletrust_agents.training.universal import Universal
from roletrust_baselines.search import CmaEs, GridSearch, PaperAttacks, RandomSearch
from roletrust_env import make_scenario
from roletrust_env.envs.attack_env import TASKS
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import (
    HELD_OUT,
    TaskArguments,
    exact_task,
    judged_rollout,
    random_sources,
)
from roletrust_env.evaluation.scripts import Scripts
from roletrust_env.evaluation.search import Budget, HonestPlay, MeasuredSearch, SearchMethod, UnsuitableError, find
from roletrust_env.evaluation.specs import parse_kinds, parse_settings, parse_trust_model
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.state import Actions
from roletrust_env.metrics.confidence import over_games
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.commands.options import find_task
from roletrust_experiments.plots.style import ATTACKER, ATTACKERS, HONEST, INK, QUIET, tidy
from studies.study import Recipe, Study

Floats = npt.NDArray[np.float64]


class Options(NamedTuple):
    """Task and effort.

    Attributes:
        task: Attack task, such as `RaterAttack`.
        scenario: Name or file of the scenario; the task's own if empty.
        set: Fields of the scenario to change, as `FIELD=VALUE`.
        model: Spec of the trust model.
        compromised: Agents that the attacker controls; the task's own if left out.
        attack: Scripted attacks to try and to search, with the given parameters fixed.
        stealth_weight: Price of a trust gap that gives the attacker away.
        stealth_tolerance: Trust gap that costs nothing.
        budget: Rounds x games that each search method and the planner may play.
        games: Number of held-out games that measure each attack.
        runs: Number of runs, with the seed of the study and those after it.
        learned: Folders of trained attackers.
    """

    task: str = "CollusionAttack"
    scenario: str = ""
    set: tuple[str, ...] = ()
    model: str = "role-trust"
    compromised: tuple[str, ...] = ()
    attack: tuple[str, ...] = ()
    stealth_weight: float = 0.0
    stealth_tolerance: float = 0.1
    budget: int = 2_000_000
    games: int = 100
    runs: int = 1
    learned: tuple[Path, ...] = ()


_COLLUDERS = Options(stealth_weight=2.0, runs=5, learned=(Path("results/colluders/runs"),))
RECIPES = {"ladder": Recipe(_COLLUDERS, {"ladder.png": "ladder.png"}), "task": Recipe(Options())}


_SHOWN = 40
"""Number of rounds to draw; more would be too dense."""

_MAPS = 3
"""Maximum number of raters with a map of their ratings."""

_FEW = 3  # maximum number of ratings of a rater with a line each
_COLOURS = {"honest play": HONEST[0], "exact": INK, "best known": INK}
_OTHERS = "#9CA3AF"


HEADER = ("rung", "run", "score", "half_95", "objective", "cost", "rounds", "seconds", "attack")
"""Header of a table with a line for every run of every rung."""


class Row(NamedTuple):
    """A rung of the ladder.

    Attributes:
        name: Name of the rung.
        runs: Result of each run; all rungs have the same seed in the same run.
        score: Mean score over the runs.
        half: Half the 95% confidence interval, over the runs or over the games of a single run.
        share: Position between honest play, 0, and the top, 1.
    """

    name: str
    runs: tuple[MeasuredSearch, ...]
    score: float
    half: float
    share: float

    @property
    def scores(self) -> list[float]:
        """Mean score of each run."""
        return [float(run.scores.mean()) for run in self.runs]

    @property
    def best(self) -> int:
        """Index of the run with the best score."""
        return int(np.argmax(self.scores))


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The record of T rounds of one held-out game.

    Attributes:
        name: of the rung.
        quality: that each compromised provider chose, by its name, (T,); its identities, too, where they can be called.
        ratings: that each compromised rater gave the honest providers, by its name, (T, H); NaN where none was due.
        own: trust of each compromised agent, by `"ToR of sr_0"` and the like, (T,).
        mine: mean trust of the compromised agents, by `"ToR"` and `"ToP"`, (T,), as far as there are such agents.
        honest: the same of the honest ones.
        objective: of each round, (T,).
        cost: of each round, unweighted, (T,).
        price: what a unit of cost takes off the score.
    """

    name: str
    quality: dict[str, Floats]
    ratings: dict[str, Floats]
    own: dict[str, Floats]
    mine: dict[str, Floats]
    honest: dict[str, Floats]
    objective: Floats
    cost: Floats
    price: float


def main(arguments: Sequence[str] | None = None) -> None:
    """Climb the ladder of a task, and write its rungs."""
    with Study(__name__, RECIPES, arguments) as study:
        asked, seed = study.options, study.seed
        task_id = find_task(asked.task)
        defaults = TASKS[task_id].defaults
        rules = make_scenario(asked.scenario or defaults["scenario"])
        if changes := parse_settings(list(asked.set)):
            rules = rules.change(**changes)
        task = {
            **defaults,
            "scenario": rules,
            "trust_model": parse_trust_model(asked.model, rules),
            "compromised": asked.compromised or tuple(defaults["compromised"]),
            "stealth": {"weight": asked.stealth_weight, "tolerance": asked.stealth_tolerance},
        }
        kinds = parse_kinds(list(asked.attack), rules) if asked.attack else None
        Scripts.of(exact_task(task), kinds)  # an attack that does not fit is refused before the games
        scripted: list[SearchMethod] = [rung(attacks=kinds) for rung in (PaperAttacks, GridSearch, RandomSearch, CmaEs)]
        searches = [HonestPlay(), *scripted, Universal(), EvolutionSearch(), Planner()]
        seeds = range(seed, seed + asked.runs)
        trained = [
            learned_methods(path, seeds, f"learned, {path.name}" if len(asked.learned) > 1 else "learned")
            for path in asked.learned
        ]
        ladders = [[*searches, *(rungs[run] for rungs in trained), Exact(), BestKnown()] for run in range(asked.runs)]
        with study.progress(len(ladders[0])) as advance:
            found, missing = climb(ladders, task, asked.budget, seed, asked.games, advance)
        rows = ranked(found)
        trajectories = [
            watch(task, row.runs[row.best], seed + row.best, _run_name(row, seed)) for row in compared(rows)
        ]
        about = f"{task_id.removeprefix('RoleTrust/')}, {rules.name}, {defaults['objective']}"
        if asked.stealth_weight:
            about += f" less {asked.stealth_weight:g} x gap over {asked.stealth_tolerance:g}"
        study.csv("ladder.csv", HEADER, lines(rows, seed))
        study.figure("ladder.png", ladder_figure(about, rows, trajectories))
        score, what = top(rows)
        over = f"over {asked.runs} runs" if asked.runs > 1 else "over the held-out games"
        study.page(
            "ladder.md",
            f"# {about}",
            markdown_table(["rung", "score", "share", "rounds", "seconds"], map(_cells, rows), 1),
            f"Share: 0 is honest play, 1 is {what}, {score:.4f}; ± half the 95% interval {over}, rounded up.",
            "\n".join(f"- {_run_name(row, seed)}: {row.runs[row.best].description}." for row in rows),
            "\n".join(f"- Left out: {name}: {why}." for name, why in missing.items()),
            f"Made by `{study.command}`.",
        )


def climb(
    ladders: Sequence[Sequence[SearchMethod]],
    arguments: TaskArguments,
    budget: int,
    seed: int,
    games: int,
    advance: Callable[[str], None],
) -> tuple[list[list[MeasuredSearch]], dict[str, str]]:
    """Run every rung.

    Args:
        ladders: The same rungs for each run.
        arguments: Arguments of the task.
        budget: Budget of each search.
        seed: Seed of the first run; each later run has the next one.
        games: Number of held-out games that measure each attack.
        advance: Called with the name of each rung when it is done.

    Returns:
        The results of each rung in each run, and the reasons why some rungs do not apply.
    """
    found, missing = [], {}
    for rungs in zip(*ladders, strict=True):
        try:
            found.append(
                [
                    find(rung, arguments, budget=Budget(budget), seed=run, games=games)
                    for run, rung in enumerate(rungs, start=seed)
                ]
            )
        except UnsuitableError as error:
            missing[rungs[0].name] = str(error)
        advance(rungs[0].name)
    return found, missing


def ranked(found: Sequence[Sequence[MeasuredSearch]]) -> list[Row]:
    """Return the rungs with their runs and shares: 0 is honest play, the first rung, and 1 is the top, see `top`."""
    rows = []
    for runs in found:
        means = np.array([run.scores.mean() for run in runs])
        score, half, _ = over_games(means if len(runs) > 1 else runs[0].scores)
        # Games without randomness differ only by rounding.
        rows.append(Row(runs[0].name, tuple(runs), float(score), float(half) if half > 1e-12 else 0.0, np.nan))
    foot, highest = rows[0].score, top(rows)[0]
    if highest <= foot:
        return rows
    return [row._replace(share=(row.score - foot) / (highest - foot)) for row in rows]


def top(rows: Sequence[Row]) -> tuple[float, str]:
    """Return the score with share 1, and its meaning: the exact optimum, a bound, or the best score found."""
    for row in rows:
        bound = row.runs[0].bound
        if bound is not None:
            return bound, "the exact optimum" if row.name == "exact" else "a bound that is proven"
    return max(row.score for row in rows), "the best that was found"


def compared(rows: Sequence[Row]) -> tuple[Row, Row]:
    """Return the best scripted attack, and the best attack of all."""
    scripted = [row for row in rows if row.name.startswith("scripted")]
    return max(scripted, key=lambda row: row.score), max(rows, key=lambda row: row.score)


def lines(rows: Sequence[Row], seed: int) -> list[tuple[Any, ...]]:
    """Return the runs as lines under `HEADER`. The first run has the given seed."""
    table = []
    for row in rows:
        for run, found in enumerate(row.runs, start=seed):
            score, half, _ = over_games(found.scores)
            parts = (float(score), float(half), float(found.objective.mean()), float(found.cost.mean()))
            table.append((row.name, run, *parts, found.rounds, found.seconds, found.description))
    return table


def _run_name(row: Row, seed: int) -> str:
    """Return the name of the best run of a rung. The first run has the given seed."""
    return f"{row.name}, seed {seed + row.best}" if len(row.runs) > 1 and row.runs[0].rounds else row.name


def _cells(row: Row) -> list[str]:
    rounds, seconds = max(run.rounds for run in row.runs), float(np.mean([run.seconds for run in row.runs]))
    share = "" if np.isnan(row.share) else f"{row.share:.3f}"
    return [row.name, _score(row), share, f"{rounds:,}" if rounds else "-", f"{seconds:.1f}"]


def _score(row: Row) -> str:
    """Return the score and half its interval, rounded up."""
    return f"{row.score:.4f}" + (f" ± {ceil(row.half * 1e4) / 1e4:.4f}" if row.half > 0 else "")


def watch(arguments: TaskArguments, finding: MeasuredSearch, seed: int, called: str | None = None) -> Trajectory:
    """Play one held-out game of what a rung found in the run with a seed; it is called by the rung or by a name."""
    task = exact_task(arguments)
    roster, bad = task.game.roster, {*task.identities, *task.joint_policy.attackers}
    rounds = list(judged_rollout(task, finding.attacker, (1, 1), *random_sources(task, seed, HELD_OUT)))
    trust = [task.game.published(played.round.state) for played in rounds]
    tor, top = (np.stack([pair[k][:, 0, 0] for pair in trust]) for k in range(2))
    victims = [i for i, name in enumerate(roster.provider_names) if name not in bad]
    # Only policies decide on identities in reserve; an action of the task does not.
    names = task.identities if isinstance(finding.attacker, Scripted) else task.compromised
    chosen = [_chosen(task, names, played.round.actions) for played in rounds]
    quality = {name: np.stack([values[name] for values, _ in chosen]) for name in chosen[0][0]}
    ratings = {name: np.stack([values[name] for _, values in chosen])[:, victims] for name in chosen[0][1]}
    for given in ratings.values():
        given[0] = np.nan  # nothing has been served yet
    shown = [name for name in task.identities if name in quality or name in ratings]
    own: dict[str, Floats] = {}
    mine: dict[str, Floats] = {}
    honest: dict[str, Floats] = {}
    for kind, names, values in (("ToR", roster.rater_names, tor), ("ToP", roster.provider_names, top)):
        for group, members in ((mine, shown), (honest, [name for name in names if name not in bad])):
            places = [names.index(name) for name in members if name in names]
            if places:
                group[kind] = values[:, places].mean(axis=1)
            if group is mine:
                own |= {f"{kind} of {names[place]}": values[:, place] for place in places}
    objective, cost = (np.array([float(played.outcome[k][0, 0]) for played in rounds]) for k in (1, 2))
    called = called or finding.name
    return Trajectory(called, quality, ratings, own, mine, honest, objective, cost, task.stealth.weight)


def _chosen(task: AttackTask, names: Sequence[str], actions: Actions) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Return the quality that some agents choose in one game, by name, and their ratings, (P,) each."""
    roster = task.game.roster
    quality = {
        name: actions.quality[roster.provider_names.index(name), 0, 0]
        for name in names
        if name in roster.provider_names
    }
    ratings = {
        name: actions.ratings[roster.rater_names.index(name), :, 0, 0] for name in names if name in roster.rater_names
    }
    return quality, ratings


def ladder_figure(about: str, rows: "Sequence[Row]", trajectories: Sequence[Trajectory]) -> Figure:
    """Return the figure of a ladder.

    Args:
        about: Title.
        rows: Rows of the ladder, from honest play upwards.
        trajectories: Trajectories of the scripted attack and of the best one.
    """
    # Many ratings are drawn as a map with a row for each honest provider.
    maps = [name for name, values in trajectories[0].ratings.items() if _is_many(trajectories, values)][:_MAPS]
    height, below_height = 0.9 + 0.36 * len(rows), 6.6 + 1.0 * len(maps)
    figure = Figure(figsize=(10.4, height + below_height), layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=[height, below_height], hspace=0.03)
    top, below = halves
    _bars(top.subplots(), rows)
    top.suptitle(about, x=0.012, ha="left", fontsize=13, fontweight="bold", color=INK)
    grid = below.subplots(3 + len(maps), 2, sharex=True, sharey="row", height_ratios=[2] * 3 + [1] * len(maps))
    for k, (column, trajectory) in enumerate(zip(grid.T, trajectories, strict=True)):
        _actions(column[0], trajectory)
        _trust(column[1], trajectory)
        _gains(column[2], trajectory)
        column[0].set_title(trajectory.name, loc="left", fontsize=12, fontweight="bold", color=INK, pad=24)
        for axes, name in zip(column[3:], maps, strict=True):
            _map(axes, name, trajectory.ratings[name])
            axes.set_ylabel("" if k else axes.get_ylabel(), color=INK)
        column[-1].set_xlabel("round", color=INK)
        for axes in column[:3]:
            axes.set_ylabel("" if k else axes.get_ylabel(), color=INK)
            _legend(axes)
    return figure


def _bars(axes: Axes, rows: "Sequence[Row]") -> None:
    """Draw a bar for each rung, with honest play at the bottom, and a point for each run."""
    scores = [row.score for row in rows]
    best = max(row.score for row in rows if row.name not in _COLOURS)
    low, high = min(0.0, *scores), max(0.0, *scores)
    # The bar of a script far below honest play is cut, because it would compress all others; its number is printed.
    low = max(low, -0.25 * high)
    for place, row in enumerate(rows):
        colour = _COLOURS.get(row.name, ATTACKER if row.score == best else _OTHERS)
        axes.barh(place, max(row.score, low), color=colour, height=0.66, zorder=2)
        if row.score < low:
            axes.text(low, place, " ◂", va="center", fontsize=9, color="white")
        elif row.half > 0:
            axes.errorbar(row.score, place, xerr=row.half, color=INK, capsize=2.5, linewidth=1, zorder=3)
        if len(row.runs) > 1 and row.score >= low:
            points: Any = {"s": 13, "color": "white", "edgecolors": INK, "linewidths": 0.7, "zorder": 4}
            axes.scatter(row.scores, [place - 0.2] * len(row.runs), **points)
        share = "" if np.isnan(row.share) else f"   share {row.share:.3f}"
        end = max(0.0, row.score + row.half, *row.scores)
        axes.text(end + 0.012 * (high - low), place, _score(row) + share, va="center", fontsize=9.5, color=INK)
    axes.set_yticks(range(len(rows)), [row.name for row in rows], color=INK)
    axes.set_xlim(low * 1.02, low + (high - low) * 1.42)
    runs = len(rows[0].runs)
    over = (
        f"and the 95% interval of the mean over {runs} runs, which are the points"
        if runs > 1
        else "in its 95% interval"
    )
    axes.set_xlabel(f"score: mean reward per round, {over}", color=INK)
    axes.axvline(0, color=QUIET, linewidth=0.8)
    axes.grid(axis="x", color="#E5E7EB", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=QUIET, labelcolor=INK, length=0)
    for side in ("top", "right", "left", "bottom"):
        axes.spines[side].set_visible(False)


def _actions(axes: Axes, trajectory: Trajectory) -> None:
    """Draw the actions of the attacker: a line for each quality, and for each rating or their mean."""
    tidy(axes, "what it does")
    colours = _agents(trajectory)
    for name, values in trajectory.quality.items():
        _step(axes, values, f"quality of {name}", colours[name], 1.8)
    for name, values in trajectory.ratings.items():
        if np.ptp(values[1:], axis=1).max() < 1e-9:
            _step(axes, values[:, 0], f"rating of all by {name}", colours[name], 1.8)
            continue
        if len(trajectory.ratings) == 1 and values.shape[1] <= _FEW:
            for j in range(values.shape[1]):
                # Later lines are thinner, so that equal lines stay visible.
                _step(axes, values[:, j], f"rating {j + 1} by {name}", ATTACKERS[j], 4.2 - 1.5 * j)
            continue
        _step(axes, values.mean(axis=1), f"mean rating by {name}", colours[name], 1.6)


def _agents(trajectory: Trajectory) -> dict[str, str]:
    """Return the colour of each compromised agent."""
    names = dict.fromkeys((*trajectory.quality, *trajectory.ratings))
    return {name: ATTACKERS[k % len(ATTACKERS)] for k, name in enumerate(names)}


def _legend(axes: Axes) -> None:
    """Draw a legend in one line above the axes, and reserve its height but not its width."""
    if not axes.get_title(loc="left"):
        axes.set_title(" ", fontsize=10)
    legend = axes.legend(
        loc="lower left",
        bbox_to_anchor=(-0.01, 0.99),
        ncols=5,
        frameon=False,
        labelcolor=INK,
        handlelength=1.3,
        columnspacing=0.9,
        fontsize=8.8,
        borderaxespad=0.2,
    )
    legend.set_in_layout(False)


def _map(axes: Axes, name: str, values: Floats) -> None:
    """Draw the ratings by one rater, with a row for each honest provider; dark is low."""
    shown = np.ma.masked_invalid(values[:_SHOWN].T)
    colours = LinearSegmentedColormap.from_list("lies", [ATTACKER, "#FDF3EC"])
    axes.imshow(shown, cmap=colours, vmin=0, vmax=1, aspect="auto", interpolation="none")
    text = f"ratings by {name}, one row per honest provider; dark is 0, light is 1"
    axes.set_title(text, loc="left", fontsize=8.8, color=INK).set_in_layout(False)
    axes.set_title(" ", fontsize=8.8)
    axes.set_ylabel("provider", color=INK)
    axes.set_yticks([])
    axes.tick_params(colors=QUIET, labelcolor=INK, length=3)
    for side in axes.spines.values():
        side.set_visible(False)


def _is_many(trajectories: Sequence[Trajectory], values: Floats) -> bool:
    """Return whether there are too many ratings for lines, and they differ in some attack."""
    different = any(np.ptp(given[1:], axis=1).max() > 1e-9 for t in trajectories for given in t.ratings.values())
    return different and (values.shape[1] > _FEW or len(trajectories[0].ratings) > 1)


def _trust(axes: Axes, trajectory: Trajectory) -> None:
    """Draw the trust of the attacker's agents, of each if they are few, and the mean of the honest agents."""
    tidy(axes, "trust")
    dashes, colours = {"ToR": "-", "ToP": (0, (4, 1.5))}, _agents(trajectory)
    lines = [(kind, "honest", HONEST[0], values) for kind, values in trajectory.honest.items()]
    if len(colours) <= len(ATTACKERS):
        for name, values in trajectory.own.items():
            kind, _, agent = name.partition(" of ")
            lines.append((kind, agent, colours[agent], values))
    else:
        lines += [(kind, "attackers", ATTACKER, values) for kind, values in trajectory.mine.items()]
    for kind, whose, colour, values in lines:
        axes.plot(values[:_SHOWN], color=colour, linestyle=dashes[kind], lw=1.7, label=f"{kind} {whose}")


def _gains(axes: Axes, trajectory: Trajectory) -> None:
    """Draw the objective and the cost of each round."""
    tidy(axes, "per round")
    rounds = np.arange(min(_SHOWN, len(trajectory.cost)))
    axes.plot(rounds, trajectory.objective[:_SHOWN], color=HONEST[1], lw=1.7, label="objective")
    if not trajectory.price:
        return
    cost = trajectory.cost[:_SHOWN]
    axes.fill_between(rounds, 0, cost, color=ATTACKERS[1], alpha=0.35, lw=0)
    axes.plot(rounds, cost, color=ATTACKERS[1], lw=1.4, label="cost: gap over tolerance")


def _step(axes: Axes, values: Floats, label: str, colour: str, lw: float) -> None:
    axes.step(np.arange(len(values))[:_SHOWN], values[:_SHOWN], where="mid", color=colour, lw=lw, label=label)


if __name__ == "__main__":
    main()
