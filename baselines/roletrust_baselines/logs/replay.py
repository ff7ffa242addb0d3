"""A log of real ratings with a few hostile accounts at its end: how far do they move their targets?

The accounts follow a fixed plan, or search for the tactics that move their targets most.
"""

from collections.abc import Sequence
from copy import deepcopy
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from roletrust_baselines.logs.errors import TooSmallError
from roletrust_baselines.logs.resampling import interval, mean, ranks
from roletrust_env.data.log import RatingLog
from roletrust_env.data.log_rounds import log_rounds, play_round
from roletrust_env.data.rounds import spans
from roletrust_env.metrics.confidence import Interval
from roletrust_env.metrics.score import ratio
from roletrust_env.randomness import generator
from roletrust_env.trust.beta_distribution import reputation
from roletrust_env.trust.edges import pair_keys
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.outside import OutsideModel, round_tail
from roletrust_env.trust.ratings import merge_repeats
from roletrust_env.trust.run import TrustRun, make_run

TARGETS, ROUNDS = 20, 6
"""Number of targets, and of rounds that the attack lasts."""

ACTIVE = 5
"""An account with so many ratings is worth hijacking."""

_DRAWS = 5  # of hijacked accounts


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


class Shift(NamedTuple):
    """Mean percentile of the targets among all rated providers, 1 for the most trusted, without and with the attack.

    Attributes:
        before: Mean percentile in the log as it is, with an interval that resamples targets.
        after: Mean percentile with the attack.
    """

    before: Interval
    after: Interval


class HostileRatings(NamedTuple):
    """Ratings of hostile accounts in one round.

    Attributes:
        raters: Places of the accounts, shape (n,).
        providers: Places of the rated providers, shape (n,).
        values: Ratings on [0, 1], shape (n,).
    """

    raters: Ints
    providers: Ints
    values: Floats


