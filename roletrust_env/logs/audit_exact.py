"""The cheapest attack on a ranking by a separable model, which no search can miss.

A model is separable if trust in an agent depends only on the ratings of this agent, whoever gave
them, and if neither a better rating nor more trust before a round can lower it. Then a cheapest
attack of new accounts sends ratings of 0 and 1 only: some to the target, which pushes it, and some
to rivals, which it pushes the other way. All accounts can do both, so the agents share accounts
but not ratings.

The best estimate of an agent for a number of accounts and of ratings follows by dynamic
programming over the last rounds. In each round, the model itself updates all states, so that no
formula of a model is written again.
"""

import math
from collections.abc import Iterator
from itertools import cycle, islice
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.logs.audit_ranking import LAST, MOST, Prices, Ranking, Row, Target
from roletrust_env.logs.models import AllTimeMean
from roletrust_env.logs.rounds import spans
from roletrust_env.trust.edges import pair_keys, start_on_edges
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.models.central.means import Mean, Median, TrimmedMean
from roletrust_env.trust.ratings import Ratings, merge_repeats

SEPARABLE: tuple[type, ...] = (Mean, Median, TrimmedMean, AllTimeMean)
"""Models of which the cheapest attack is known. Their memory of an agent that has got a number of
ratings is ordered by trust."""

TIE = 1e-9
"""Difference of estimates or prices that is taken for rounding."""


