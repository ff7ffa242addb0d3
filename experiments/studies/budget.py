"""How much worse the worst case of a trust model gets if its attacker may search longer.

Each method searches with each budget of game rounds. The attack that it finds is measured in fresh
games, the same ones for all methods: the utility of a consumer that goes to the most trusted
provider, as a share of the best possible. Lower is a better attack. The interval is over the runs.

The method `scripts` is the best of all scripted attacks at their defaults; its rounds are those
that choose it. A search that does not suit a budget is left out, and a line says why. Learners on
torch get at most 100,000 rounds. Seconds are those of the search alone; other processes make them
longer.

Six models and eight methods with up to two million rounds take two hours on two cores, the other
recipes half an hour.
"""

from collections.abc import Iterator, Mapping, Sequence
from time import perf_counter
from typing import NamedTuple

import numpy as np

from roletrust_env.benchmarking.cells import make_search, scripted_batches
from roletrust_env.evaluation.measurement import SEARCHED, exact_task, mean_rewards
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.metrics.confidence import Estimate
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from studies.condition import Condition
from studies.study import Recipe, Run, Study, mean_of, plus_minus

SCRIPTS = "scripts"
"""Method: the best scripted attack at its defaults."""


class Options(NamedTuple):
    """Searches, and the condition in which they are compared.

    Attributes:
        model: Specs of the trust models.
        method: Search methods, or `scripts`.
        budget: Rounds x games that a search may play.
        suite: Suite with the scenario and the track.
        scenario: Name of the scenario in the suite.
        track: Name of the track in the suite, which says who is compromised.
        share: Share of compromised agents in each role of the track.
        games: Number of fresh games that measure each attacker.
        runs: Number of searches, with the seed of the study and those after it.
    """

    model: tuple[str, ...] = (
        *(
            "wary-role-trust",
            "beta",
            "role-trust",
            "qor",
            "subjective-logic",
            "iterative-filtering",
        ),
    )
    method: tuple[str, ...] = (
        *(SCRIPTS, "random search", "agreed CMA-ES", "PPO"),
        *(
            "evolution:wide=false",
            "evolution strategy:wide=false",
            "gradients:wide=false",
            "coalition PPO:wide=false",
        ),
    )
    budget: tuple[int, ...] = (10_000, 30_000, 100_000, 300_000, 1_000_000, 2_000_000)
    suite: str = "two-worlds"
    scenario: str = "crowd"
    track: str = "coalition"
    share: float = 0.3
    games: int = 200
    runs: int = 3


_NARROW = ("evolution:wide=false", "evolution strategy:wide=false")
_FOUR = ("wary-role-trust", "beta", "role-trust", "qor")
_FIVE_RUNS = Options(_FOUR, (SCRIPTS, "agreed CMA-ES", *_NARROW), budget=(2_000_000,), runs=5)
_PPO = Options(
    (*_FOUR, "median"),
    (_NARROW[0], "coalition PPO:wide=false", "coalition PPO:start=random,wide=false"),
    (100_000,),
    runs=5,
)
_STANDARD = Options(
    ("first-hand", "own-experience", "travos", "subjective-logic", "fire", "peer-trust"),
    (SCRIPTS, "evolution strategy"),
    (75_000, 150_000, 300_000, 600_000),
    suite="standard",
    scenario="drawn-5",
    track="identities",
    runs=2,
)
_FILES = {
    "budget.png": "budget.png",
    "budget.md": "budget.md",
    "budget.csv": "budget.csv",
    "runs.json": "budget.json",
}
RECIPES = {
    "budget": Recipe(Options(), {name: f"attackers/{place}" for name, place in _FILES.items()}),
    "crowd-raters": Recipe(
        _FIVE_RUNS._replace(track="raters", share=0.5), {"budget.md": "attackers/crowd-raters.md"}
    ),
    "crowd-coalition": Recipe(_FIVE_RUNS, {"budget.md": "attackers/crowd-coalition.md"}),
    "market-raters": Recipe(
        _FIVE_RUNS._replace(scenario="market", track="raters"),
        {"budget.md": "attackers/market-raters.md"},
    ),
    "standard": Recipe(
        _STANDARD, {name: f"attackers/standard-{place}" for name, place in _FILES.items()}
    ),
    "ppo": Recipe(_PPO._replace(track="raters", share=0.5), {"budget.md": "attackers/ppo.md"}),
}