def _joined(parts: Sequence[HostileRatings]) -> HostileRatings:
    """Return the ratings of several parts as those of one."""
    return HostileRatings(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


class Ending:
    """A log that was played up to its last rounds, and that can be ended with and without hostile ratings.

    In a log with fewer rounds, hostile ratings that come earlier are in its first one.

    Attributes:
        log: Log.
        same_agents: Whether a rater and a ratee of the same name are one agent.
        past: Number of ratings before the last rounds.
    """

    def __init__(self, model: Any, log: RatingLog, numbers: Ints, last: int, *, same_agents: bool, more: int) -> None:
        """Play the log, and remember the beginning of each of its last rounds.

        Args:
            model: Trust model.
            log: Log.
            numbers: Number of the round of each rating, shape (n,), ascending.
            last: Number of the last rounds.
            same_agents: Whether a rater and a ratee of the same name are one agent.
            more: Number of further raters, and of further providers, for which there is room.

        Raises:
            MemoryError: The model does not fit, see `make_run`.
        """
        parts = list(spans(numbers))
        self.log, self.same_agents, self.past = log, same_agents, parts[-last:][0][1].start
        self._model, self._room = model, (log.shape[0] + more, log.shape[1] + more)
        self._last, self._rest = last, parts[-last:]
        self._begun, self._lines = list[TrustRun](), list[str]()
        if isinstance(model, OutsideModel):  # a game with it cannot branch
            past = [(number, self._of_log(part)) for number, part in parts[:-last]]
            self._lines = self._messages(past, 0) or [round_tail(0, self._room, [])]
            return
        self._begun.append(make_run(model, self._room, one_role=not same_agents))
        for number, part in parts[:-last]:
            play_round(self._begun[0], number, *self._of_log(part))
        for number, part in self._rest[:-1]:
            self._begun.append(deepcopy(self._begun[-1]))
            play_round(self._begun[-1], number, *self._of_log(part))

    def _of_log(self, part: slice) -> HostileRatings:
        """Return some ratings of the log."""
        return HostileRatings(self.log.raters[part], self.log.ratees[part], self.log.values[part])

    def _messages(self, rounds: Sequence[tuple[int, HostileRatings]], since: int) -> list[str]:
        """Return the messages of rounds of a game with an outside model, and of those without ratings between them."""
        lines = list[str]()
        for number, sent in rounds:
            while since + len(lines) <= number:
                lines.append(round_tail(since + len(lines), self._room, []))
            raters, providers, values, _ = merge_repeats(*sent, pair_keys(sent.raters, sent.providers))
            listed = [list(one) for one in zip(raters.tolist(), providers.tolist(), values.tolist(), strict=True)]
            lines.append(round_tail(since + len(lines), self._room, listed))
        return lines

    def trust(self, rounds: Sequence[HostileRatings]) -> Floats:
        """Return the trust of all providers at the end of the log.

        Args:
            rounds: Ratings of the hostile accounts in each of the last rounds, beside those of the log. A rating of
                an account by itself does not count if raters and ratees are the same agents.
        """
        missing = self._last - len(self._rest)
        rounds = [_joined(rounds[: missing + 1]), *rounds[missing + 1 :]]
        first = next((at for at, extra in enumerate(rounds) if len(extra.raters)), len(rounds) - 1)
        ended = list[tuple[int, HostileRatings]]()
        for (number, part), extra in zip(self._rest, rounds, strict=True):
            others = (extra.raters != extra.providers) | (not self.same_agents)
            false = HostileRatings(*(column[others] for column in extra))
            ended.append((number, _joined([self._of_log(part), false])))
        if isinstance(self._model, OutsideModel):
            return self._model.replay(self._room, self._lines, self._messages(ended, len(self._lines)))
        run = deepcopy(self._begun[first])
        for number, sent in ended[first:]:
            play_round(run, number, *sent)
        return run.provider_trust

    @cached_property
    def past_means(self) -> Floats:
        """The mean rating of each provider before the attack, shape (P,); NaN without a rating."""
        ratees, values = self.log.ratees[: self.past], self.log.values[: self.past]
        count = np.bincount(ratees, minlength=self.log.shape[1])
        return ratio(np.bincount(ratees, values, self.log.shape[1]), count)

    @cached_property
    def ranked(self) -> Ints:
        """Raters with at least 5 ratings before the attack, those with the fewest ratings first."""
        given = np.bincount(self.log.raters[: self.past], minlength=self.log.shape[0])
        active = np.flatnonzero(given >= ACTIVE)
        return active[np.argsort(given[active], kind="stable")]


class Replay(Ending):
    """The end of a log, with the targets and the accounts of attacks.

    Attributes:
        best: The 20 providers with the highest Beta reputation from the ratings before the attack.
        newcomers: 20 providers that nobody has rated.
        active: Raters with at least 5 ratings before the attack.
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
            MemoryError: The model does not fit, see `make_run`.
        """
        numbers = log_rounds(log, every)
        if (many := len(np.unique(numbers))) <= ROUNDS:
            raise TooSmallError(f"the log has {many} rounds with ratings; an attack needs more than {ROUNDS}")
        super().__init__(model, log, numbers, ROUNDS, same_agents=same_agents, more=TARGETS + most)
        self.best, self.active = _best(log, self.past), np.sort(self.ranked)
        if len(self.best) < TARGETS or len(self.active) < most:
            raise TooSmallError(
                f"an attack needs {TARGETS} providers and {most} raters with {ACTIVE} ratings in the log"
            )
        self.newcomers, self.fresh = log.shape[1] + np.arange(TARGETS), log.shape[0] + TARGETS + np.arange(most)
        self._rated = np.union1d(np.unique(log.ratees), self.newcomers)

    def percentiles(self, targets: Ints, rounds: Sequence[HostileRatings]) -> Floats:
        """Return the percentiles of targets among all rated providers and newcomers at the end of the log.

        Args:
            targets: Places of the targets.
            rounds: Ratings of the hostile accounts in each of the last rounds, see `Ending.trust`.
        """
        return ranks(self.trust(rounds)[self._rated])[np.searchsorted(self._rated, targets)]

    @cached_property
    def honest(self) -> dict[str, Floats]:
        """The percentiles of the targets of each goal without an attack."""
        nobody = np.zeros(0, np.int64)
        quiet = [equal_ratings(nobody, nobody, 0.0)] * ROUNDS
        return {goal: self.percentiles(self.aim(goal)[0], quiet) for goal in ("sink", "lift")}

    def aim(self, goal: str) -> tuple[Ints, float]:
        """Return the targets of a goal, and the rating that they get."""
        return (self.best, 0.0) if goal == "sink" else (self.newcomers, 1.0)


def equal_ratings(accounts: Ints, targets: Ints, rating: float) -> HostileRatings:
    """Return the ratings of a round in which every account gives every target the same rating."""
    who, whom = (grid.reshape(-1) for grid in np.meshgrid(accounts, targets))
    return HostileRatings(who, whom, np.full(len(who), rating))


def draw_teams(replay: Replay, attack: Attack, rng: np.random.Generator) -> list[Ints]:
    """Return the hostile accounts of an attack: the new ones, or five draws of active raters."""
    if attack.origin == "new":
        return [replay.fresh[: attack.accounts]]
    return [rng.choice(replay.active, attack.accounts, replace=False) for _ in range(_DRAWS)]


def shift_of(before: Floats, after: Floats, seed: int) -> Shift:
    """Return the mean percentiles of targets without and with an attack, with their intervals."""
    return Shift(*(interval(mean(x), np.arange(len(x)), seed) for x in (before, after)))


def replay_attacks(replay: Replay, attacks: Sequence[Attack] = ATTACKS, seed: int = 0) -> dict[Attack, Shift]:
    """End a log with each attack, and without any.

    In each of the last 6 rounds every hostile account rates all 20 targets, beside the ratings of the log. The best
    providers are those with the highest Beta reputation from the ratings before the attack. Newcomers are providers
    that nobody has rated. Hijacked accounts are drawn five times from raters with at least 5 ratings.

    Args:
        replay: Log that was played up to the attack.
        attacks: Attacks to play.
        seed: Random seed of the draws and of the resamples.
    """
    found, rng = {}, generator(seed)
    for attack in attacks:
        targets, rating = replay.aim(attack.goal)
        teams = draw_teams(replay, attack, rng)
        after = [replay.percentiles(targets, [equal_ratings(team, targets, rating)] * ROUNDS) for team in teams]
        found[attack] = shift_of(replay.honest[attack.goal], np.mean(after, axis=0), seed)
    return found


def _best(log: RatingLog, past: int) -> Ints:
    """Return the providers with the highest Beta reputation from so many ratings, the best first."""
    successes, count = (np.bincount(log.ratees[:past], w, log.shape[1]) for w in (log.values[:past], np.ones(past)))
    order = np.argsort(-reputation(successes, count - successes), kind="stable")
    chosen: Ints = order[count[order] > 0][:TARGETS]
    return chosen


# --- attackers that search for the tactics that move their targets most -----------------------------


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


class StrongestAttack(NamedTuple):
    """The attack that moves its targets most, of those that a search has played.

    Attributes:
        shift: Percentiles of the targets without and with it.
        tactic: Choices of the accounts.
    """

    shift: Shift
    tactic: Tactic


def search_attack(replay: Replay, attack: Attack, budget: int, seed: int = 0) -> StrongestAttack:
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
    rng, (targets, extreme) = generator(seed), replay.aim(attack.goal)
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
    return StrongestAttack(shift_of(replay.honest[attack.goal], after, seed), best)


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
    rng, nobody = generator(seed), np.zeros(0, np.int64)
    rounds = []
    for number in range(ROUNDS):
        on = number >= tactic.first and (number - tactic.first) % tactic.period == 0
        rounds.append(hostile_ratings(replay, targets, tactic, rng) if on else equal_ratings(nobody, nobody, 0.0))
    return replay.percentiles(targets, rounds)


def hostile_ratings(replay: Replay, targets: Ints, tactic: Tactic, rng: np.random.Generator) -> HostileRatings:
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
        parts.append(equal_ratings(one, rng.choice(targets, tactic.targets, replace=False), tactic.rating))
        others = rng.choice(known, min(tactic.cover, len(known)), replace=False)
        parts.append(HostileRatings(np.full(len(others), account), others, replay.past_means[others]))
    if tactic.ring and replay.same_agents:
        parts.append(equal_ratings(tactic.accounts, tactic.accounts, 1.0))
    return _joined(parts)
