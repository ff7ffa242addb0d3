"""Attackers that search for the tactics that move their targets most in a replay of a log."""

from typing import NamedTuple

import numpy as np

from roletrust_env.data.replay import ROUNDS, TARGETS, Attack, Moved, Ratings, Replay, draw_teams, everybody, moved
from roletrust_env.trust.key_index import Ints
from roletrust_env.trust.ledger import Floats

_COVER = 20  # most honest ratings of an account in a round
_PERIODS = 3
_STEP = 0.2  # standard deviation of a step, where each number of a tactic is in [0, 1]


class Tactic(NamedTuple):
    """Choices of the hostile accounts.

    Attributes:
        accounts: Places of the accounts.
        first: Number of the first of the last 6 rounds in which they rate, from 0.
        period: Number of rounds from one in which they rate to the next.
        rating: Rating of the targets, on the side of the middle of the scale that serves the goal.
        targets: Number of targets that each account draws and rates in a round, from 1 to 20.
        cover: Number of other providers that each account draws and rates in a round as the log rates them on average.
        ring: Whether the accounts give one another the best rating.
    """

    accounts: Ints
    first: int
    period: int
    rating: float
    targets: int
    cover: int
    ring: bool


class Found(NamedTuple):
    """The attack that moves its targets most, of those that a search has played.

    Attributes:
        moved: Percentiles of the targets without and with it.
        tactic: Choices of the accounts.
    """

    moved: Moved
    tactic: Tactic


def search_attack(replay: Replay, attack: Attack, budget: int, seed: int = 0) -> Found:
    """Search for the tactic that moves the targets of an attack most.

    The search sees the outcome of each attack, as an attacker would who knows the log and the model. It first plays
    the attack without a tactic, in which every account gives every target the extreme rating in every round: for
    hijacked accounts once for each of the five draws. Half of what is left are random tactics; the other half are
    random steps from the best so far. Hijacked accounts are next to each other in the order of activity. The result is
    a bound from below on what an attacker can do, and no smaller than that of the attack without tactic.

    Args:
        replay: Log that was played up to the attack.
        attack: Goal, number and origin of the accounts.
        budget: Number of attacks to play, at least 1.
        seed: Random seed.

    Raises:
        ValueError: The budget is below 1.
    """
    if budget < 1:
        raise ValueError(f"the budget is {budget}; it must be at least 1")
    rng, (targets, extreme) = np.random.default_rng(seed), replay.aim(attack.goal)
    sign = 1 if attack.goal == "lift" else -1
    plain = [Tactic(team, 0, 1, extreme, TARGETS, 0, False) for team in draw_teams(replay, attack, rng)][:budget]
    at, best, after = np.zeros(7), plain[0], _played(replay, targets, plain[0], seed)
    for n in range(1, budget):
        if n < len(plain):
            point, tactic = at, plain[n]
        else:
            late = n - len(plain) >= (budget - len(plain)) / 2
            point = np.clip(at + rng.normal(0, _STEP, 7), 0, 1) if late else rng.random(7)
            tactic = _tactic(replay, attack, extreme, point)
        found = _played(replay, targets, tactic, seed)
        if sign * (found.mean() - after.mean()) > 0:
            at, best, after = point, tactic, found
    return Found(moved(replay.honest[attack.goal], after, seed), best)


def _tactic(replay: Replay, attack: Attack, extreme: float, point: Floats) -> Tactic:
    """Return the tactic of a point in the unit cube."""
    where, first, period, towards, fewer, cover, ring = point.tolist()
    accounts = replay.fresh[: attack.accounts]
    if attack.origin == "hijacked":
        start = int(where * (len(replay.ranked) - attack.accounts) + 0.5)
        accounts = replay.ranked[start : start + attack.accounts]
    return Tactic(
        accounts=accounts,
        first=min(int(first * ROUNDS), ROUNDS - 1),
        period=1 + min(int(period * _PERIODS), _PERIODS - 1),
        rating=extreme + (0.5 - extreme) * towards,
        targets=TARGETS - min(int(fewer * TARGETS), TARGETS - 1),
        cover=int(cover * _COVER + 0.5),
        ring=ring > 0.5,
    )


def _played(replay: Replay, targets: Ints, tactic: Tactic, seed: int) -> Floats:
    """Return the percentiles of the targets after an attack. Draws of targets and of cover are those of the seed."""
    rng, nobody = np.random.default_rng(seed), np.zeros(0, np.int64)
    rounds = []
    for number in range(ROUNDS):
        on = number >= tactic.first and (number - tactic.first) % tactic.period == 0
        rounds.append(hostile_ratings(replay, targets, tactic, rng) if on else everybody(nobody, nobody, 0.0))
    return replay.percentiles(targets, rounds)


def hostile_ratings(replay: Replay, targets: Ints, tactic: Tactic, rng: np.random.Generator) -> Ratings:
    """Return the ratings of a tactic in one round in which its accounts rate.

    Args:
        replay: Log that was played up to the attack.
        targets: Places of the targets.
        tactic: Choices of the accounts.
        rng: Random generator of the draws of targets and of cover.
    """
    known, parts = np.setdiff1d(np.flatnonzero(~np.isnan(replay.past_means)), targets), []
    for account in tactic.accounts:
        one = np.array([account])
        parts.append(everybody(one, rng.choice(targets, tactic.targets, replace=False), tactic.rating))
        others = rng.choice(known, min(tactic.cover, len(known)), replace=False)
        parts.append(Ratings(np.full(len(others), account), others, replay.past_means[others]))
    if tactic.ring and replay.same_agents:
        parts.append(everybody(tactic.accounts, tactic.accounts, 1.0))
    return Ratings(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