_LONG, _MOST = ("PPO", "recurrent PPO", "SAC", "coalition PPO", "gradients"), 100_000
_GAMES = 40  # for each script, to choose the best


class Point(NamedTuple):
    """One search: spec of the trust model, method, game rounds that it may play (0 for the
    scripts), and seed.
    """

    model: str
    method: str
    budget: int
    seed: int

    @property
    def key(self) -> str:
        """Unique key of the search."""
        return "|".join(map(str, self))


class Level(NamedTuple):
    """The worst case of a method at a budget, over the seeds.

    Attributes:
        model: Spec of the trust model.
        method: Name of the method.
        budget: Game rounds that each search may play; 0 for the scripts.
        rounds: Mean number of rounds that the searches played.
        utility: Utility of the consumer in fresh games.
        seconds: Mean wall-clock duration of a search.
    """

    model: str
    method: str
    budget: int
    rounds: int
    utility: Estimate
    seconds: float

    @property
    def at(self) -> int:
        """Position on the axis of rounds."""
        return self.budget or self.rounds


def main(study: Study[Options]) -> None:
    """Play all searches, and write the worst cases that they find."""
    asked = study.options
    condition = Condition.of(asked.suite, asked.scenario, asked.track, asked.share)
    searches = [
        Point(model, method, budget, study.seed + run)
        for model in asked.model
        for method in asked.method
        for budget in ((0,) if method == SCRIPTS else sorted(asked.budget))
        for run in range(asked.runs)
    ]
    jobs = {search.key: (condition, search, asked.games) for search in searches}
    finished = study.play(
        play_point, jobs, {"condition": condition.describe(), "games": asked.games}
    )
    levels_of_searches, reasons = levels(searches, finished), list(left_out(searches, finished))
    header = (
        "model",
        "method",
        "budget",
        "seed",
        "utility",
        "rounds",
        "seconds",
        "attack",
        "left_out",
    )
    rows = [
        [*search, *(finished[search.key].get(name) for name in header[4:])]
        for search in searches
        if search.key in finished
    ]
    study.csv("budget.csv", header, rows)
    title = f"Worst case by rounds of the search ({condition})"
    note = "lower is a better attack; 95% intervals over the runs"
    study.figure("budget.png", panels_figure(title, _panels(levels_of_searches), note, columns=3))
    study.page(
        "budget.md",
        markdown_table(*_table(levels_of_searches), names=2),
        f"Utility of the consumer in {asked.games} fresh games, mean ± half the 95% interval over "
        "the runs "
        f"({asked.runs}); in brackets the seconds of a search. Lower is a better attack. "
        f"Condition: {condition}.",
        "\n".join(f"- Left out: {line}." for line in reasons),
        f"Made by `{study.command}`.",
    )


def play_point(condition: Condition, point: Point, games: int) -> Run:
    """Search for an attack and measure it in fresh games.

    Returns:
        The utility with rounds, seconds and the attack in a few words, or `left_out` with the
        reason.
    """
    began = perf_counter()
    try:
        result = (
            _best_script(condition, point) if point.method == SCRIPTS else _search(condition, point)
        )
    except UnsuitableError as error:
        return {"left_out": str(error)}
    seconds = perf_counter() - began
    utility = condition.utility(point.model, result.attacker, point.seed, games)
    return {
        "utility": utility,
        "rounds": result.rounds,
        "seconds": round(seconds, 3),
        "attack": result.description,
    }


def levels(searches: Sequence[Point], runs: Mapping[str, Run]) -> list[Level]:
    """Return the worst case of each model, method and budget over the seeds, in the order of the
    searches.
    """
    groups: dict[tuple[str, str, int], list[Run]] = {}
    for point in searches:
        if "utility" in runs.get(point.key, {}):
            groups.setdefault(point[:3], []).append(runs[point.key])
    return [
        Level(
            *where,
            round(float(np.mean([run["rounds"] for run in runs_of_level]))),
            mean_of([run["utility"] for run in runs_of_level]),
            float(np.mean([run["seconds"] for run in runs_of_level])),
        )
        for where, runs_of_level in groups.items()
    ]


