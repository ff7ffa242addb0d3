"""A log of real ratings with a few hostile accounts at its end: how far do they move their targets?"""

from copy import deepcopy
from typing import Any, Literal, NamedTuple

import numpy as np

from roletrust_env.data.log import RatingLog
from roletrust_env.data.resampling import interval, mean, ranks
from roletrust_env.data.rounds import log_rounds, play_round, spans
from roletrust_env.metrics.confidence import Interval
from roletrust_env.trust.beta import reputation
from roletrust_env.trust.grid_ledger import make_ledger
from roletrust_env.trust.key_index import Ints
from roletrust_env.trust.ledger import Floats

TARGETS, ROUNDS = 20, 6
"""Number of targets, and of rounds that the attack lasts."""

_DRAWS = 5  # of hijacked accounts
_ACTIVE = 5  # an account with so many ratings is worth hijacking


class Attack(NamedTuple):
    """An attack on a log.

    Attributes:
        goal: `sink` gives the best providers the worst rating, `lift` gives newcomers the best one.
        accounts: Number of hostile accounts.
        origin: Whether the accounts are `hijacked` from active raters, or are `new`.
    """

    goal: Literal["sink", "lift"]
    accounts: int
    origin: Literal["hijacked", "new"]


ATTACKS = [
    Attack(goal, accounts, origin)
    for goal in ("sink", "lift")
    for accounts in (3, 10)
    for origin in ("hijacked", "new")
]


class Moved(NamedTuple):
    """Mean percentile of the targets among all rated providers, 1 for the most trusted, without and with the attack.

    Attributes:
        before: Mean percentile in the log as it is, with an interval that resamples targets.
        after: Mean percentile with the attack.
    """

    before: Interval
    after: Interval


def replay_attacks(
    model: Any, log: RatingLog, every: float, *, same_agents: bool, attacks: list[Attack] = ATTACKS, seed: int = 0
) -> dict[Attack, Moved]:
    """Play a log with each attack in its last rounds, and without any.

    In each of the last 6 rounds every hostile account rates all 20 targets, beside the ratings of the log. The best
    providers are those with the highest Beta reputation from the ratings before the attack. Newcomers are providers
    that nobody has rated. Hijacked accounts are drawn five times from raters with at least 5 ratings.

    Args:
        model: Trust model.
        log: Log.
        every: Length of a round.
        same_agents: Whether a rater and a ratee of the same name are one agent.
        attacks: Attacks to play.
        seed: Random seed of the draws and of the resamples.

    Raises:
        ValueError: The log has no 7 rounds with ratings, or too few providers or raters.
        MemoryError: The model does not fit, see `make_ledger`.
    """
    numbers = log_rounds(log, every)
    parts = list(spans(numbers))
    if len(parts) <= ROUNDS:
        raise ValueError(f"the log has {len(parts)} rounds with ratings; an attack needs more than {ROUNDS}")
    past = parts[-ROUNDS][1].start
    best, active = _best(log, past), np.flatnonzero(np.bincount(log.raters[:past], minlength=log.shape[0]) >= _ACTIVE)
    most = max(attack.accounts for attack in attacks)
    if len(best) < TARGETS or len(active) < most:
        raise ValueError(f"an attack needs {TARGETS} providers and {most} raters with {_ACTIVE} ratings in the log")
    room = log.shape[0] + TARGETS + most, log.shape[1] + TARGETS + most
    newcomers, fresh = log.shape[1] + np.arange(TARGETS), log.shape[0] + TARGETS + np.arange(most)
    ledger = make_ledger(model, room, one_role=not same_agents)
    for number, some in parts[:-ROUNDS]:
        play_round(ledger, number, log.raters[some], log.ratees[some], log.values[some])
    rated = np.union1d(np.unique(log.ratees), newcomers)

    def percentiles(hostile: Ints, targets: Ints, rating: float) -> Floats:
        copy = deepcopy(ledger)
        who, whom = (grid.reshape(-1) for grid in np.meshgrid(hostile, targets))
        apart = (who != whom) | (not same_agents)
        for number, some in parts[-ROUNDS:]:
            raters = np.concatenate([log.raters[some], who[apart]])
            providers = np.concatenate([log.ratees[some], whom[apart]])
            values = np.concatenate([log.values[some], np.full(int(apart.sum()), rating)])
            play_round(copy, number, raters, providers, values)
        return ranks(copy.provider_trust[rated])[np.searchsorted(rated, targets)]

    found, rng = {}, np.random.default_rng(seed)
    nobody = np.zeros(0, np.int64)
    aims = {"sink": (best, 0.0), "lift": (newcomers, 1.0)}
    honest = {goal: percentiles(nobody, *aim) for goal, aim in aims.items()}
    for attack in attacks:
        teams = [fresh[: attack.accounts]]
        if attack.origin == "hijacked":
            teams = [rng.choice(active, attack.accounts, replace=False) for _ in range(_DRAWS)]
        moved = np.mean([percentiles(team, *aims[attack.goal]) for team in teams], axis=0)
        found[attack] = Moved(*(interval(mean(x), np.arange(TARGETS), seed) for x in (honest[attack.goal], moved)))
    return found


def _best(log: RatingLog, past: int) -> Ints:
    """Return the providers with the highest Beta reputation from so many ratings, the best first."""
    successes, count = (np.bincount(log.ratees[:past], w, log.shape[1]) for w in (log.values[:past], np.ones(past)))
    order = np.argsort(-reputation(successes, count - successes), kind="stable")
    chosen: Ints = order[count[order] > 0][:TARGETS]
    return chosen
