"""Populations that learn under a trust model, and what they come to."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from roletrust_agents.strategic.learning import MEASURED, LearningSettings, best_response, best_welfare, learn, play
from roletrust_agents.strategic.strategies import (
    Floats,
    Side,
    StrategyProfile,
    departure,
    honest_population,
    random_population,
)
from roletrust_env import Game, Scenario
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.errors import suggest
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.metrics.confidence import Estimate, Interval, estimate
from roletrust_env.storage.untrusted import UntrustedModel, check_plain

MODELS = ("role-trust", "wary-role-trust", "leave-one-out", "qor", "median", "beta", "own-experience")
SCENARIOS, COSTS = ("crowd", "market"), (0.1, 0.3)
STARTS = ("nobody learns", "honest", "honest, shuffled", "random")
"""Starts of the learners. In the first everybody stays honest; in the third rewards are shuffled, see `learn`."""

SUITE = "standard"
HONEST_WITHIN = 0.1
"""Departure from honest play up to which a strategy counts as honest."""

MEASURES = (
    "welfare",
    "best_welfare",
    "quality",
    "utility",
    "provider_reward",
    "rater_reward",
    "honest_providers",
    "honest_raters",
    "provider_gain",
    "rater_gain",
    "moved",
)
"""Names of what is measured in each run.