def left_out(searches: Sequence[Point], runs: Mapping[str, Run]) -> Iterator[str]:
    """Yield a line for each method that is left out, with the budgets, the models and the
    reason.
    """
    lines: dict[tuple[str, int, str], list[str]] = {}
    for point in searches:
        if reason := runs.get(point.key, {}).get("left_out"):
            lines.setdefault((point.method, point.budget, reason), []).append(point.model)
    budgets: dict[tuple[str, str, str], list[str]] = {}
    for (method, budget, reason), models in lines.items():
        every = set(models) == {point.model for point in searches}
        where = "" if every else f" against {', '.join(dict.fromkeys(models))}"
        budgets.setdefault((method, where, reason), []).append(f"{budget:,}")
    for (method, where, reason), rounds in budgets.items():
        yield f"{method} with {', '.join(rounds)} rounds{where}: {reason}"


def _search(condition: Condition, point: Point) -> SearchResult:
    if _base(point.method) in _LONG and point.budget > _MOST:
        raise UnsuitableError(
            f"a learner on torch gets {_MOST:,} rounds at most, because it takes long"
        )
    method = make_search(point.method, list(condition.kinds(point.model).values()))
    return method.search(
        condition.arguments(point.model, _base(point.method)), Budget(point.budget), point.seed
    )


def _base(method: str) -> str:
    """Return the name of a method without its parameters."""
    return method.partition(":")[0]


def _best_script(condition: Condition, point: Point) -> SearchResult:
    """Return the script with the best mean reward."""
    task = exact_task(condition.arguments(point.model))
    best: SearchResult | None = None
    highest, rounds = -np.inf, 0
    for batch in scripted_batches(task, condition.kinds(point.model), _GAMES):
        shape = len(batch.names), _GAMES
        means = mean_rewards(task, batch.attacker, point.seed, shape, SEARCHED)[0].mean(axis=1)
        rounds += shape[0] * _GAMES * task.game.scenario.max_cycles
        for mean, single in zip(means, batch.split(), strict=True):
            if mean > highest:
                highest, best = (
                    mean,
                    SearchResult(single.attacker, 0, f"{single.names[0]} at its defaults"),
                )
    if best is None:
        raise UnsuitableError("no scripted attack suits the compromised agents")
    return best._replace(rounds=rounds)


def _table(measured_levels: Sequence[Level]) -> tuple[list[str], list[list[str]]]:
    """Return the headings, and a row for each model and method; scripts stand at the first budget
    that covers them.
    """
    budgets = sorted({level.budget for level in measured_levels if level.budget}) or [
        max(level.rounds for level in measured_levels)
    ]
    rows: dict[tuple[str, str], list[str]] = {}
    for level in measured_levels:
        name = level.method if level.budget else f"{level.method}, {level.rounds:,} rounds"
        cells = rows.setdefault((level.model, name), ["-"] * len(budgets))
        at = next((k for k, limit in enumerate(budgets) if limit >= level.at), len(budgets) - 1)
        cells[at] = f"{plus_minus(level.utility)} ({level.seconds:,.0f} s)"
    return ["model", "method", *(f"{limit:,}" for limit in budgets)], [
        [*names, *row] for names, row in rows.items()
    ]


def _panels(measured_levels: Sequence[Level]) -> list[Panel]:
    """Return a panel for each trust model with a line for each method."""
    panels = []
    for model in dict.fromkeys(level.model for level in measured_levels):
        series = []
        for method in dict.fromkeys(
            level.method for level in measured_levels if level.model == model
        ):
            line = [
                level for level in measured_levels if (level.model, level.method) == (model, method)
            ]
            series.append(
                Series(
                    method, [level.at for level in line], [level.utility.interval for level in line]
                )
            )
        panels.append(
            Panel(model, "rounds of the search", "utility of the consumer", series, "log")
        )
    return panels
