"""What attackers cost consumers in cities of 25 to 10,000 agents, in which a rater meets five providers in a round.

A consumer goes to the most trusted of the providers that it meets. Four in five agents are raters, so that every
provider has 20 ratings a round in every city. Only central models can be played. Some 10 minutes.
"""

import math
from collections.abc import Mapping, Sequence
from statistics import mean
from typing import Any, NamedTuple

import numpy as np

from roletrust_baselines import BadMouthing, Collusion, OnOff
from roletrust_env import JointPolicy, Policy, Scenario, SparseGame, make_scenario
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.game.rollout import rollout
from roletrust_env.metrics.confidence import Estimate, Floats, estimate
from roletrust_env.metrics.consumers import share_of_best, skill
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust.run import edge_model
from studies.study import Recipe, Study, plus_minus


class Options(NamedTuple):
    """Cities to play.

    Attributes:
        agents: Numbers of agents.
        model: Specs of central trust models.
        rounds: Rounds of a game.
        seeds: Seeds of each city, from the seed of the study on.
    """

    agents: tuple[int, ...] = (25, 100, 1000, 10_000)
    model: tuple[str, ...] = ("role-trust", "mean", "median")
    rounds: int = 30
    seeds: int = 20


MET = 5
"""Number of providers that a rater meets in a round of the preset `city`."""

_PERIOD = 10  # of the on-off providers, in rounds

ATTACKS = "bad-mouthing", "on-off", "collusion"
"""Attacks on a city."""

_HEADER = ("agents", "model", "attack", "share", "skill", "skill_half", "harm", "harm_half")

RECIPES = {"scale": Recipe(Options(), {name: name for name in ("scale.md", "scale-harm.csv")})}
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


def main(arguments: Sequence[str] | None = None) -> None:
    """Play all cities, and write the table."""
    with Study(__name__, RECIPES, arguments) as study:
        asked = study.options
        scenario = make_scenario("city")
        models = {name: edge_model(parse_trust_model(name, scenario)) for name in asked.model}
        seeds = range(study.seed, study.seed + asked.seeds)
        harms = measure_harm(sorted(asked.agents), models, SHARES, asked.rounds, seeds)
        study.csv("scale-harm.csv", _HEADER, [(*one[:4], *one.skill[:2], *one.harm[:2]) for one in harms])
        headings, *lines = _lines(harms)
        study.page(
            "scale.md",
            "# Cities",
            _caption(harms, asked.seeds, asked.rounds),
            markdown_table(headings, lines, 3),
            f"Made by `{study.command}`.",
        )


def city(agents: int, rounds: int) -> Scenario:
    """Return the preset `city` with another number of agents, four raters to each provider, and of rounds."""
    preset = make_scenario("city")
    groups = [
        {**group.model_dump(), "count": count} for group, count in zip(preset.agents, city_sizes(agents), strict=True)
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
    """Play cities of some sizes with and without attackers, with the same luck; several seeds give intervals."""
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


def _caption(found: Sequence[Harm], seeds: int, rounds: int) -> str:
    """Return what the table shows, and how harm changes with the number of agents."""
    text = (
        "Skill is 1 for the best of the five providers in every round, and 0 for a blind choice. Shown is the skill "
        "that honest agents bring, and the skill that is lost to each attack in the same luck: means of "
        f"{seeds} seeds with 95% intervals, games of {rounds} rounds. With {5 * MET} agents, all raters meet all "
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


def _lines(found: Sequence[Harm]) -> list[list[str]]:
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


if __name__ == "__main__":
    main()