class ExactPrices:
    """Prices of the cheapest attacks of new accounts on a ranking by a separable model.

    A score is the estimate of an agent that is pushed up, and minus the estimate of an agent that
    is pushed down.
    """

    def __init__(self, ranking: Ranking, prices: Prices, *, work: int = 20_000_000) -> None:
        """Play the log up to its last rounds.

        Args:
            ranking: Ranking by a separable model.
            prices: Prices of accounts and ratings.
            work: Greatest number of updates by which the reach of rivals is computed. Beyond it, a
                bound is lower than the exact price.
        """
        log, size = ranking.log, ranking.size
        self._ranking, self._prices, self._work = ranking, prices, work
        self._raters = log.shape[0] + MOST
        self._start = start_on_edges(ranking.model, (self._raters, size))
        rounds = []
        for _, part in spans(ranking.numbers):
            sides = log.raters[part], log.ratees[part]
            rounds.append(merge_repeats(*sides, log.values[part], pair_keys(*sides))[:3])
        for raters, ratees, values in rounds[:-LAST]:
            self._start = self._updated(self._start, size, raters, ratees, values)
        self._rounds = rounds[-LAST:]
        self._tables = dict[tuple[Any, ...], Floats]()
        self._estimate = np.where(ranking.total > 0, ranking.estimate, math.nan)

    def _updated(self, state: Any, size: int, *edges: Any) -> Any:
        raters, ratees, values = edges
        ratings = Ratings(values, raters=raters, providers=ratees, shape=(self._raters, size))
        return self._ranking.model.update(state, ratings)

    def _spent(
        self, agents: Ints, up: bool, accounts: int, most: int, first: int
    ) -> tuple[Floats, npt.NDArray[np.int8]]:
        """Return the trust that numbers of extreme ratings give to agents.

        Args:
            agents: Positions of the agents, shape (k,).
            up: Whether the ratings are 1, not 0.
            accounts: Greatest number of ratings of an agent in a round.
            most: Greatest number of ratings of an agent.
            first: First round with hostile ratings, of those in the last rounds of the log.

        Returns:
            Trust for 0, 1, ..., `most` ratings, shape (k, most + 1), NaN where so many do not fit;
            and the number of ratings in each round that leads there, shape (rounds, k, most + 1).
        """
        width, sign = most + 1, 1.0 if up else -1.0
        size, start = len(agents) * width, self._start
        index = np.full(self._ranking.size, -1)
        index[agents] = np.arange(len(agents))
        slots, steps = np.arange(width), np.zeros((len(self._rounds), len(agents), width), np.int8)
        state = type(start)(start.tor, *(np.repeat(leaf[agents], width) for leaf in start[1:]))
        valid = np.zeros((len(agents), width), bool)
        valid[:, 0] = True
        for number, (raters, ratees, values) in enumerate(self._rounds):
            there = index[ratees] >= 0
            honest = (
                np.repeat(raters[there], width),
                (index[ratees[there]][:, None] * width + slots).reshape(-1),
                np.repeat(values[there], width),
            )
            score, best = np.full(valid.shape, -math.inf), state
            for n in range((min(accounts, most) if number >= first else 0) + 1):
                sent = (
                    self._raters - MOST + np.repeat(np.arange(n), size),
                    np.tile(np.arange(size), n),
                    np.full(n * size, float(up)),
                )
                edges = map(np.concatenate, zip(honest, sent, strict=True))
                after = self._updated(state, size, *edges)
                trust = self._ranking.model.provider_trust(after).reshape(valid.shape)
                reached = np.full(valid.shape, -math.inf)
                reached[:, n:] = np.where(valid, sign * trust, -math.inf)[:, : width - n]
                better = reached > score
                score[better] = reached[better]
                steps[number][better] = n
                chosen = (
                    np.where(
                        better.ravel(), np.roll(new.reshape(better.shape), n, axis=1).ravel(), old
                    )
                    for new, old in zip(after[1:], best[1:], strict=True)
                )
                best = type(start)(start.tor, *chosen)
            state, valid = best, score > -math.inf
        return np.where(valid, sign * score, math.nan), steps

    def _scores(self, agents: Ints, up: bool, accounts: int, most: int, first: int) -> Floats:
        """Return the best scores that agents get by at most so many accounts, and by at most 0, 1,
        ..., `most` ratings each, shape (k, most + 1); minus infinity for an unrated agent.
        """
        key = agents.tobytes(), up, accounts, most, first
        if key not in self._tables:
            if accounts > 1:
                fewer = min(most, (accounts - 1) * len(self._rounds))
                best = self._scores(agents, up, accounts - 1, fewer, first)
                best = np.pad(best, ((0, 0), (0, most - fewer)), mode="edge")
            else:
                signed = self._estimate[agents] if up else -self._estimate[agents]
                best = np.repeat(np.nan_to_num(signed, nan=-math.inf)[:, None], most + 1, axis=1)
            found, _ = self._shrunken(agents, up, accounts, most, first)
            self._tables[key] = np.maximum.accumulate(np.fmax(best, found), axis=1)
        return self._tables[key]

    def _shrunken(
        self, agents: Ints, up: bool, accounts: int, most: int, first: int
    ) -> tuple[Floats, npt.NDArray[np.int8]]:
        """Return the scores of agents that so many accounts rate, NaN for fewer ratings, and the
        ratings in each round, see `_spent`.
        """
        trust, steps = self._spent(agents, up, accounts, most, first)
        raters = self._ranking.raters[agents][:, None] + accounts
        estimate = self._ranking.shrinkage.of(trust, raters)
        found = np.where(np.arange(most + 1) >= accounts, estimate, math.nan)
        return found if up else -found, steps

    def cheapest(self, target: Target, *, strict: bool = False) -> tuple[float, list[Row]]:
        """Return a price below which no attack of at most 30 new accounts succeeds, and the ratings
        of an attack that costs so much.

        The price is infinite if there is no attack. If it takes too much work to find the attack,
        the ratings are those of a dearer one, or none.

        Args:
            target: Target.
            strict: Whether a tie with the edge of the top counts as a failure, not as a success.
        """
        prices, up = self._prices, target.goal != "sink"
        limit, best, choice = math.inf, math.inf, None
        tie = TIE if strict else -TIE
        for with_rivals in (False, True):
            for first, days in self._begins():
                for accounts in range(1, MOST + 1):
                    paid = accounts * prices.account + days
                    floor = paid + accounts * prices.rating
                    if floor > min(best, limit) - TIE:
                        break
                    left = (best - paid) / prices.rating if prices.rating else math.inf
                    cap = int(min(left + TIE, MOST * LAST * self._ranking.size))
                    rivals = self._rivals(not up, cap if with_rivals else 0)
                    most = min(accounts * len(self._rounds), 2 ** cap.bit_length())
                    if len(rivals) * most * accounts * len(self._rounds) > self._work:
                        limit = floor
                        break
                    reach = self._scores(rivals, not up, accounts, most, first)
                    scores = self._scores(np.array([target.place]), up, accounts, most, first)[0]
                    gains = np.flatnonzero(scores > np.append(-math.inf, scores[:-1]))
                    for spent in gains.tolist():
                        edge = tie - scores[spent]
                        chosen, ratings = self._needed(target, edge, rivals, reach)
                        if ratings == math.inf:
                            continue
                        price = paid + prices.rating * max(1, spent + ratings)
                        if price < best - TIE:
                            best, choice = price, (accounts, first, scores[spent], edge, chosen)
        return min(best, limit), self._rows(target, *choice) if choice else []

    def _begins(self) -> Iterator[tuple[int, float]]:
        """Yield the first rounds of attacks, and the price of their days."""
        for first in range(len(self._rounds) - 1, -1, -1) if self._prices.day else [0]:
            row = Row(LAST - len(self._rounds) + first, 0, 0, 0.0)
            yield first, self._prices.day and self._ranking.days([row]) * self._prices.day

    def _rivals(self, up: bool, cap: int) -> Ints:
        """Return the positions of the agents that an attack with so many ratings may push."""
        order, unrated = self._ranking.order, np.flatnonzero(self._ranking.total == 0)
        if up and cap:
            return np.append(order, unrated[: -self._ranking.top - 1 : -1])
        return order[: (self._ranking.top + 2 ** cap.bit_length()) * bool(cap)]

    def _needed(
        self, target: Target, edge: float, rivals: Ints, reach: Floats
    ) -> tuple[list[int], float]:
        """Return the rivals that must get a score so that the target crosses the edge of the top,
        and the number of their ratings; infinite if there are too few.

        Args:
            target: Target.
            edge: Score of the rivals.
            rivals: Positions of the rivals, shape (k,).
            reach: Their best scores by number of ratings, see `_scores`.
        """
        ranking, down = self._ranking, target.goal == "sink"
        others = self._estimate[ranking.order[ranking.order != target.place]]
        there = (others if down else -others) >= edge
        need = (ranking.top if down else len(others) - ranking.top + 1) - int(there.sum())
        if need <= 0:
            return [], 0
        costs = np.where(reach[:, -1] >= edge, (reach >= edge).argmax(axis=1), math.inf)
        costs[(costs == 0) | (rivals == target.place)] = math.inf
        nearest = np.argsort(costs, kind="stable")[:need]
        enough = len(nearest) == need
        return rivals[nearest].tolist(), float(costs[nearest].sum()) if enough else math.inf

    def _rows(
        self,
        target: Target,
        accounts: int,
        first: int,
        score: float,
        edge: float,
        rivals: list[int],
    ) -> list[Row]:
        """Return the ratings of an attack: the target gets a score, and the rivals that of the
        edge.
        """
        up = target.goal != "sink"
        rows = self._pushes(target.place, up, accounts, first, score)
        for rival in rivals:
            rows += self._pushes(rival, not up, accounts, first, edge)
        return sorted(rows) or [Row(LAST - 1, self._ranking.fresh, target.place, float(up))]

    def _pushes(self, agent: int, up: bool, accounts: int, first: int, score: float) -> list[Row]:
        """Return the fewest ratings by which an agent gets a score."""
        if (self._estimate[agent] if up else -self._estimate[agent]) >= score:
            return []
        count, fresh = len(self._rounds), self._ranking.fresh
        best, rows = math.inf, list[Row]()
        for a in range(1, accounts + 1):
            scores, steps = self._shrunken(np.array([agent]), up, a, a * count, first)
            left = int(np.argmax(np.append(scores[0] >= score - TIE / 1000, True)))
            if left < min(best, a * count + 1):
                best, voices, rows = left, cycle(range(fresh, fresh + a)), []
                for number in range(count - 1, -1, -1):
                    sent = int(steps[number][0, left])
                    at = LAST - count + number
                    rows += [Row(at, voice, agent, float(up)) for voice in islice(voices, sent)]
                    left -= sent
        return rows
