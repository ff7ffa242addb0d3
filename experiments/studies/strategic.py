"""Whether honest service stays the best response when providers and raters learn, too.

Agents earn what the environment rewards: trust, less the cost of their services. A provider chooses
a level of quality and how it reacts to its own trust; a rater chooses how far it lifts or sinks its
ratings and how far it follows published trust. All agents learn at once, each for itself, from
honest play and from random strategies. With shuffled rewards nothing can be learnt, and what
happens is drift.

Measured: welfare, which is the quality that consumers get less its cost; the price of anarchy,
which is the best welfare over the welfare of what was learnt; the share of honest agents; and the
gain of the best deviation of one agent, with everybody honest and with what was learnt. Some ten
minutes on one core.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from roletrust_agents.strategic.learning import (
    MEASURED,
    LearningSettings,
    best_response,
    best_welfare,
    learn,
    play,
)
from roletrust_agents.strategic.strategies import (
    Floats,
    Side,
    StrategyProfile,
    departure,
    honest_population,
    random_population,
)
from roletrust_env import Game, Scenario, make_scenario
from roletrust_env.errors import suggest
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.metrics.confidence import Interval, estimate
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from studies.study import Recipe, Run, Study, plus_minus, with_ends


class Options(NamedTuple):
    """Populations, and the effort for each.

    Attributes:
        model: Specs of the trust models.
        scenario: Names of worlds of `WORLDS`.
        cost: Costs of a service of quality 1, see `Rewards.quality_cost`.
        runs: Number of runs side by side, with other random numbers and other learners.
        steps: Number of steps of the learners.
        games: Number of games that measure each run, an even number: one half chooses, the other
            one measures.
    """

    model: tuple[str, ...] = (
        *("role-trust", "wary-role-trust", "leave-one-out", "qor", "median", "beta"),
        "own-experience",
    )
    scenario: tuple[str, ...] = ("crowd", "market")
    cost: tuple[float, ...] = (0.1, 0.3)
    runs: int = 5
    steps: int = 150
    games: int = 32


_RATERS = {"role": "SR", "count": 10, "noise": 0.05}
WORLDS: dict[str, tuple[str, dict[str, Any]]] = {
    "crowd": (
        "crowd-10x10",
        {"agents": [_RATERS, {"role": "SP", "count": 10, "ability": [0.3, 1.0]}]},
    ),
    "market": (
        "market",
        {
            "agents": [_RATERS, {"role": "SP", "count": 6, "ability": [0.3, 1.0]}],
            "ratings": {"lost": 0.9},
        },
    ),
}
"""Preset and changed fields of each world, by its name."""

FILES = ("strategic.png", "strategic.md", "strategic.csv")
RECIPES = {"strategic": Recipe(Options(), {name: f"strategic/{name}" for name in FILES})}

STARTS = {
    "nobody learns": "nobody learns",
    "honest": "from honest play",
    "honest, shuffled": "the same, shuffled",
    "random": "from random",
}
"""Starts of the learners with their labels. In the first everybody stays honest; in the third
rewards are shuffled."""

HONEST_WITHIN = 0.1
"""Departure from honest play up to which a strategy counts as honest."""

DEVIATIONS = "provider_deviation", "rater_deviation"
_COLUMNS = {
    "gain, provider": "provider_gain",
    "gain, rater": "rater_gain",
    "honest providers": "honest_providers",
    "honest raters": "honest_raters",
    "quality": "quality",
    "welfare": "welfare",
}
_ROUNDS = 30
_SMALL = 0.01  # of the best welfare: what is less is nothing
_WORDS: dict[Side, tuple[str, str]] = {
    "providers": ("level", "reaction"),
    "raters": ("lift", "following"),
}


def world(name: str) -> Scenario:
    """Return a world by its name."""
    if name not in WORLDS:
        raise ValueError(f"there is no world {name!r}{suggest(name, WORLDS)}")
    preset, changes = WORLDS[name]
    return make_scenario(preset).change(**changes)


class Point(NamedTuple):
    """A population under a trust model: scenario, spec of the model, cost of a service, and start
    of the learners.
    """

    scenario: str
    model: str
    cost: float
    start: str

    def game(self) -> Game:
        """Return the game, in single precision."""
        scenario = world(self.scenario)
        rewards = {**scenario.rewards.model_dump(), "quality_cost": self.cost}
        scenario = scenario.change(max_cycles=_ROUNDS, rewards=rewards)
        return Game(
            scenario, parse_trust_model(self.model, scenario), like=np.zeros((), np.float32)
        )


def main(study: Study[Options]) -> None:
    """Let all populations learn, and write what they come to."""
    asked = study.options
    points = [
        Point(scenario, model, cost, start)
        for scenario in asked.scenario
        for cost in sorted(asked.cost)
        for model in asked.model
        for start in STARTS
    ]
    effort = {"runs": asked.runs, "steps": asked.steps, "games": asked.games, "seed": study.seed}
    jobs = {"|".join(map(str, point)): (point, effort) for point in points}
    played = study.play(play_point, jobs, effort)
    runs = {point: played[key] for key, (point, _) in jobs.items() if key in played}
    measures = _measures(next(iter(runs.values())))
    header = ["scenario", "model", "cost", "start", *with_ends(measures, ("", "_half_95"))]
    header += [*with_ends(["anarchy"], ("", "_low_95", "_high_95")), *DEVIATIONS]
    study.csv("strategic.csv", header, [_line(*item) for item in runs.items()])
    rows = [_cells(*item) for item in runs.items()]
    headings = ["world", "model", "start", *_COLUMNS, "price of anarchy"]
    note = (
        f"{asked.runs} runs of {asked.steps} steps, {asked.games} games each; 95% intervals "
        "over the runs"
    )
    study.page(
        "strategic.md", markdown_table(headings, rows, 3), f"{note}. Made by `{study.command}`."
    )
    title = "What is left of welfare when providers and raters learn, by trust model?"
    figure = panels_figure(title, _panels(runs), f"{asked.runs} runs; 95% intervals")
    study.figure("strategic.png", figure)


def play_point(point: Point, effort: Mapping[str, int]) -> Run:
    """Let a population learn and measure it.

    Returns:
        One value for each run. `welfare`, `quality`, `utility`: see
        `roletrust_agents.strategic.learning`. `best_welfare`: the highest one of populations that
        play alike. `honest_providers`, `honest_raters`: share of the agents with an honest
        strategy. `provider_gain`, `rater_gain`: what the best deviation of one agent brings it;
        `DEVIATIONS` has it in words. `moved`: mean change of the departure from honest play in the
        last quarter of the learning.
    """
    game, (runs, steps, games, seed) = point.game(), effort.values()
    batch = (runs,)
    population, moved = honest_population(game, batch), np.zeros(runs)
    if point.start != "nobody learns":
        begin = random_population(game, batch, seed) if point.start == "random" else population
        shuffled = point.start.endswith("shuffled")
        population, course = learn(
            game, begin, LearningSettings(steps=steps), seed, shuffled=shuffled
        )[:2]
        moved = np.abs(course[-1] - course[-1 - (steps - 1) // 4]).mean(axis=0)
    spread = StrategyProfile(*(part[:, :, None, :, None] for part in population))
    played = play(game, spread, (MEASURED, seed), (runs, games), rows=1)
    provider, rater = (best_response(game, population, side, seed, games // 2) for side in _WORDS)
    rewards = played.rewards[:, 0].mean(axis=-1)
    measures: dict[str, Floats] = {
        "welfare": played.welfare[0].mean(axis=-1),
        "best_welfare": best_welfare(game, seed, runs, games // 2),
        "quality": played.quality[0].mean(axis=-1),
        "utility": played.utility[0].mean(axis=-1),
        "provider_reward": game.roster.providers(rewards).mean(axis=0),
        "rater_reward": game.roster.raters(rewards).mean(axis=0),
        "honest_providers": (departure("providers", population.providers) <= HONEST_WITHIN).mean(
            axis=0
        ),
        "honest_raters": (departure("raters", population.raters) <= HONEST_WITHIN).mean(axis=0),
        "provider_gain": provider.gain,
        "rater_gain": rater.gain,
        "moved": moved,
    }
    words = [_in_words("providers", provider.parameters), _in_words("raters", rater.parameters)]
    return {name: values.tolist() for name, values in measures.items()} | dict(
        zip(DEVIATIONS, words, strict=True)
    )


def price_of_anarchy(best: Floats, welfare: Floats) -> Interval:
    """Return the price of anarchy of R runs with its 95% interval: mean best welfare over mean
    welfare.

    Around the quotient p the runs vary as (best - p welfare) / mean welfare, to first order. Where
    the interval of welfare reaches down to a hundredth of the best one, nothing is left of it, and
    the price is infinite.

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


