"""Every way to attack a task, from honest play to the optimum, in one table and one picture.

Each rung of the ladder looks for an attack with the same budget of game rounds. All attacks are
then measured in the same held-out games. The score is the mean reward per round with its 95%
confidence interval, over the runs or, for a single run, over its games. The share is 0 for honest
play. It is 1 for the exact optimum, for a proven bound, or for the best attack found where neither
is known.

scripted: on-off and bad-mouthing as in the paper, or the attacks of `--attack`. random search,
CMA-ES: over the parameters that the scripted attacks declare. universal, evolution: coalitions as
one mind, ready ones of the project, and one that evolves for this task.
white-box planner: follows the gradient through the game. learned: the attackers of `--learned`,
folders that `roletrust train` has written with as many runs and the same seeds. exact: dynamic
programming, for one provider (exploit, no stealth) in a game without randomness. best known:
planned lies, for raters (damage) in a game without randomness; for one rater with a bound that no
attack exceeds.

The recipe `ladder` has three colluders in a crowd, whose trainings are those of the recipe
`colluders` of the study `pages`; half an hour on two cores for both.
"""

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from roletrust_agents.planning.optimum import BestKnown, Exact
from roletrust_agents.planning.planner import Planner
from roletrust_agents.training.coalition_methods import EvolutionSearch
from roletrust_agents.training.universal import Universal
from roletrust_baselines.search import CmaEs, PaperAttacks, RandomSearch
from roletrust_env import make_scenario
from roletrust_env.envs.attack_env import TASKS, find_task
from roletrust_env.evaluation.measurement import TaskArguments, exact_task
from roletrust_env.evaluation.scripts import Scripts
from roletrust_env.evaluation.search import (
    Budget,
    HonestPlay,
    MeasuredSearch,
    SearchMethod,
    UnsuitableError,
    find,
)
from roletrust_env.evaluation.specs import parse_kinds, parse_settings, parse_trust_model
from roletrust_env.metrics.confidence import Interval, over_games
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from studies.study import Recipe, Study
from studies.trained import learned_methods


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
        budget: Rounds x games that each search method and the planner may play.
        games: Number of held-out games that measure each attack.
        runs: Number of runs, with the seed of the study and those after it.
        learned: Folder of trained attackers.
    """

    task: str = "CollusionAttack"
    scenario: str = ""
    set: tuple[str, ...] = ()
    model: str = "role-trust"
    compromised: tuple[str, ...] = ()
    attack: tuple[str, ...] = ()
    stealth_weight: float = 0.0
    budget: int = 2_000_000
    games: int = 100
    runs: int = 1
    learned: tuple[Path, ...] = ()


_COLLUDERS = Options(stealth_weight=2.0, runs=5, learned=(Path("results/colluders/runs"),))
RECIPES = {"ladder": Recipe(_COLLUDERS, {"ladder.png": "ladder.png"}), "task": Recipe(Options())}


_TOLERANCE = 0.1  # trust gap that costs nothing

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


def main(study: Study[Options]) -> None:
    """Climb the ladder of a task, and write its rungs."""
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
        "stealth": {"weight": asked.stealth_weight, "tolerance": _TOLERANCE},
    }
    kinds = parse_kinds(list(asked.attack), rules) if asked.attack else None
    Scripts.of(exact_task(task), kinds)  # an attack that does not fit is refused before the games
    scripted: list[SearchMethod] = [
        rung(attacks=kinds) for rung in (PaperAttacks, RandomSearch, CmaEs)
    ]
    searches = [
        HonestPlay(),
        *scripted,
        Universal(wide=False),
        EvolutionSearch(wide=False),
        Planner(),
    ]
    seeds = range(seed, seed + asked.runs)
    trained = [learned_methods(path, seeds, "learned") for path in asked.learned]
    ladders = [
        [*searches, *(rungs[run] for rungs in trained), Exact(), BestKnown()]
        for run in range(asked.runs)
    ]
    climbed, missing = climb(ladders, task, asked.budget, seed, asked.games)
    rows = ranked(climbed)
    about = f"{task_id.removeprefix('RoleTrust/')}, {rules.name}, {defaults['objective']}"
    if asked.stealth_weight:
        about += f" less {asked.stealth_weight:g} x gap over {_TOLERANCE:g}"
    study.csv("ladder.csv", HEADER, lines(rows, seed))
    score, what = top(rows)
    over = f"over {asked.runs} runs" if asked.runs > 1 else "over the held-out games"
    intervals = [Interval(row.score, row.score - row.half, row.score + row.half) for row in rows]
    series = Series("score", [row.name for row in rows], intervals)
    panel = Panel("score: mean reward per round", "", "score", [series])
    study.figure("ladder.png", panels_figure(about, [panel], f"95% intervals {over}"))
    study.page(
        "ladder.md",
        f"# {about}",
        markdown_table(["rung", "score", "share", "rounds", "seconds"], map(_cells, rows), 1),
        f"Share: 0 is honest play, 1 is {what}, {score:.4f}; ± half the 95% interval {over}, "
        "rounded up.",
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
) -> tuple[list[list[MeasuredSearch]], dict[str, str]]:
    """Run every rung.

    Args:
        ladders: The same rungs for each run.
        arguments: Arguments of the task.
        budget: Budget of each search.
        seed: Seed of the first run; each later run has the next one.
        games: Number of held-out games that measure each attack.

    Returns:
        The results of each rung in each run, and the reasons why some rungs do not apply.
    """
    searches, missing = [], {}
    for rungs in zip(*ladders, strict=True):
        try:
            searches.append(
                [
                    find(rung, arguments, budget=Budget(budget), seed=run, games=games)
                    for run, rung in enumerate(rungs, start=seed)
                ]
            )
        except UnsuitableError as error:
            missing[rungs[0].name] = str(error)
    return searches, missing


def ranked(searches: Sequence[Sequence[MeasuredSearch]]) -> list[Row]:
    """Return the rungs with their runs and shares: 0 is honest play, the first rung, and 1 is the
    top, see `top`.
    """
    rows = []
    for runs in searches:
        means = np.array([run.scores.mean() for run in runs])
        score, half, _ = over_games(means if len(runs) > 1 else runs[0].scores)
        # Games without randomness differ only by rounding.
        rows.append(
            Row(
                runs[0].name,
                tuple(runs),
                float(score),
                float(half) if half > 1e-12 else 0.0,
                np.nan,
            )
        )
    foot, highest = rows[0].score, top(rows)[0]
    if highest <= foot:
        return rows
    return [row._replace(share=(row.score - foot) / (highest - foot)) for row in rows]


def top(rows: Sequence[Row]) -> tuple[float, str]:
    """Return the score with share 1, and its meaning: the exact optimum, a bound, or the best score
    found.
    """
    for row in rows:
        bound = row.runs[0].bound
        if bound is not None:
            return bound, "the exact optimum" if row.name == "exact" else "a bound that is proven"
    return max(row.score for row in rows), "the best that was found"


def lines(rows: Sequence[Row], seed: int) -> list[tuple[Any, ...]]:
    """Return the runs as lines under `HEADER`. The first run has the given seed."""
    table = []
    for row in rows:
        for run, search in enumerate(row.runs, start=seed):
            score, half, _ = over_games(search.scores)
            parts = (
                float(score),
                float(half),
                float(search.objective.mean()),
                float(search.cost.mean()),
            )
            table.append((row.name, run, *parts, search.rounds, search.seconds, search.description))
    return table


def _run_name(row: Row, seed: int) -> str:
    """Return the name of the best run of a rung. The first run has the given seed."""
    return (
        f"{row.name}, seed {seed + row.best}"
        if len(row.runs) > 1 and row.runs[0].rounds
        else row.name
    )


def _cells(row: Row) -> list[str]:
    """Return a row of the table; half an interval is rounded up."""
    score = f"{row.score:.4f}" + (f" ± {ceil(row.half * 1e4) / 1e4:.4f}" if row.half > 0 else "")
    rounds, seconds = (
        max(run.rounds for run in row.runs),
        float(np.mean([run.seconds for run in row.runs])),
    )
    share = "" if np.isnan(row.share) else f"{row.share:.3f}"
    return [row.name, score, share, f"{rounds:,}" if rounds else "-", f"{seconds:.1f}"]
