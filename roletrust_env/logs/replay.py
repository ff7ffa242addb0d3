"""A log of real ratings with a few hostile accounts at its end: how far do they move their
targets?
"""

from collections.abc import Sequence
from copy import deepcopy
from typing import Any, Literal, NamedTuple

import numpy as np

from roletrust_env.logs.log import Log, TooSmallError
from roletrust_env.logs.log_rounds import log_rounds, play_round
from roletrust_env.logs.rounds import spans
from roletrust_env.metrics.confidence import Interval
from roletrust_env.metrics.resampling import interval, mean, ranks
from roletrust_env.randomness import generator
from roletrust_env.trust.beta_distribution import reputation
from roletrust_env.trust.edges import pair_keys
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.ratings import merge_repeats
from roletrust_env.trust.remote import Rating, RemoteModel
from roletrust_env.trust.run import make_run
from roletrust_env.trust.trust_run import TrustRun

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
    """Mean percentile of the targets among all rated providers, 1 for the most trusted, without and
    with the attack.

    Attributes:
        before: Mean percentile in the log as it is, with an interval that resamples targets.
        after: Mean percentile with the attack.
        targets: Percentile of each target with the attack, shape (targets,).
    """

    before: Interval
    after: Interval
    targets: Floats


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
    """A log that was played up to its last rounds, and that can be ended with and without hostile
    ratings.

    In a log with fewer rounds, hostile ratings that come earlier are in its first one.

    Attributes:
        log: Log.
        same_agents: Whether a rater and a ratee of the same name are one agent.
        past: Number of ratings before the last rounds.
    """

    def __init__(
        self, model: Any, log: Log, numbers: Ints, last: int, *, same_agents: bool, more: int
    ) -> None:
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
        self._begun = list[TrustRun]()
        if isinstance(model, RemoteModel):  # a game with it cannot branch
            past = [(number, self._of_log(part)) for number, part in parts[:-last]]
            self._played = self._listed(past, 0) or [[]]
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

    def _listed(
        self, rounds: Sequence[tuple[int, HostileRatings]], since: int
    ) -> list[list[Rating]]:
        """Return the ratings in all rounds of a game with a remote model since a round, where the
        game begins in round 0.
        """
        listed = list[list[Rating]]()
        for number, sent in rounds:
            listed += [[] for _ in range(since + len(listed), number + 1)]
            raters, providers, values, _ = merge_repeats(
                *sent, pair_keys(sent.raters, sent.providers)
            )
            columns = (column.tolist() for column in (raters, providers, values))
            listed.append(list(zip(*columns, strict=True)))
        return listed

    def trust(self, rounds: Sequence[HostileRatings]) -> Floats:
        """Return the trust of all providers at the end of the log.

        Args:
            rounds: Ratings of the hostile accounts in each of the last rounds, beside those of the
                log. A rating of an account by itself does not count if raters and ratees are the
                same agents.
        """
        missing = self._last - len(self._rest)
        rounds = [_joined(rounds[: missing + 1]), *rounds[missing + 1 :]]
        first = next((at for at, extra in enumerate(rounds) if len(extra.raters)), len(rounds) - 1)
        ended = list[tuple[int, HostileRatings]]()
        for (number, part), extra in zip(self._rest, rounds, strict=True):
            others = (extra.raters != extra.providers) | (not self.same_agents)
            false = HostileRatings(*(column[others] for column in extra))
            ended.append((number, _joined([self._of_log(part), false])))
        if isinstance(self._model, RemoteModel):
            end = self._listed(ended, len(self._played))
            return self._model.replay(self._room, self._played, end)
        run = deepcopy(self._begun[first])
        for number, sent in ended[first:]:
            play_round(run, number, *sent)
        return run.provider_trust


