"""Groups of raters that rate the same agents alike far beyond chance, and what their joint removal
does to ranks.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.logs.log import Log
from roletrust_env.logs.log_rounds import played
from roletrust_env.metrics.resampling import ranks
from roletrust_env.metrics.score import ratio
from roletrust_env.randomness import generator
from roletrust_env.trust.edges import pair_ends, pair_keys
from roletrust_env.trust.key_index import Floats, Ints

SHUFFLES = 19
"""Number of shuffled logs: a group that moves ranks more than in each, and is further from others,
has p = 0.05."""

_LEVELS = 4  # ratings are alike if they are the same after rounding to one of five levels
_CHANCES = (
    4.0,
    2.0,
    1.0,
    0.5,
)  # thresholds: the bound on the probability is wide, so that 4 may be less than 3.35
_SMALLEST = 2  # votes that two raters share
_CORE = 3  # others of its group with which each rater is joined
_TOP = 20  # groups that are shown
# pairs of ratings that are compared at most; the most popular ratees are left out first
_PAIRS = 10_000_000
_SWAPS = 100  # rounds of swaps


class Suspects(NamedTuple):
    """A group of raters.

    Attributes:
        raters: Places of the raters.
        ratees: Places of the ratees that at least two of them rate alike.
        shift: Mean distance by which the percentiles of the agents that they rate move without
            their ratings. An agent has the square of the number of its raters in the group as
            weight, so that cover hides no targets.
        apart: Mean distance of their ratings from those of others of the same agents, with the same
            weights, or from the mean of the log where there are no others.
        chance: Mean shift in the shuffled logs that were played; NaN if none was.
        p: Significance by the test of Besag and Clifford ("Sequential Monte Carlo p-Values", 1991),
            which plays no more logs than it needs: 1/n if the n-th shuffled log is the first one in
            which the shift or `apart` is at least as large, and if there is none 1/(n + 1) with all
            n of them.
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
        groups: Groups, those that move ranks beyond chance first, and of these the one that moves
            them most.
        shuffles: Number of shuffled logs.
        false_groups: Number of groups that were found in all of these together.
    """

    groups: list[Suspects]
    shuffles: int
    false_groups: int


def find_suspects(
    model: Any,
    log: Log,
    numbers: Ints,
    *,
    seed: int = 0,
    shuffles: int = SHUFFLES,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> Search:
    """Return the groups of raters that rate alike, see `alike`, with what their ratings do to
    ranks.

    A group that moves no ranks, or says what others say, may be an honest club. So both are
    compared with what the same raters do in shuffled logs, in which they have no common ratees.

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
    rng = generator(seed)
    logs = [shuffled(log, rng) for _ in range(shuffles)]
    joined, false_groups = threshold(logs)
    groups = alike(log, joined)
    raters, aparts = [group for group, _ in groups], [apart(log, group) for group, _ in groups]
    measured = shifts(model, log, numbers, raters)
    by_chance, left = [list[float]() for _ in groups], list(range(len(groups)))
    p = np.full(len(groups), 1 / (shuffles + 1))
    for turn, one in enumerate(logs, 1):
        close = [at for at in left if apart(one, raters[at]) >= aparts[at]]
        left = [at for at in left if at not in close]
        for at, shift in zip(
            left, shifts(model, one, numbers, [raters[at] for at in left]), strict=True
        ):
            by_chance[at].append(float(shift))
        close += [at for at in left if by_chance[at][-1] >= measured[at]]
        left = [at for at in left if at not in close]
        p[close] = 1 / turn
        advance(turn, shuffles)
    found = [
        Suspects(
            *group, float(shift), far, float(np.mean(chances)) if chances else np.nan, float(share)
        )
        for group, shift, far, chances, share in zip(
            groups, measured, aparts, by_chance, p, strict=True
        )
    ]
    found.sort(key=lambda group: (group.p > 1 / min(shuffles + 1, 20), -group.shift))
    return Search(found[:_TOP], shuffles, false_groups)


def threshold(logs: list[Log]) -> tuple[float, int]:
    """Return the largest of a few thresholds for `alike` at which shuffled logs have no groups, and
    their groups then.

    If they have some at each, the threshold is the smallest.
    """
    for joined in _CHANCES:
        if not any(alike(one, joined) for one in logs):
            return joined, 0
    return joined, sum(len(alike(one, joined)) for one in logs)


def shifts(model: Any, log: Log, numbers: Ints, groups: list[Ints]) -> Floats:
    """Return `shift` of each group of raters, shape (n,), see `Suspects`."""
    if not groups:
        return np.zeros(0)
    rated = np.unique(log.ratees)
    pairs, found = log.pairs(), []
    before = ranks(played(model, log, numbers, pairs=pairs).provider_trust[rated])
    for raters in groups:
        theirs, weights = _theirs(log, raters)
        after = ranks(
            played(model, log, numbers, pairs=pairs, without=theirs).provider_trust[rated]
        )
        found.append(np.average(np.abs(after - before), weights=weights[rated]))
    return np.array(found)


def apart(log: Log, raters: Ints) -> float:
    """Return `apart` of a group of raters, see `Suspects`."""
    theirs, weights = _theirs(log, raters)
    own, others = (
        _means(log.ratees[part], log.values[part], log.shape[1]) for part in (theirs, ~theirs)
    )
    far = np.where(
        weights > 0, np.abs(own - np.where(np.isnan(others), log.values.mean(), others)), 0.0
    )
    return float(np.average(far, weights=weights))


