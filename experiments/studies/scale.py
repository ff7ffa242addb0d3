"""Cities, in which each rater meets five of many providers in a round, from 25 agents to a million.

The first table is what attackers cost consumers, by the number of agents: a consumer goes to the most trusted of the
providers that it meets. Four in five agents are raters, so that every provider has 20 ratings a round in every city.
The second table is the time of a round and its memory, beside a round of `mean` in plain NumPy. Only central models can
be played. Some 20 minutes.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from statistics import mean, median
from typing import Any, NamedTuple

import numpy as np

from roletrust_baselines import BadMouthing, Collusion, OnOff
from roletrust_env import JointPolicy, Policy, Scenario, SparseGame, make_scenario
from roletrust_env.evaluation.resources import in_bytes
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.game.rollout import rollout
from roletrust_env.metrics.confidence import Estimate, Floats, estimate
from roletrust_env.metrics.consumers import share_of_best, skill
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust.run import edge_model
from studies.study import Recipe, Study, plus_minus
from studies.timing import PLAIN, Spread, machine, traced


class Options(NamedTuple):
    """Cities to play.

    Attributes:
        agents: Numbers of agents of attacked cities.
        cost: Numbers of agents of cities whose rounds are timed.
        model: Specs of central trust models.
        rounds: Rounds of an attacked city.
        seeds: Seeds of each attacked city, from the seed of the study on.
    """

    agents: tuple[int, ...] = (25, 100, 1000, 10_000)
    cost: tuple[int, ...] = (1000, 10_000, 100_000, 1_000_000)
    model: tuple[str, ...] = ("role-trust", "mean", "median")
    rounds: int = 30
    seeds: int = 20


MET = 5
"""Number of providers that a rater meets in a round of the preset `city`."""

LEAST = 5 * MET
"""Least number of agents of a city: a rater meets all of its providers."""

_GROUP = 100_000  # agents of a group, at most
_PERIOD = 10  # of the on-off providers, in rounds

ATTACKS = "bad-mouthing", "on-off", "collusion"
"""Attacks on a city."""

_ROUNDS = 1000  # more than are ever played where rounds are timed
_SHARE = 0.2  # of the raters attack there
_REPEATS = 5
_HARM_HEADER = ("agents", "model", "attack", "share", "skill", "skill_half", "harm", "harm_half")
_COST_HEADER = (
    *("agents", "services", "name", "ms", "ms_least", "ms_greatest", "plain_ms"),
    *("noise_ms", "policies_ms", "step_ms", "peak_bytes"),
)
_COST_HEADINGS = (
    *("model", "agents", "services", "ms", "least - greatest", "noise", "policies", "step", "times plain", "memory"),
)


RECIPES = {"scale": Recipe(Options(), {name: name for name in ("scale.md", "scale-harm.csv", "scale-costs.csv")})}
SHARES = 0.2, 0.4
"""Shares of attackers."""


class Harm(NamedTuple):
    """What an attack does to consumers of a city.

    Attributes:
        agents: Number of agents.
        model: Name of the trust model.
        attack: Name of the attack; `honest` for none.
        share: Share of compromised agents in the roles that the attack needs.
        skill: Skill of the choice by trust, mean over the seeds.
        harm: Skill of the honest city with the same luck, less that under the attack.
    """

    agents: int
    model: str
    attack: str
    share: float
    skill: Estimate
    harm: Estimate


Parts = tuple[float, float, float]
"""Seconds of the parts of a round: noise and encounters drawn, policies asked, round played."""


class RoundCost(NamedTuple):
    """Cost of a round.

    Attributes:
        agents: Number of agents.
        services: Number of services, and of ratings, in a round.
        name: Name of the trust model, or `PLAIN`.
        seconds: Processor time of the rounds that were timed, in seconds, which other work on the machine does not add
            to.
        by_hand: The same of the rounds in plain NumPy that were timed in turn with them.
        parts: Medians of its parts; None for plain NumPy, which has no such parts.
        memory: Peak of the memory of three rounds beyond that of the agents and their names, in bytes.
    """

    agents: int
    services: int
    name: str
    seconds: tuple[float, ...]
    by_hand: tuple[float, ...]
    parts: tuple[float, ...] | None
    memory: int


def main(arguments: Sequence[str] | None = None) -> None:
    """Play and time all cities, and write both tables."""
    with Study(__name__, RECIPES, arguments) as study:
        asked = study.options
        sizes, cost_sizes = sorted(asked.agents), sorted(asked.cost)
        scenario = make_scenario("city")
        models = {name: edge_model(parse_trust_model(name, scenario)) for name in asked.model}
        seeds = range(study.seed, study.seed + asked.seeds)
        harms = measure_harm(sizes, models, SHARES, asked.rounds, seeds)
        costs = measure_rounds(cost_sizes, models, study.seed)
        study.csv("scale-harm.csv", _HARM_HEADER, [(*one[:4], *one.skill[:2], *one.harm[:2]) for one in harms])
        rows = [_cost_row(one) for one in costs]
        study.csv("scale-costs.csv", _COST_HEADER, rows)
        harm_headings, *harm_lines = _harm_lines(harms)
        study.page(
            "scale.md",
            "# Cities of up to a million agents",
            "## Skill that consumers lose to attackers",
            _harm_caption(harms, asked.seeds, asked.rounds),
            markdown_table(harm_headings, harm_lines, 3),
            "## What a round costs",
            "Milliseconds of processor time of a round in which a fifth of the raters bad-mouths, the median; noise, "
            f"policies and step are its parts. {PLAIN}: a round of mean by hand, in turn with each of the others. "
            "Memory: the peak of three rounds, beyond the agents and their names; role-trust remembers every pair that "
            "ever met.",
            markdown_table(_COST_HEADINGS, [_cost_line(*row) for row in rows], 1),
            f"Made by `{study.command}` on {machine()}.",
        )


def city(agents: int, rounds: int) -> Scenario:
    """Return the preset `city` with another number of agents, four raters to each provider, and of rounds."""
    preset = make_scenario("city")
    groups = [
        group.model_copy(update={"count": min(_GROUP, count - begun)}).model_dump()
        for group, count in zip(preset.agents, city_sizes(agents), strict=True)
        for begun in range(0, count, _GROUP)
    ]
    return preset.change(agents=groups, max_cycles=rounds)


def city_sizes(agents: int) -> tuple[int, int]:
    """Return the numbers of raters and of providers of a city."""
    return agents - agents // 5, agents // 5


def attackers(game: SparseGame, attack: str, share: float) -> dict[str, Policy]:
    """Return the policies of the attackers: the first raters, the first providers, or both.

    Bad-mouthing raters rate everybody 0. On-off providers serve badly in half of all rounds. The providers of a ring
    serve badly, and its raters praise them and rate all others 0.

    Args:
        game: City.
        attack: One of `ATTACKS`.
        share: Share of the agents of a role that attack; at least one.
    """
    raters, providers = (
        names[: max(1, round(share * len(names)))] for names in (game.roster.rater_names, game.roster.provider_names)
    )
    if attack == "bad-mouthing":
        return dict.fromkeys(raters, BadMouthing(level=0.0))
    if attack == "on-off":
        return dict.fromkeys(providers, OnOff(period=_PERIOD))
    ring = Collusion(accomplices=tuple(range(len(providers))))
    return dict.fromkeys([*raters, *providers], ring)


def measure_harm(
    sizes: Sequence[int], models: Mapping[str, Any], shares: Sequence[float], rounds: int, seeds: Sequence[int]
) -> list[Harm]:
    """Play cities with and without attackers, with the same luck.

    Args:
        sizes: Numbers of agents.
        models: Central trust models by name.
        shares: Shares of attackers.
        rounds: Number of rounds.
        seeds: Seeds, two or more for an interval.
    """
    found = []
    for agents in sizes:
        scenario = city(agents, rounds)
        for name, model in models.items():
            game = SparseGame(scenario, model)
            played: dict[tuple[str, float], Floats] = {}
            for attack, share in [("honest", 0.0), *((attack, share) for attack in ATTACKS for share in shares)]:
                seats = JointPolicy(game, attackers(game, attack, share) if share else {})
                got = np.array([_utilities(seats, seed) for seed in seeds]).T
                played[attack, share] = skill(*got)
                harm = estimate(played["honest", 0.0] - played[attack, share])
                found.append(Harm(agents, name, attack, share, estimate(played[attack, share]), harm))
    return found


def _utilities(seats: JointPolicy, seed: int) -> tuple[float, float]:
    """Return the utility of the choice by trust and of a blind choice in one game."""
    game, random = seats.game, seats.game.random(seed)
    assert isinstance(game, SparseGame)
    bought = np.array([game.bought(*played[:3]) for played in rollout(seats, random, random)])
    got, best, blind = bought.T
    return float(share_of_best(got, best).value), float(share_of_best(blind, best).value)


def measure_rounds(sizes: Sequence[int], models: Mapping[str, Any], seed: int = 0) -> list[RoundCost]:
    """Time rounds of cities in which a fifth of the raters bad-mouths, each in turn with plain NumPy.

    Args:
        sizes: Numbers of agents.
        models: Central trust models by name.
        seed: Random seed.
    """
    found = []
    for agents in sizes:
        scenario, (raters, providers) = city(agents, _ROUNDS), city_sizes(agents)
        by_hand, memory = traced(partial(plain, raters, providers, seed), 3)
        rows = []
        for name, model in models.items():
            play, peak = traced(_player(SparseGame(scenario, model), seed), 3)
            turns = [(play(), sum(by_hand())) for _ in range(_REPEATS)]
            parts = tuple(median(column) for column in zip(*(taken for taken, _ in turns), strict=True))
            seconds, hand = tuple(sum(taken) for taken, _ in turns), tuple(taken for _, taken in turns)
            rows.append(RoundCost(agents, MET * raters, name, seconds, hand, parts, peak))
            del play
        hand = rows[0].by_hand
        found += [*rows, RoundCost(agents, MET * raters, PLAIN, hand, hand, None, memory)]
    return found


def _player(game: SparseGame, seed: int) -> Callable[[], Callable[[], Parts]]:
    """Return a function that starts the game and returns a function that plays its next round."""
    seats = JointPolicy(game, attackers(game, "bad-mouthing", _SHARE))

    def start() -> Callable[[], Parts]:
        random = game.random(seed)
        state = game.start(game.draw(random, start=True))
        memories = seats.begin(random)

        def play() -> Parts:
            nonlocal state, memories
            began = time.process_time()
            noise = game.draw(random)
            drawn = time.process_time()
            actions, memories = seats.act(state, memories, random)
            asked = time.process_time()
            state = game.step(state, actions, noise)[0]
            return drawn - began, asked - drawn, time.process_time() - asked

        return play

    return start


def plain(raters: int, providers: int, seed: int) -> Callable[[], Parts]:
    """Return a function that plays the next round of `mean` in a city, written by hand for this one case in NumPy.

    A fifth of the raters rates 0. Unlike in the game, a rater may meet a provider twice in a round.
    """
    rng = np.random.default_rng(seed)
    ability, top = rng.uniform(0.3, 1.0, providers), np.full(providers, 0.5)
    liars = np.arange(raters) < _SHARE * raters

    def play() -> Parts:
        nonlocal top
        began = time.process_time()
        whom = rng.integers(0, providers, (raters, MET))
        seen = np.clip(ability[whom] + 0.05 * rng.standard_normal((raters, MET)), 0, 1)
        rated = np.where(liars[:, None], 0.0, seen).ravel()
        whom = whom.ravel()
        counts = np.bincount(whom, minlength=providers)
        average = np.bincount(whom, rated, providers) / np.maximum(counts, 1)
        top = np.where(counts > 0, top + 0.5 * (average - top), top)
        return 0.0, 0.0, time.process_time() - began

    return play


def _harm_caption(found: Sequence[Harm], seeds: int, rounds: int) -> str:
    """Return what the table of harm shows, and how harm changes with the number of agents."""
    text = (
        "Skill is 1 for the best of the five providers in every round, and 0 for a blind choice. Shown is the skill "
        "that honest agents bring, and the skill that is lost to each attack in the same luck: means of "
        f"{seeds} seeds with 95% intervals, games of {rounds} rounds. With {LEAST} agents, all raters meet all "
        "providers, so that whoever rates all alike changes no order."
    )
    sizes = sorted({one.agents for one in found if city_sizes(one.agents)[1] > MET})
    if len(sizes) < 2:
        return text
    small, large = ([one.harm for one in found if one.agents == size and one.share] for size in (sizes[0], sizes[-1]))
    pairs = list(zip(small, large, strict=True))
    changes = [high.mean - low.mean for low, high in pairs]
    clear = sum(abs(high.mean - low.mean) > math.hypot(high.half, low.half) for low, high in pairs)
    return (
        f"{text} From {sizes[0]:,} to {sizes[-1]:,} agents the harm of a condition changes by {mean(changes):+.3f} "
        f"on average, from {min(changes):+.3f} to {max(changes):+.3f}; in {clear} of {len(pairs)} conditions the "
        "change is more than its 95% interval, and one in twenty is so by chance."
    )


def _harm_lines(found: Sequence[Harm]) -> list[list[str]]:
    """Return the headings, and a row for each model and condition with a cell for each number of agents."""
    sizes = sorted({one.agents for one in found})
    by_row: dict[tuple[str, str, float], dict[int, Harm]] = {}
    for one in found:
        by_row.setdefault((one.model, one.attack, one.share), {})[one.agents] = one
    lines = [["model", "attack", "share", *(f"{size:,} agents" for size in sizes)]]
    for (model, attack, share), cells in by_row.items():
        shown = [plus_minus(cells[size].harm if share else cells[size].skill) for size in sizes]
        lines.append([model, attack if share else "honest: skill", f"{share:.0%}" if share else "", *shown])
    return lines


def _cost_line(
    agents: int, services: int, name: str, ms: float, low: float, high: float, plain_ms: float, *parts: Any
) -> list[str]:
    """Return a line of the page from a row of `_cost_row`."""
    *times, memory = parts
    cells = [f"{ms:,.1f}", f"{low:,.1f} - {high:,.1f}", *("-" if x is None else f"{x:,.1f}" for x in times)]
    return [name, f"{agents:,}", f"{services:,}", *cells, f"{ms / plain_ms:.1f}", in_bytes(memory)]


def _cost_row(one: RoundCost) -> tuple[Any, ...]:
    """Return a row of the table of numbers, in milliseconds."""
    parts = (None,) * 3 if one.parts is None else (1e3 * s for s in one.parts)
    ms, plain_ms = Spread.of(1e3 * s for s in one.seconds), 1e3 * Spread.of(one.by_hand).median
    return (one.agents, one.services, one.name, *ms, plain_ms, *parts, one.memory)


if __name__ == "__main__":
    main()