`welfare`, `quality`, `utility`: see `roletrust_agents.strategic.learning`. `best_welfare`: the highest one of
populations that play alike. `honest_providers`, `honest_raters`: share of the agents with an honest strategy.
`provider_gain`, `rater_gain`: what the best deviation of one agent brings it. `moved`: mean change of the departure
from honest play in the last quarter of the learning.
"""

_DEVIATIONS = "provider_deviation", "rater_deviation"
_ROUNDS = 30
_SMALL = 0.01  # of the best welfare: what is less is nothing
_WORDS: dict[Side, tuple[str, str]] = {"providers": ("level", "reaction"), "raters": ("lift", "following")}


class Effort(NamedTuple):
    """Effort for each population.

    Attributes:
        runs: Number of runs side by side, with other random numbers and other learners.
        steps: Number of steps of the learners.
        games: Number of games that measure each run.
        seed: Random seed.
    """

    runs: int
    steps: int
    games: int
    seed: int


class Point(NamedTuple):
    """A population under a trust model.

    Attributes:
        scenario: Name of a scenario of the suite.
        model: Spec of the trust model.
        cost: Cost of a service of quality 1, see `Rewards.quality_cost`.
        start: Start of the learners, one of `STARTS`.
    """

    scenario: str
    model: str
    cost: float
    start: str

    @property
    def key(self) -> str:
        """Unique key of the point."""
        return "|".join(map(str, self))

    def game(self) -> Game:
        """Return the game, in single precision.

        Raises:
            ValueError: The scenario or the trust model is unknown, or a number is not allowed.
        """
        scenario = _stage(self.scenario)
        rewards = {**scenario.rewards.model_dump(), "quality_cost": self.cost}
        scenario = scenario.change(max_cycles=_ROUNDS, rewards=rewards)
        return Game(scenario, parse_trust_model(self.model, scenario), like=np.zeros((), np.float32))


class Level(NamedTuple):
    """What a population comes to, over its runs.

    Attributes:
        point: The population.
        estimates: Mean of each measure with its interval.
        anarchy: Price of anarchy with its interval: best welfare over welfare; infinite if welfare is not above 0.
        deviations: The most frequent best deviation of a provider and of a rater, in words.
    """

    point: Point
    estimates: dict[str, Estimate]
    anarchy: Interval
    deviations: tuple[str, str]

    @classmethod
    def of(cls, point: Point, run: Mapping[str, Any]) -> Self:
        """Return the level of a point from its runs."""
        values = {name: np.asarray(run[name], np.float64) for name in MEASURES}
        words = [run[name] for name in _DEVIATIONS]
        common = [max(sorted(set(some)), key=list(some).count) for some in words]
        return cls(
            point,
            {name: estimate(each) for name, each in values.items()},
            price_of_anarchy(values["best_welfare"], values["welfare"]),
            (common[0], common[1]),
        )


def points(scenarios: Sequence[str], models: Sequence[str], costs: Sequence[float]) -> list[Point]:
    """Return all populations, in order."""
    return [Point(s, m, c, start) for s in scenarios for c in costs for m in models for start in STARTS]


class _Kept(UntrustedModel):
    """What is kept of a population: one value for each run."""

    numbers: dict[str, tuple[float, ...]]
    deviations: dict[str, tuple[str, ...]]


def check_of(effort: Effort) -> Callable[[str, Mapping[str, Any]], None]:
    """Return the check of the stored runs of a population, see `play_point`."""

    def check(key: str, run: Mapping[str, Any]) -> None:
        parts = {"numbers": MEASURES, "deviations": _DEVIATIONS}
        stored = {part: {name: run.get(name) for name in names} for part, names in parts.items()}
        kept = check_plain(_Kept, stored)
        for name, values in {**kept.numbers, **kept.deviations}.items():
            if len(values) != effort.runs:
                raise ValueError(f"{name} has {len(values)} runs; the settings have {effort.runs}")

    return check


def play_point(point: Point, effort: Effort) -> dict[str, Any]:
    """Let a population learn and measure it. Returns one value for each run, by the names of `MEASURES`."""
    game, seed, batch = point.game(), effort.seed, (effort.runs,)
    population, moved = honest_population(game, batch), np.zeros(effort.runs)
    if point.start != STARTS[0]:
        begin = random_population(game, batch, seed) if point.start == "random" else population
        learned = learn(
            game, begin, LearningSettings(steps=effort.steps), seed, shuffled=point.start.endswith("shuffled")
        )
        population, course = learned.population, learned.course
        moved = np.abs(course[-1] - course[-1 - (effort.steps - 1) // 4]).mean(axis=0)
    spread = StrategyProfile(*(part[:, :, None, :, None] for part in population))
    played = play(game, spread, (MEASURED, seed), (effort.runs, effort.games), rows=1)
    provider, rater = (best_response(game, population, side, seed, effort.games // 2) for side in _WORDS)
    rewards = played.rewards[:, 0].mean(axis=-1)
    found: dict[str, Floats] = {
        "welfare": played.welfare[0].mean(axis=-1),
        "best_welfare": best_welfare(game, seed, effort.runs, effort.games // 2),
        "quality": played.quality[0].mean(axis=-1),
        "utility": played.utility[0].mean(axis=-1),
        "provider_reward": game.roster.providers(rewards).mean(axis=0),
        "rater_reward": game.roster.raters(rewards).mean(axis=0),
        "honest_providers": _honest("providers", population.providers),
        "honest_raters": _honest("raters", population.raters),
        "provider_gain": provider.gain,
        "rater_gain": rater.gain,
        "moved": moved,
    }
    deviations = _in_words("providers", provider.parameters), _in_words("raters", rater.parameters)
    return {name: values.tolist() for name, values in found.items()} | dict(zip(_DEVIATIONS, deviations, strict=True))


def price_of_anarchy(best: Floats, welfare: Floats) -> Interval:
    """Return the price of anarchy of R runs with its 95% interval: mean best welfare over mean welfare.

    Around the quotient p the runs vary as (best - p welfare) / mean welfare, to first order. Where the interval of
    welfare reaches down to a hundredth of the best one, nothing is left of it, and the price is infinite.

    Example:
        >>> price_of_anarchy(np.array([0.9, 0.9]), np.array([0.45, 0.45])).value
        2.0
        >>> price_of_anarchy(np.array([0.9, 0.9]), np.array([0.2, -0.2])).value
        inf
    """
    mean = estimate(welfare)
    if mean.mean - np.nan_to_num(mean.half) <= _SMALL * best.mean():
        return Interval(np.inf, np.nan, np.inf)
    price = float(best.mean() / mean.mean)
    half = estimate((best - price * welfare) / mean.mean).half
    return Interval(price, price - half, price + half)


def _stage(name: str) -> Scenario:
    suite = load_suite(SUITE)
    assert isinstance(suite, Suite)
    if name not in suite.scenarios:
        raise ValueError(f"suite {SUITE} has no scenario {name!r}{suggest(name, suite.scenarios)}")
    return suite.scenarios[name].scenario()


def _honest(side: Side, parameters: Floats) -> Floats:
    """Return the share of honest agents in each run."""
    share: Floats = (departure(side, parameters) <= HONEST_WITHIN).mean(axis=0)
    return share


def _in_words(side: Side, parameters: Floats) -> list[str]:
    """Return a strategy of each run in words."""
    names = _WORDS[side]
    return [
        ", ".join(f"{n} {round(float(v), 2) + 0.0:g}" for n, v in zip(names, one, strict=True)) for one in parameters.T
    ]