class Replay(Ending):
    """The end of a log, with the targets and the accounts of attacks.

    Attributes:
        best: The 20 providers with the highest Beta reputation from the ratings before the attack.
        newcomers: 20 providers that nobody has rated.
        active: Raters with at least 5 ratings before the attack.
        fresh: New accounts.
    """

    def __init__(self, model: Any, log: Log, every: float, *, same_agents: bool) -> None:
        """Play the log up to the attack.

        Args:
            model: Trust model.
            log: Log.
            every: Length of a round.
            same_agents: Whether a rater and a ratee of the same name are one agent.

        Raises:
            TooSmallError: The log has no 7 rounds with ratings, or too few providers or raters.
            MemoryError: The model does not fit, see `make_run`.
        """
        numbers = log_rounds(log, every)
        if (many := len(np.unique(numbers))) <= ROUNDS:
            raise TooSmallError(
                f"the log has {many} rounds with ratings; an attack needs more than {ROUNDS}"
            )
        super().__init__(model, log, numbers, ROUNDS, same_agents=same_agents, more=TARGETS + _MOST)
        self.best = _best(log, self.past)
        self.active = np.flatnonzero(np.bincount(log.raters[: self.past]) >= ACTIVE)
        if len(self.best) < TARGETS or len(self.active) < _MOST:
            raise TooSmallError(
                f"an attack needs {TARGETS} providers and {_MOST} raters with {ACTIVE} ratings in "
                "the log"
            )
        self.newcomers, self.fresh = (
            log.shape[1] + np.arange(TARGETS),
            log.shape[0] + TARGETS + np.arange(_MOST),
        )
        self._rated = np.union1d(np.unique(log.ratees), self.newcomers)

    def percentiles(self, targets: Ints, accounts: Ints, rating: float) -> Floats:
        """Return the percentiles of targets among all rated providers and newcomers at the end of
        the log.

        Args:
            targets: Places of the targets.
            accounts: Places of the hostile accounts.
            rating: Rating that each account gives each target in each of the last rounds.
        """
        who, whom = (grid.reshape(-1) for grid in np.meshgrid(accounts, targets))
        sent = HostileRatings(who, whom, np.full(len(who), rating))
        return ranks(self.trust([sent] * ROUNDS)[self._rated])[
            np.searchsorted(self._rated, targets)
        ]


def replay_attacks(
    replay: Replay, attacks: Sequence[Attack] = ATTACKS, seed: int = 0
) -> dict[Attack, Shift]:
    """End a log with each attack, and without any.

    In each of the last 6 rounds every hostile account rates all 20 targets, beside the ratings of
    the log. The best providers are those with the highest Beta reputation from the ratings before
    the attack. Newcomers are providers that nobody has rated. Hijacked accounts are drawn five
    times from raters with at least 5 ratings.

    Args:
        replay: Log that was played up to the attack.
        attacks: Attacks to play.
        seed: Random seed of the draws and of the resamples.
    """
    found, rng, nobody = {}, generator(seed), np.zeros(0, np.int64)
    aims = {"sink": (replay.best, 0.0), "lift": (replay.newcomers, 1.0)}
    honest = {
        goal: replay.percentiles(targets, nobody, rating)
        for goal, (targets, rating) in aims.items()
    }
    for goal, count, origin in attacks:
        targets, rating = aims[goal]
        teams = [replay.fresh[:count]]
        if origin == "hijacked":
            teams = [rng.choice(replay.active, count, replace=False) for _ in range(_DRAWS)]
        after = np.mean([replay.percentiles(targets, team, rating) for team in teams], axis=0)
        before, moved = (interval(mean(x), np.arange(len(x)), seed) for x in (honest[goal], after))
        found[Attack(goal, count, origin)] = Shift(before, moved, after)
    return found


def _best(log: Log, past: int) -> Ints:
    """Return the providers with the highest Beta reputation from so many ratings, the best
    first.
    """
    successes, count = (
        np.bincount(log.ratees[:past], w, log.shape[1]) for w in (log.values[:past], np.ones(past))
    )
    order = np.argsort(-reputation(successes, count - successes), kind="stable")
    chosen: Ints = order[count[order] > 0][:TARGETS]
    return chosen
