"""The worst case that a way to attack finds, by the number of game rounds that it may play."""

from collections.abc import Iterator, Mapping, Sequence
from time import perf_counter
from typing import NamedTuple, Self

import numpy as np
from pydantic import NonNegativeInt, model_validator

from roletrust_env.benchmarking.cells import make_search, scripted_batches
from roletrust_env.errors import suggest
from roletrust_env.evaluation.measurement import SEARCHED, exact_task, mean_rewards
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError, search_methods
from roletrust_env.metrics.confidence import Estimate
from roletrust_env.storage.untrusted import UntrustedModel
from studies.attackers.condition import Condition
from studies.attackers.runs import Run, mean_of

SCRIPTS = "scripts"
"""Way to attack: the best scripted attack at its defaults. Its rounds are those that choose it."""

MODELS = ("wary-role-trust", "beta", "role-trust", "qor", "subjective-logic", "iterative-filtering")
WAYS = (
    SCRIPTS,
    "random search",
    "agreed CMA-ES",
    "evolution",
    "evolution strategy",
    "gradients",
    "PPO",
    "coalition PPO",
)
BUDGETS = (10_000, 30_000, 100_000, 300_000, 1_000_000, 2_000_000)

_LONG, _MOST = ("PPO", "recurrent PPO", "SAC", "coalition PPO", "gradients"), 100_000
_GAMES = 40  # for each script, to choose the best
_OWN = 0  # budget of the scripts, which have no choice


class Point(NamedTuple):
    """One search.

    Attributes:
        model: Spec of the trust model.
        way: Name of a search method, or `SCRIPTS`.
        budget: Game rounds that the search may play; 0 for the scripts.
        seed: Random seed.
    """

    model: str
    way: str
    budget: int
    seed: int

    @property
    def key(self) -> str:
        """Unique key of the search."""
        return "|".join(map(str, self))


class Kept(UntrustedModel):
    """What is kept of a search, see `play_point`."""

    utility: float | None = None
    rounds: NonNegativeInt = 0
    seconds: float = 0.0
    attack: str = ""
    left_out: str = ""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.left_out and not {"utility", "rounds", "seconds"} <= self.model_fields_set:
            raise ValueError("it has neither left_out nor utility, rounds and seconds")
        return self


class Level(NamedTuple):
    """The worst case of a way at a budget, over the seeds.

    Attributes:
        model: Spec of the trust model.
        way: Name of the way.
        budget: Game rounds that each search may play; 0 for the scripts.
        rounds: Mean number of rounds that the searches played.
        utility: Utility of the consumer in fresh games.
        seconds: Mean wall-clock duration of a search.
    """

    model: str
    way: str
    budget: int
    rounds: int
    utility: Estimate
    seconds: float

    @property
    def at(self) -> int:
        """Position on the axis of rounds."""
        return self.budget or self.rounds


def known_ways(names: Sequence[str] | None) -> list[str]:
    """Return the ways to compare, by default those of `WAYS` that are installed.

    Raises:
        ValueError: A name is unknown, or a way has no such parameter.
    """
    installed = [SCRIPTS, *search_methods.names()]
    for name in names or ():
        if _base(name) not in installed:
            raise ValueError(f"unknown way {name!r}{suggest(name, installed)}")
        if name != SCRIPTS:
            make_search(name)
    return list(dict.fromkeys(names or [way for way in WAYS if way in installed]))


def points(models: Sequence[str], ways: Sequence[str], budgets: Sequence[int], seeds: Sequence[int]) -> list[Point]:
    """Return all searches: each model, way, budget and seed."""
    return [
        Point(model, way, budget, seed)
        for model in models
        for way in ways
        for budget in ((_OWN,) if way == SCRIPTS else budgets)
        for seed in seeds
    ]


def play_point(condition: Condition, point: Point, games: int) -> Run:
    """Search for an attack and measure it in fresh games.

    Args:
        condition: Condition of the attack.
        point: The search.
        games: Number of fresh games.

    Returns:
        The utility with rounds, seconds and the attack in a few words, or `left_out` with the reason.
    """
    began = perf_counter()
    try:
        found = _best_script(condition, point) if point.way == SCRIPTS else _search(condition, point)
    except UnsuitableError as error:
        return {"left_out": str(error)}
    seconds = perf_counter() - began
    utility = condition.utility(point.model, found.attacker, point.seed, games)
    return {"utility": utility, "rounds": found.rounds, "seconds": round(seconds, 3), "attack": found.description}


def levels(searches: Sequence[Point], runs: Mapping[str, Run]) -> list[Level]:
    """Return the worst case of each model, way and budget over the seeds, in the order of the searches."""
    groups: dict[tuple[str, str, int], list[Run]] = {}
    for point in searches:
        if "utility" in runs.get(point.key, {}):
            groups.setdefault(point[:3], []).append(runs[point.key])
    return [
        Level(
            *where,
            round(float(np.mean([run["rounds"] for run in found]))),
            mean_of([run["utility"] for run in found]),
            float(np.mean([run["seconds"] for run in found])),
        )
        for where, found in groups.items()
    ]


def left_out(searches: Sequence[Point], runs: Mapping[str, Run]) -> Iterator[str]:
    """Yield a line for each way and budget that is left out, with the reason and the models."""
    lines: dict[tuple[str, int, str], list[str]] = {}
    for point in searches:
        if reason := runs.get(point.key, {}).get("left_out"):
            lines.setdefault((point.way, point.budget, reason), []).append(point.model)
    everybody = {point.model for point in searches}
    for (way, budget, reason), models in lines.items():
        where = "" if set(models) == everybody else f" against {', '.join(dict.fromkeys(models))}"
        yield f"{way} with {budget:,} rounds{where}: {reason}"


def _search(condition: Condition, point: Point) -> SearchResult:
    if _base(point.way) in _LONG and point.budget > _MOST:
        raise UnsuitableError(f"a learner on torch gets {_MOST:,} rounds at most, because it takes long")
    method = make_search(point.way, list(condition.kinds(point.model).values()))
    return method.search(condition.arguments(point.model, _base(point.way)), Budget(point.budget), point.seed)


def _base(way: str) -> str:
    """Return the name of a way without its parameters."""
    return way.partition(":")[0]


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
                highest, best = mean, SearchResult(single.attacker, 0, f"{single.names[0]} at its defaults")
    if best is None:
        raise UnsuitableError("no scripted attack suits the compromised agents")
    return best._replace(rounds=rounds)
