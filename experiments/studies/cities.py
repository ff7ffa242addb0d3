"""Cities of any number of agents under attack: what shares of liars cost consumers, by the number of agents."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_baselines import BadMouthing, Collusion, OnOff
from roletrust_env import JointPolicy, Policy, Scenario, SparseGame, make_scenario
from roletrust_env.game.rollout import rollout
from roletrust_env.metrics.confidence import Estimate, estimate
from roletrust_env.metrics.consumers import share_of_best, skill

Floats = npt.NDArray[np.float64]

MET = 5
"""Number of providers that a rater meets in a round of the preset `city`."""

LEAST = 5 * MET
"""Least number of agents of a city: a rater meets all of its providers."""

MOST = 10_000_000
"""Maximum number of agents of a city; role-trust then takes some 10 GB."""

_GROUP = 100_000  # agents of a group, at most
_PERIOD = 10  # of the on-off providers, in rounds

ATTACKS = "bad-mouthing", "on-off", "collusion"
"""Attacks on a city."""


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


def city(agents: int, rounds: int) -> Scenario:
    """Return the preset `city` with another number of agents, four raters to each provider, and of rounds.

    Raises:
        ValueError: There are too few agents, or too many.
    """
    if agents < LEAST:
        raise ValueError(f"a city of {agents} agents is too small; it needs {LEAST} or more")
    if agents > MOST:
        raise ValueError(f"a city of {agents:,} agents is too large; at most {MOST:,} are allowed")
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
    sizes: Sequence[int],
    models: Mapping[str, Any],
    shares: Sequence[float],
    *,
    rounds: int,
    seeds: Sequence[int],
    advance: Callable[[str], None] = lambda what: None,
) -> list[Harm]:
    """Play cities with and without attackers, with the same luck.

    Args:
        sizes: Numbers of agents.
        models: Central trust models by name.
        shares: Shares of attackers.
        rounds: Number of rounds.
        seeds: Seeds, two or more for an interval.
        advance: Called with what is played next, once for each model, size and condition.
    """
    found = []
    for agents in sizes:
        scenario = city(agents, rounds)
        for name, model in models.items():
            game = SparseGame(scenario, model)
            played: dict[tuple[str, float], Floats] = {}
            for attack, share in [("honest", 0.0), *((attack, share) for attack in ATTACKS for share in shares)]:
                advance(f"{agents:,} agents, {name}, {attack}")
                policies = attackers(game, attack, share) if share else {}
                seats = JointPolicy(game, policies)
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