def _theirs(log: Log, raters: Ints) -> tuple[npt.NDArray[np.bool_], Ints]:
    """Return whether each rating is one of a group, and the weight of each ratee."""
    theirs = np.isin(log.raters, raters)
    pairs = np.unique(pair_keys(log.raters[theirs], log.ratees[theirs]))
    return theirs, np.bincount(pair_ends(pairs)[1], minlength=log.shape[1]) ** 2


def _means(ratees: Ints, values: Floats, size: int) -> Floats:
    """Return the mean rating of each ratee, shape (size,); NaN without ratings."""
    return ratio(np.bincount(ratees, values, size), np.bincount(ratees, minlength=size))


def alike(log: Log, chance: float) -> list[tuple[Ints, Ints]]:
    """Return groups of at least four raters that rate the same ratees alike far beyond chance, and
    these ratees.

    A vote is a ratee and one of five levels of a rating. In a log with the same numbers of votes of
    each rater and of raters of each vote, but else at random, two raters share a number of votes
    that is nearly Poisson with mean

        lam = d[i] d[k] (sum over votes of c (c - 1)) / m^2

    with d[i] votes of rater i, c raters of a vote, and m in all. Where they share s, Chernoff's
    bound says that the probability is at most exp(s - lam) (lam / s)^s. It is computed among the
    votes with at most 4, 8, 16, ... raters, so that ratings of popular ratees hide nobody, and the
    smallest counts.

    Two raters are joined if s is at least 2 and so many or more would join each rater with `chance`
    others at the most. A random graph in which each is joined with 3.35 others has no set of raters
    that are joined with three others of the set each (Pittel et al., "Sudden Emergence of a Giant
    k-Core", 1996). This core of the graph is cut into communities by the method of Louvain (Blondel
    et al., "Fast Unfolding of Communities in Large Networks", 2008).

    Args:
        log: Log.
        chance: Expected number of others with which a rater is joined by chance, at the most. See
            `threshold`.

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
    graph.add_weighted_edges_from(_joined(raters, votes, chance))
    found = []
    for group in nx.community.louvain_communities(nx.k_core(graph, _CORE), seed=0):
        members = np.array(sorted(group))
        common, times = np.unique(votes[np.isin(raters, members)], return_counts=True)
        if len(group) > _CORE:
            found.append((members, np.unique(log.ratees[np.isin(vote, common[times > 1])])))
    return found


def _joined(raters: Ints, votes: Ints, chance: float) -> Iterator[tuple[int, int, float]]:
    """Yield the pairs of raters that share votes beyond chance, with the size of the logarithm of
    the probability.
    """
    received = np.bincount(votes)
    limits = 2 ** np.arange(2, max(3, int(received.max() - 1).bit_length() + 1))
    enough = np.log(len(np.unique(raters)) * len(limits) / chance)
    order = np.lexsort((raters, votes))
    sorted_raters, starts = raters[order], np.cumsum(received) - received
    parts, left, most = (
        [np.zeros((2, 0), np.int64)],
        _PAIRS,
        limits[-1],
    )  # pairs, and the raters of their votes
    for size in np.unique(received[received > 1]).tolist():
        members = sorted_raters[starts[received == size][:, None] + np.arange(size)]
        left -= len(members) * size * (size - 1) // 2
        if left < 0:
            most = size - 1
            break
        first, second = np.triu_indices(size, 1)
        keys = pair_keys(members[:, first], members[:, second]).ravel()
        parts.append(np.stack([keys, np.full(len(keys), size)]))
    keys, sizes = np.concatenate(parts, axis=1)
    order = np.argsort(keys, kind="stable")
    _, times = np.unique(keys, return_counts=True)
    order = order[np.repeat(times >= _SMALLEST, times)]
    keys, begin = np.unique(keys[order], return_index=True)
    pairs = pair_ends(keys)
    for limit in limits[limits <= most].tolist() if len(keys) else ():
        shared = np.add.reduceat((sizes[order] <= limit).astype(np.int64), begin)
        one, other, shared = (column[shared >= _SMALLEST] for column in (*pairs, shared))
        rare = received <= limit
        given = np.bincount(raters[rare[votes]], minlength=int(raters.max()) + 1)
        likely = (
            float((received[rare] * (received[rare] - 1.0)).sum()) / max(int(given.sum()), 1) ** 2
        )
        mean = given[one] * given[other] * likely
        surprise = np.where(shared > mean, mean - shared + shared * np.log(shared / mean), 0.0)
        beyond = surprise >= enough
        yield from zip(
            one[beyond].tolist(), other[beyond].tolist(), surprise[beyond].tolist(), strict=True
        )


def shuffled(log: Log, rng: np.random.Generator) -> Log:
    """Return a log in which each rating has another ratee, and every rater and ratee has as many
    ratings as before.

    Ratings keep their rater, value and time. No rater gets a ratee twice in it whom it has rated
    once, and none itself where both roles have the same names, as far as a hundred rounds of swaps
    can avoid that.
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
        for place, other in zip(
            places.tolist(), rng.integers(0, len(keys), len(places)).tolist(), strict=True
        ):
            ratees[place], ratees[other] = ratees[other], ratees[place]
    return log._replace(ratees=ratees)
