"""A log of real ratings with a few hostile accounts at its end: how far do they move their targets?"""

from collections.abc import Sequence
from copy import deepcopy
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from roletrust_env.data.log import RatingLog
from roletrust_env.data.resampling import interval, mean, ranks
from roletrust_env.data.rounds import TooSmallError, log_rounds, play_round, spans
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
"""Attacks that are played by default."""

_MOST = max(attack.accounts for attack in ATTACKS)


class Moved(NamedTuple):
    """Mean percentile of the targets among all rated providers, 1 for the most trusted, without and with the attack.

    Attributes:
        before: Mean percentile in the log as it is, with an interval that resamples targets.
        after: Mean percentile with the attack.
    """

    before: Interval
    after: Interval


class Ratings(NamedTuple):
    """Ratings of hostile accounts in one round.

    Attributes:
        raters: Places of the accounts, shape (n,).
        providers: Places of the rated providers, shape (n,).
        values: Ratings on [0, 1], shape (n,).
    """

    raters: Ints
    providers: Ints
    values: Floats


class Replay:
    """A log that was played up to its last 6 rounds, and that can be ended with and without an attack.

    Attributes:
        log: Log.
        same_agents: Whether a rater and a ratee of the same name are one agent.
        past: Number of ratings before the attack.
        best: The 20 providers with the highest Beta reputation from the ratings before the attack.
        newcomers: 20 providers that nobody has rated.
        active: Raters with at least 5 ratings before the attack.
        ranked: The same, those with the fewest ratings first.
        fresh: New accounts.
    """

    def __init__(self, model: Any, log: RatingLog, every: float, *, same_agents: bool, most: int = _MOST) -> None:
        """Play the log up to the attack.

        Args:
            model: Trust model.
            log: Log.
            every: Length of a round.
            same_agents: Whether a rater and a ratee of the same name are one agent.
            most: Greatest number of hostile accounts.

        Raises:
            TooSmallError: The log has no 7 rounds with ratings, or too few providers or raters.
            MemoryError: The model does not fit, see `make_ledger`.
        """
        parts = list(spans(log_rounds(log, every)))
        if len(parts) <= ROUNDS:
            raise TooSmallError(f"the log has {len(parts)} rounds with ratings; an attack needs more than {ROUNDS}")
        self.log, self.same_agents, self.past = log, same_agents, parts[-ROUNDS][1].start
        given = np.bincount(log.raters[: self.past], minlength=log.shape[0])
        self.best, self.active = _best(log, self.past), np.flatnonzero(given >= _ACTIVE)
        self.ranked = self.active[np.argsort(given[self.active], kind="stable")]
        if len(self.best) < TARGETS or len(self.active) < most:
            raise TooSmallError(
                f"an attack needs {TARGETS} providers and {most} raters with {_ACTIVE} ratings in the log"
            )
        self.newcomers, self.fresh = log.shape[1] + np.arange(TARGETS), log.shape[0] + TARGETS + np.arange(most)
        room = log.shape[0] + TARGETS + most, log.shape[1] + TARGETS + most
        self._ledger = make_ledger(model, room, one_role=not same_agents)
        for number, some in parts[:-ROUNDS]:
            play_round(self._ledger, number, log.raters[some], log.ratees[some], log.values[some])
        self._rest, self._rated = parts[-ROUNDS:], np.union1d(np.unique(log.ratees), self.newcomers)

    def percentiles(self, targets: Ints, rounds: Sequence[Ratings]) -> Floats:
        """Return the percentiles of targets among all rated providers and newcomers at the end of the log.

        Args:
            targets: Places of the targets.
            rounds: Ratings of the hostile accounts in each of the last rounds, beside those of the log. A rating of
                an account by itself does not count if raters and ratees are the same agents.
        """
        ledger, log = deepcopy(self._ledger), self.log
        for (number, some), extra in zip(self._rest, rounds, strict=True):
            others = (extra.raters != extra.providers) | (not self.same_agents)
            parts = zip((log.raters[some], log.ratees[some], log.values[some]), extra, strict=True)
            play_round(ledger, number, *(np.concatenate([real, false[others]]) for real, false in parts))
        return ranks(ledger.provider_trust[self._rated])[np.searchsorted(self._rated, targets)]

    @cached_property
    def honest(self) -> dict[str, Floats]:
        """The percentiles of the targets of each goal without an attack."""
        nobody = np.zeros(0, np.int64)
        quiet = [everybody(nobody, nobody, 0.0)] * ROUNDS
        return {goal: self.percentiles(self.aim(goal)[0], quiet) for goal in ("sink", "lift")}

    @cached_property
    def past_means(self) -> Floats:
        """The mean rating of each provider before the attack, shape (P,); NaN without a rating."""
        ratees, values = self.log.ratees[: self.past], self.log.values[: self.past]
        count = np.bincount(ratees, minlength=self.log.shape[1])
        means: Floats = np.full(self.log.shape[1], np.nan)
        np.divide(np.bincount(ratees, values, self.log.shape[1]), count, out=means, where=count > 0)
        return means

    def aim(self, goal: str) -> tuple[Ints, float]:
        """Return the targets of a goal, and the rating that they get."""
        return (self.best, 0.0) if goal == "sink" else (self.newcomers, 1.0)


def everybody(accounts: Ints, targets: Ints, rating: float) -> Ratings:
    """Return the ratings of a round in which every account gives every target the same rating."""
    who, whom = (grid.reshape(-1) for grid in np.meshgrid(accounts, targets))
    return Ratings(who, whom, np.full(len(who), rating))


def draw_teams(replay: Replay, attack: Attack, rng: np.random.Generator) -> list[Ints]:
    """Return the hostile accounts of an attack: the new ones, or five draws of active raters."""
    if attack.origin == "new":
        return [replay.fresh[: attack.accounts]]
    return [rng.choice(replay.active, attack.accounts, replace=False) for _ in range(_DRAWS)]


def moved(before: Floats, after: Floats, seed: int) -> Moved:
    """Return the mean percentiles of targets without and with an attack, with their intervals."""
    return Moved(*(interval(mean(x), np.arange(len(x)), seed) for x in (before, after)))


def replay_attacks(replay: Replay, attacks: Sequence[Attack] = ATTACKS, seed: int = 0) -> dict[Attack, Moved]:
    """End a log with each attack, and without any.

    In each of the last 6 rounds every hostile account rates all 20 targets, beside the ratings of the log. The best
    providers are those with the highest Beta reputation from the ratings before the attack. Newcomers are providers
    that nobody has rated. Hijacked accounts are drawn five times from raters with at least 5 ratings.

    Args:
        replay: Log that was played up to the attack.
        attacks: Attacks to play.
        seed: Random seed of the draws and of the resamples.
    """
    found, rng = {}, np.random.default_rng(seed)
    for attack in attacks:
        targets, rating = replay.aim(attack.goal)
        teams = draw_teams(replay, attack, rng)
        after = [replay.percentiles(targets, [everybody(team, targets, rating)] * ROUNDS) for team in teams]
        found[attack] = moved(replay.honest[attack.goal], np.mean(after, axis=0), seed)
    return found


def _best(log: RatingLog, past: int) -> Ints:
    """Return the providers with the highest Beta reputation from so many ratings, the best first."""
    successes, count = (np.bincount(log.ratees[:past], w, log.shape[1]) for w in (log.values[:past], np.ones(past)))
    order = np.argsort(-reputation(successes, count - successes), kind="stable")
    chosen: Ints = order[count[order] > 0][:TARGETS]
    return chosen
