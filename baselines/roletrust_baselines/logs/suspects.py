"""Groups of raters that rate the same agents alike far beyond chance, and what their joint removal does to ranks."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from roletrust_baselines.logs.resampling import ranks
from roletrust_baselines.logs.rounds import played
from roletrust_env.data.log import RatingLog
from roletrust_env.trust.edges import pair_ends, pair_keys
from roletrust_env.trust.key_index import Floats, Ints

SHUFFLES = 19
"""Number of shuffled logs: a group that moves ranks more than in each, and is further from others, has p = 0.05."""

_LEVELS = 4  # ratings are alike if they are the same after rounding to one of five levels
_CHANCE = 0.5  # expected number of others with which a rater is joined by chance
_SMALLEST = 3  # votes that two raters share
_CORE = 3  # others of its group with which each rater is joined
_TOP = 10  # groups that are compared with shuffled logs
_PAIRS = 10_000_000  # pairs of ratings that are compared at most; the most popular ratees are left out first
_SWAPS = 100  # rounds of swaps


class Suspects(NamedTuple):
    """A group of raters.

    Attributes:
        raters: Places of the raters.
        ratees: Places of the ratees that at least two of them rate alike.
        shift: Mean distance by which the percentiles of the agents that they rate move without their ratings. An agent
            has the square of the number of its raters in the group as weight, so that cover hides no targets.
        apart: Mean distance of their ratings from those of others of the same agents, with the same weights, or from
            the mean of the log where there are no others.
        chance: Mean shift in shuffled logs.
        p: Share of shuffled logs, and of the log itself, in which the shift is at least as large, or the same for
            `apart` if it is larger.
    """

    raters: Ints
    ratees: Ints
    shift: float
    apart: float
    chance: float
    p: float


class Search(NamedTuple):
    """The groups of a log.

    Attributes:
        groups: Groups, those that move ranks beyond chance first, and of these the one that moves them most.
        shuffles: Number of shuffled logs.
        false_groups: Number of groups that were found in all of these together.
    """

    groups: list[Suspects]
    shuffles: int
    false_groups: int


def find_suspects(
    model: Any,
    log: RatingLog,
    numbers: Ints,
    *,
    seed: int = 0,
    shuffles: int = SHUFFLES,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> Search:
    """Return the groups of raters that rate alike, see `alike`, with what their ratings do to ranks.

    A group that moves no ranks, or says what others say, may be an honest club. So both are compared with what the same
    raters do in shuffled logs, in which they have no common ratees.

    Args:
        model: Trust model.
        log: Log.
        numbers: Number of the round of each rating, shape (n,), ascending.
        seed: Random seed of the shuffles.
        shuffles: Number of shuffled logs, at least 1.
        advance: Function that is called with the number of logs that were searched, and of all.

    Raises:
        MemoryError: The model does not fit, see `make_run`.
    """
    rng, groups = np.random.default_rng(seed), alike(log)
    raters = [group for group, _ in groups]
    order = np.argsort(-effects(model, log, numbers, raters)[:, 0], kind="stable")
    groups = [groups[place] for place in order[:_TOP].tolist()]
    raters = [group for group, _ in groups]
    measured = np.zeros((shuffles + 1, len(groups), 2))
    false_groups = 0
    for turn in range(shuffles + 1):
        one = shuffled(log, rng) if turn else log
        false_groups += len(alike(one)) if turn else 0
        measured[turn] = effects(model, one, numbers, raters)
        advance(turn + 1, shuffles + 1)
    p = (measured >= measured[0]).mean(0).max(1)
    chances = measured[1:, :, 0].mean(0)
    found = [
        Suspects(*group, float(shift), float(apart), float(chance), float(share))
        for group, (shift, apart), chance, share in zip(groups, measured[0], chances, p, strict=True)
    ]
    found.sort(key=lambda group: (group.p > 1 / min(shuffles + 1, 20), -group.shift))
    return Search(found, shuffles, false_groups)


def effects(model: Any, log: RatingLog, numbers: Ints, groups: list[Ints]) -> Floats:
    """Return `shift` and `apart` of each group of raters, shape (n, 2), see `Suspects`."""
    found = np.zeros((len(groups), 2))
    if not groups:
        return found
    rated, size = np.unique(log.ratees), log.shape[1]
    before = ranks(played(model, log, numbers).provider_trust[rated])
    for at, raters in enumerate(groups):
        theirs = np.isin(log.raters, raters)
        after = ranks(played(model, log, numbers, without=theirs).provider_trust[rated])
        pairs = np.unique(pair_keys(log.raters[theirs], log.ratees[theirs]))
        weights = np.bincount(pair_ends(pairs)[1], minlength=size) ** 2
        own, others = (_means(log.ratees[part], log.values[part], size) for part in (theirs, ~theirs))
        apart = np.where(weights > 0, np.abs(own - np.where(np.isnan(others), log.values.mean(), others)), 0.0)
        found[at] = np.average(np.abs(after - before), weights=weights[rated]), np.average(apart, weights=weights)
    return found


def _means(ratees: Ints, values: Floats, size: int) -> Floats:
    """Return the mean rating of each ratee, shape (size,); NaN without ratings."""
    count = np.bincount(ratees, minlength=size)
    return np.where(count > 0, np.bincount(ratees, values, size) / np.maximum(count, 1), np.nan)


def alike(log: RatingLog) -> list[tuple[Ints, Ints]]:
    """Return groups of at least four raters that rate the same ratees alike far beyond chance, and these ratees.

    A vote is a ratee and one of five levels of a rating. In a log with the same numbers of votes of each rater and of
    raters of each vote, but else at random, two raters share a number of votes that is nearly Poisson with mean

        lam = d[i] d[k] (sum over votes of c (c - 1)) / m^2

    with d[i] votes of rater i, c raters of a vote, and m in all. Where they share s, Chernoff's bound says that the
    probability is at most exp(s - lam) (lam / s)^s. It is computed among the votes with at most 4, 8, 16, ... raters,
    so that ratings of popular ratees hide nobody, and the smallest counts.

    Two raters are joined if s is at least 3 and so many or more would join each rater with half another one by chance.
    In such a random graph no set of raters is joined with three others of the set each; this core of the graph is cut
    into communities by the method of Louvain (Blondel et al., "Fast Unfolding of Communities in Large Networks", 2008).

    Args:
        log: Log.

    Raises:
        ValueError: networkx is missing.
    """
    try:
        import networkx as nx
    except ImportError:
        raise ValueError("suspects need networkx: pip install 'roletrust-env[data]'") from None
    level = np.rint(log.values * _LEVELS).astype(np.int64)
    _, vote = np.unique(log.ratees * (_LEVELS + 1) + level, return_inverse=True)
    raters, votes = pair_ends(np.unique(pair_keys(log.raters, vote)))
    graph = nx.Graph()
    graph.add_weighted_edges_from(_joined(raters, votes))
    found = []
    for group in nx.community.louvain_communities(nx.k_core(graph, _CORE), seed=0):
        members = np.array(sorted(group))
        common, times = np.unique(votes[np.isin(raters, members)], return_counts=True)
        if len(group) > _CORE:
            found.append((members, np.unique(log.ratees[np.isin(vote, common[times > 1])])))
    return found


def _joined(raters: Ints, votes: Ints) -> Iterator[tuple[int, int, float]]:
    """Yield the pairs of raters that share votes beyond chance, with the size of the logarithm of the probability."""
    received = np.bincount(votes)
    limits = 2 ** np.arange(2, max(3, int(received.max() - 1).bit_length() + 1))
    enough = np.log(len(np.unique(raters)) * len(limits) / _CHANCE)
    order = np.lexsort((raters, votes))
    sorted_raters, starts = raters[order], np.cumsum(received) - received
    parts, left, least = [np.zeros(0, np.int64)], _PAIRS, 1
    for limit in limits.tolist():
        for size in np.unique(received[(received > least) & (received <= limit)]).tolist():
            members = sorted_raters[starts[received == size][:, None] + np.arange(size)]
            left -= len(members) * size * (size - 1) // 2
            if left < 0:
                return
            first, second = np.triu_indices(size, 1)
            parts.append(pair_keys(members[:, first], members[:, second]).ravel())
        least, rare = limit, received <= limit
        given = np.bincount(raters[rare[votes]], minlength=int(raters.max()) + 1)
        keys, shared = np.unique(np.concatenate(parts), return_counts=True)
        keys, shared = keys[shared >= _SMALLEST], shared[shared >= _SMALLEST]
        one, other = pair_ends(keys)
        chance = float((received[rare] * (received[rare] - 1.0)).sum()) / max(int(given.sum()), 1) ** 2
        mean = given[one] * given[other] * chance
        surprise = np.where(shared > mean, mean - shared + shared * np.log(shared / mean), 0.0)
        joined = surprise >= enough
        yield from zip(one[joined].tolist(), other[joined].tolist(), surprise[joined].tolist(), strict=True)


def shuffled(log: RatingLog, rng: np.random.Generator) -> RatingLog:
    """Return a log in which each rating has another ratee, and every rater and ratee has as many ratings as before.

    Ratings keep their rater, value and time. No rater gets a ratee twice in it whom it has rated once, and none itself
    where both roles have the same names, as far as a hundred rounds of swaps can avoid that.

    Args:
        log: Log.
        rng: Random generator.
    """
    ratees, both = rng.permutation(log.ratees), log.same_agents
    for _ in range(_SWAPS):
        keys = pair_keys(log.raters, ratees)
        order = np.argsort(keys, kind="stable")
        wrong = np.zeros(len(keys), bool)
        wrong[order[1:]] = np.diff(keys[order]) == 0
        if both:
            wrong |= log.raters == ratees
        places = np.flatnonzero(wrong)
        if not len(places):
            break
        for place, other in zip(places.tolist(), rng.integers(0, len(keys), len(places)).tolist(), strict=True):
            ratees[place], ratees[other] = ratees[other], ratees[place]
    return log._replace(ratees=ratees)
