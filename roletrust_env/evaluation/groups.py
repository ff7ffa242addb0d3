"""Results of games in numbers: measures of each group of agents, and effects of an attack on honest
agents.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from roletrust_env import metrics
from roletrust_env.evaluation.curves import Curves
from roletrust_env.game.policy import Policy, WindowedAttack, policy_name
from roletrust_env.metrics.confidence import Estimate, Floats, estimate
from roletrust_env.metrics.score import Score, mean_or_nan
from roletrust_env.world.group import Role
from roletrust_env.world.roster import PREFIXES, Roster

_OF_TRUST = ("mean trust", "lowest trust", "final trust")
MEASURES = (*_OF_TRUST, "mean reward")

AUC_MEANWHILE, AUC_FINALLY = "AUC under the attack", "AUC at the end"
UTILITY_WITHOUT, RECOVERY = "utility, no attack", "recovery, rounds"

_NEVER = "the attack never began"
_UNRATED = "the model has no trust in raters"
_SETTLED = 10  # rounds after which the weight of the initial trust is at most 2 ** -10


class Group(NamedTuple):
    """Agents with the same role and policy.

    Attributes:
        label: Label for people.
        honest: True if they play honestly.
        size: Number of agents.
        present: Number of agents that are present at the end.
        measures: Value of each of `MEASURES`.
    """

    label: str
    honest: bool
    size: int
    present: Estimate
    measures: dict[str, Estimate]


def measure(
    roster: Roster,
    curves: Curves,
    attackers: Mapping[str, Policy],
    since: int,
    rates_raters: bool = True,
) -> list[Group]:
    """Return the measures of every group of agents.

    Args:
        roster: Agents of the games.
        curves: Curves of the games.
        attackers: Policies of the attackers by agent.
        since: First round of the search for the lowest trust.
        rates_raters: True if the model has trust in raters; otherwise the trust of agents that only
            rate is undefined.
    """
    places_of: dict[tuple[str, Any], list[int]] = {}
    for i, name in enumerate(roster.names):
        places_of.setdefault((PREFIXES[roster.role(name)], attackers.get(name)), []).append(i)
    groups: list[Group] = []
    for (role, policy), places in places_of.items():
        who = roster.names[places[0]] if len(places) == 1 else f"{len(places)} {role}"
        label = f"{who}, {policy_name(policy or Policy())}"
        if any(group.label == label for group in groups):  # the same attack with other parameters
            label = f"{label} ({roster.names[places[0]]} ...)"
        trust, rewards = curves.trust[:, places], curves.rewards[:, places]
        present = estimate((~np.isnan(trust[-1])).sum(axis=0).astype(np.float64))
        measures = _measures(trust, rewards, since, curves.weights)
        if not _rated(roster.role(roster.names[places[0]]), rates_raters):
            measures |= dict.fromkeys(_OF_TRUST, Estimate(np.nan, np.nan, _UNRATED))
        groups.append(Group(label, policy is None, len(places), present, measures))
    return groups


def attack_windows(attackers: Mapping[str, Policy], rounds: int) -> list[tuple[int, int]]:
    """Return from and to which rounds agents attack, without overlaps. Without a window it is the
    whole game.
    """
    windows = [
        (p.start, p.stop) if isinstance(p, WindowedAttack) else (0, None)
        for p in attackers.values()
    ]
    merged: list[tuple[int, int]] = []
    for start, stop in sorted(
        (start, rounds if stop is None else min(stop, rounds)) for start, stop in windows
    ):
        overlap = bool(merged) and start <= merged[-1][1]
        first, last = merged.pop() if overlap else (start, stop)
        merged.append((first, max(last, stop)))
    return merged


def attack_rounds(attackers: Mapping[str, Policy], rounds: int) -> tuple[int, int]:
    """Return the first round of the first attack, and the first round after the last attack."""
    windows = attack_windows(attackers, rounds) or [(0, rounds)]
    return windows[0][0], max(stop for _, stop in windows)


def measured_since(attackers: Mapping[str, Policy], rounds: int) -> int:
    """Return the first round of the search for the lowest trust: the start of the attack, but not
    the first rounds.
    """
    start, _ = attack_rounds(attackers, rounds)
    return max(min(_SETTLED, rounds // 2), start if start < rounds else 0)


def damage(
    roster: Roster,
    curves: Curves,
    twin: Curves,
    attackers: Mapping[str, Policy],
    rates_raters: bool = True,
) -> dict[str, Estimate]:
    """Return the damage of an attack to honest agents, see `roletrust_env.metrics.damage`.

    Args:
        roster: Agents of the games.
        curves: Curves under the attack.
        twin: Curves with the same random numbers and all agents honest.
        attackers: Policies of the attackers by agent.
        rates_raters: True if the model has trust in raters; otherwise the damage to agents that
            only rate is undefined.

    Returns:
        The damage to each role, and to all honest agents.
    """
    honest = [i for i, name in enumerate(roster.names) if name not in attackers]
    roles = _by_role(roster, honest)
    who = (
        {f"{len(places)} {role}": places for role, places in roles.items()}
        if len(roles) > 1
        else {}
    )
    who |= {f"all {len(honest)} honest": honest} if honest else {}
    unrated = _undefined(curves.trust.shape[-1], _UNRATED)
    return {
        label: _scored(
            metrics.damage(curves.trust, twin.trust, places, curves.weights)
            if all(_rated(roster.role(roster.names[i]), rates_raters) for i in places)
            else unrated
        )
        for label, places in who.items()
    }


def under_attack(
    roster: Roster,
    curves: Curves,
    twin: Curves | None,
    attackers: Mapping[str, Policy],
    rates_raters: bool = True,
) -> dict[str, Estimate]:
    """Return detection, cost and recovery of an attack, see `roletrust_env.metrics`.

    Args:
        roster: Agents of the games.
        curves: Curves under the attack.
        twin: Curves with the same random numbers and all agents honest; None if there are no such
            games.
        attackers: Policies of the attackers by agent.
        rates_raters: True if the model has trust in raters; otherwise agents that only rate are
            left out.

    Returns:
        For each attacking role the AUC of mean trust under the attack and of trust at the end; the
        false alarms among honest agents; the utility of choosing by ToP, under the attack and
        without it; and the rounds of recovery.
    """
    rounds, games, weights = len(curves.trust), curves.trust.shape[-1], curves.weights
    start, stop = attack_rounds(attackers, rounds)
    judged = [i for i, name in enumerate(roster.names) if _rated(roster.role(name), rates_raters)]
    honest = [i for i in judged if roster.names[i] not in attackers]
    scores = {}
    for role, places in _by_role(roster, range(len(roster.names))).items():
        bad = [k for k, i in enumerate(places) if roster.names[i] in attackers]
        trust = curves.trust[:, places]
        if bad:
            unrated = None if places[0] in judged else _undefined(games, _UNRATED)
            meanwhile = metrics.auc(
                mean_or_nan(trust[start:stop], 0, None if weights is None else weights[start:stop]),
                bad,
            )
            meanwhile = meanwhile if start < rounds else _undefined(games, _NEVER)
            scores[f"{AUC_MEANWHILE}, {role}"] = unrated or meanwhile
            scores[f"{AUC_FINALLY}, {role}"] = unrated or metrics.auc(trust[-1], bad)
    scores["false alarms"] = metrics.false_alarms(curves.trust, honest, weights=weights)
    scores["utility"] = metrics.utility(curves.top, curves.offered, weights)
    if twin is None:
        why = "a live camera shows nothing twice, so there are no games without the attack"
        scores |= {UTILITY_WITHOUT: _undefined(games, why), RECOVERY: _undefined(games, why)}
    else:
        scores[UTILITY_WITHOUT] = metrics.utility(twin.top, twin.offered, weights)
        why = _NEVER if start >= rounds else "the attack lasts to the end"
        over = start < stop < rounds
        back = (
            metrics.recovery(curves.trust, twin.trust, honest, stop)
            if over
            else _undefined(games, why)
        )
        scores[RECOVERY] = back
    return {name: _scored(score) for name, score in scores.items()}


def _measures(
    trust: Floats, rewards: Floats, since: int, weights: Floats | None
) -> dict[str, Estimate]:
    """Return the mean over games of each measure; both arrays have the shape (T, agents, games)."""
    each_round = mean_or_nan(trust, axis=1)
    lowest = np.where(np.isnan(each_round), np.inf, each_round)[since:].min(axis=0)
    per_game = (
        mean_or_nan(trust, (0, 1), weights),
        np.where(np.isinf(lowest), np.nan, lowest),
        each_round[-1],
        mean_or_nan(rewards, (0, 1), weights),
    )
    return {name: estimate(values) for name, values in zip(MEASURES, per_game, strict=True)}


def _scored(score: Score) -> Estimate:
    """Return the mean of a score over games, with the reason and the number of games where it is
    undefined.
    """
    missing, games = int(np.isnan(score.value).sum()), score.value.size
    where = f", in {missing} of {games} games" if missing < games else ""
    return estimate(score.value)._replace(why=f"{score.why}{where}" if missing else "")


def _undefined(games: int, why: str) -> Score:
    return Score(np.full(games, np.nan), why)


def _by_role(roster: Roster, places: Iterable[int]) -> dict[str, list[int]]:
    """Return the indices of agents by role."""
    roles: dict[str, list[int]] = {}
    for i in places:
        roles.setdefault(PREFIXES[roster.role(roster.names[i])], []).append(i)
    return roles


def _rated(role: Role, rates_raters: bool) -> bool:
    """Return whether the model has trust in agents of a role."""
    return rates_raters or role != "SR"
