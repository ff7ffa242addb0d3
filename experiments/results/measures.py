"""What a game comes to in numbers: how each group of agents fared, and what an attack took from the honest."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from baselines.window import WindowedAttack
from experiments.results.confidence import Floats, over_games
from experiments.results.names import policy_name
from experiments.results.recording import Curves
from roletrust_env import Policy, metrics
from roletrust_env.metrics.score import mean_where
from roletrust_env.world.roster import Roster

MEASURES = ("mean trust", "lowest trust", "final trust", "mean reward")

_SETTLED = 10  # rounds after which the initial trust counts for 2 ** -10 at most


class Estimate(NamedTuple):
    """A mean over games, and half the width of its 95% confidence interval, NaN for one game."""

    mean: float
    half: float


class Group(NamedTuple):
    """Agents that have a role and a policy in common.

    Attributes:
        label: for people.
        honest: whether they play honestly.
        size: number of agents.
        present: how many of them are there at the end.
        measures: one for each of `MEASURES`.
    """

    label: str
    honest: bool
    size: int
    present: Estimate
    measures: dict[str, Estimate]


def measure(roster: Roster, curves: Curves, attackers: Mapping[str, Policy], since: int) -> list[Group]:
    """Every group of agents and how it fared.

    Args:
        roster: who is who.
        curves: of the games.
        attackers: who attacks, and how.
        since: the round from which the lowest trust is looked for.
    """
    places_of: dict[tuple[str, Any], list[int]] = {}
    for i, name in enumerate(roster.names):
        places_of.setdefault((_role(name), attackers.get(name)), []).append(i)
    groups: list[Group] = []
    for (role, policy), places in places_of.items():
        who = roster.names[places[0]] if len(places) == 1 else f"{len(places)} {role}"
        label = f"{who}, {policy_name(policy or Policy())}"
        if any(group.label == label for group in groups):  # the same attack with other parameters
            label = f"{label} ({roster.names[places[0]]} ...)"
        trust, rewards = curves.trust[:, places], curves.rewards[:, places]
        present = _estimate((~np.isnan(trust[-1])).sum(axis=0).astype(np.float64))
        groups.append(Group(label, policy is None, len(places), present, _measures(trust, rewards, since)))
    return groups


def measured_since(attackers: Mapping[str, Policy], rounds: int) -> int:
    """The round from which the lowest trust is looked for: the first attack's start, and not the first few rounds."""
    starts = [policy.start if isinstance(policy, WindowedAttack) else 0 for policy in attackers.values()]
    begun = [start for start in starts if start < rounds]
    return max(min(_SETTLED, rounds // 2), min(begun, default=0))


def damage(roster: Roster, curves: Curves, twin: Curves, attackers: Mapping[str, Policy]) -> dict[str, Estimate]:
    """What an attack took from the honest, see `roletrust_env.metrics.damage`.

    Args:
        roster: who is who.
        curves: under the attack.
        twin: with the same luck and everyone honest.
        attackers: who attacks.

    Returns:
        The damage to each role, and to all honest agents.
    """
    honest = [i for i, name in enumerate(roster.names) if name not in attackers]
    roles: dict[str, list[int]] = {}
    for i in honest:
        roles.setdefault(_role(roster.names[i]), []).append(i)
    who = {f"{len(places)} {role}": places for role, places in roles.items()} if len(roles) > 1 else {}
    who |= {f"all {len(honest)} honest": honest} if honest else {}
    return {label: _estimate(metrics.damage(curves.trust, twin.trust, places).value) for label, places in who.items()}


def _measures(trust: Floats, rewards: Floats, since: int) -> dict[str, Estimate]:
    """One number a game for each measure, and of these the mean; both arrays are (T, agents, games)."""
    each_round = mean_where(trust, axis=1)
    lowest = np.where(np.isnan(each_round), np.inf, each_round)[since:].min(axis=0)
    per_game = (
        mean_where(trust, axis=(0, 1)),
        np.where(np.isinf(lowest), np.nan, lowest),
        each_round[-1],
        mean_where(rewards, axis=(0, 1)),
    )
    return {name: _estimate(values) for name, values in zip(MEASURES, per_game, strict=True)}


def _estimate(per_game: Floats) -> Estimate:
    mean, half, _ = over_games(per_game)
    return Estimate(float(mean), float(half))


def _role(agent: str) -> str:
    return agent.partition("_")[0]