def _in_words(side: Side, parameters: Floats) -> list[str]:
    """Return a strategy of each run in words."""
    return [
        ", ".join(
            f"{n} {round(float(v), 2) + 0.0:g}"
            for n, v in zip(_WORDS[side], parameter_values, strict=True)
        )
        for parameter_values in parameters.T
    ]


def _measures(run: Run) -> list[str]:
    return [name for name in run if name not in DEVIATIONS]


def _measured(run: Run, name: str) -> Floats:
    return np.asarray(run[name], np.float64)


def _anarchy(run: Run) -> Interval:
    return price_of_anarchy(_measured(run, "best_welfare"), _measured(run, "welfare"))


def _line(point: Point, run: Run) -> list[Any]:
    """Return a row of the table of numbers, with the most frequent best deviation of a provider and
    of a rater.
    """
    numbers = [part for name in _measures(run) for part in estimate(_measured(run, name))[:2]]
    words = [max(sorted(set(run[name])), key=run[name].count) for name in DEVIATIONS]
    return [*point, *numbers, *(None if x == np.inf else x for x in _anarchy(run)), *words]


def _cells(point: Point, run: Run) -> list[str]:
    price, low, high = _anarchy(run)
    measures = [plus_minus(estimate(_measured(run, name))) for name in _COLUMNS.values()]
    anarchy = "∞" if price == np.inf else f"{price:.2f} ({low:.2f}, {high:.2f})"
    return [
        f"{point.scenario}, {point.cost:g}",
        f"`{point.model}`",
        point.start,
        *measures,
        anarchy,
    ]


def _panels(run_of_point: Mapping[Point, Run]) -> list[Panel]:
    """Return a panel for each scenario and cost: the welfare of each model by the start."""
    panels = []
    for scenario, cost in dict.fromkeys((point.scenario, point.cost) for point in run_of_point):
        series = []
        for start, label in STARTS.items():
            runs = {
                of_point.model: run
                for of_point, run in run_of_point.items()
                if (*of_point[::2], of_point.start) == (scenario, cost, start)
            }
            welfare = [estimate(_measured(run, "welfare")).interval for run in runs.values()]
            series.append(Series(label, list(runs), welfare))
        panels.append(Panel(f"{scenario}, cost {cost:g}", "", "welfare", series))
    return panels
