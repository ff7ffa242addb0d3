"""Groups of raters that rate the same agents alike more often than chance explains."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from roletrust_env.logs.log import Log
from roletrust_env.metrics.score import ratio
from roletrust_env.randomness import generator
from roletrust_env.trust.edges import pair_ends, pair_keys
from roletrust_env.trust.key_index import Ints

SHUFFLES = 99
"""Default number of shuffled logs: the smallest p is 0.01."""

_STEPS = 4  # ratings are alike if they are equal after rounding to one of five levels
_LIMITS = 4, 8, 16, 32, 64  # a vote counts if it has at most so many raters
_PAIRS = 20_000_000  # pairs of raters that share a vote; a limit with more of them is left out
_CORE = 3  # neighbours of each rater within its group


class Group(NamedTuple):
    """A group of raters that rate alike.

    Attributes:
        raters: Positions of the raters, shape (n,), ascending.
        ratees: Positions of the ratees that at least two of them rate alike, ascending.
        apart: Distance of their ratings from those of others, in [0, 1], see `apart`.
        p: Probability that chance makes `apart` at least as large: (1 + k) / (1 + shuffles) if the
            same raters are as far from others in k shuffled logs. An honest club has a large p.
    """

    raters: Ints
    ratees: Ints
    apart: float
    p: float


class Suspects(NamedTuple):
    """The groups of a log, and how many groups chance makes.

    Attributes:
        groups: Groups, ordered by p, and by size where p is equal.
        shuffles: Number of shuffled logs.
        false_positive_rate: Share of the shuffled logs in which there is any group.
        false_groups: Mean number of groups in a shuffled log.
    """

    groups: list[Group]
    shuffles: int
    false_positive_rate: float
    false_groups: float


def find_suspects(
    log: Log,
    *,
    shuffles: int = SHUFFLES,
    seed: int = 0,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> Suspects:
    """Return the groups of raters that rate alike, with their false-positive rate.

    1. `alike` finds groups of raters that share ratings.
    2. `apart` measures how far their ratings are from those of others. Members of an honest club
       share ratings, too, but rate as others do.
    3. Both are repeated in shuffled logs, in which every rating has the ratee of another rating.
       Groups in a shuffled log are false positives.

    A group is a reason to look, and not a proof.

    Args:
        log: Log.
        shuffles: Number of shuffled logs, at least 1.
        seed: Random seed of the shuffles.
        advance: Function of the number of shuffled logs so far, and of all.

    Raises:
        ValueError: networkx is missing.

    Example:
        >>> from roletrust_env.logs.log import read
        >>> rows = [(f"r{n % 60}", f"shop{n % 70}", n % 5) for n in range(300)]
        >>> rows += [(f"ring{n}", f"stall{k}", 5) for n in range(5) for k in range(5)]
        >>> rater, ratee, rating = zip(*rows)
        >>> log = read({"rater": rater, "ratee": ratee, "rating": rating}, scale=(0, 5))
        >>> [group] = find_suspects(log).groups
        >>> [log.rater_names[position] for position in group.raters]
        ['ring0', 'ring1', 'ring2', 'ring3', 'ring4']
    """
    rng = generator(seed)
    groups = alike(log)
    distances = [apart(log, raters) for raters, _ in groups]
    as_far = np.ones(len(groups))
    n_false = np.zeros(shuffles)
    for n in range(shuffles):
        shuffled = log._replace(ratees=rng.permutation(log.ratees))
        n_false[n] = len(alike(shuffled))
        by_chance = [apart(shuffled, raters) for raters, _ in groups]
        as_far += np.greater_equal(by_chance, distances)
        advance(n + 1, shuffles)
    p = as_far / (1 + shuffles)
    found = [Group(*groups[n], distances[n], float(p[n])) for n in range(len(groups))]
    found.sort(key=lambda group: (group.p, -len(group.raters)))
    return Suspects(found, shuffles, float((n_false > 0).mean()), float(n_false.mean()))


def alike(log: Log) -> list[tuple[Ints, Ints]]:
    """Return groups of at least four raters that rate alike, each with its common ratees.

    A vote is a ratee with one of five levels of a rating. `_joined_pairs` joins raters that share
    more votes than chance explains. Groups are the communities (Louvain) of the 3-core of this
    graph, in which each rater is joined with at least three others. A random graph with fewer than
    3.35 neighbours per rater has no large 3-core (Pittel et al., "Sudden Emergence of a Giant
    k-Core", 1996); here chance joins a rater with at most one other.

    Raises:
        ValueError: networkx is missing.
    """
    try:
        import networkx as nx
    except ImportError:
        raise ValueError("suspects need networkx: pip install 'roletrust-env[logs]'") from None
    level = np.rint(log.values * _STEPS).astype(np.int64)
    vote_ratees, vote = np.unique(pair_keys(log.ratees, level), return_inverse=True)
    raters, votes = pair_ends(np.unique(pair_keys(log.raters, vote)))
    graph = nx.Graph()
    for limit in _LIMITS:
        graph.add_weighted_edges_from(_joined_pairs(raters, votes, limit))
    groups = []
    for community in nx.community.louvain_communities(nx.k_core(graph, _CORE), seed=0):
        members = np.array(sorted(community))
        common, counts = np.unique(votes[np.isin(raters, members)], return_counts=True)
        ratees = np.unique(pair_ends(vote_ratees[common[counts > 1]])[0])
        if len(members) > _CORE:
            groups.append((members, ratees))
    return groups


def _joined_pairs(raters: Ints, votes: Ints, limit: int) -> Iterator[tuple[int, int, float]]:
    """Yield pairs of raters that share more votes than chance explains, with a weight.

    Only votes with at most `limit` raters count. If rater i has d[i] of these m votes, and c raters
    share a vote, then the number of votes that raters i and k share by chance is nearly Poisson
    with mean

        lam = d[i] d[k] (sum over votes of c (c - 1)) / m^2

    The probability of s or more is at most exp(s - lam) (lam / s)^s (Chernoff). A pair is joined if
    that is at most 1 / (raters x limits), so that chance joins a rater with at most one other.

    Args:
        raters: Rater of each vote, shape (n,). No pair of rater and vote repeats.
        votes: Vote, shape (n,).
        limit: Largest number of raters of a vote.
    """
    enough = np.log(len(np.unique(raters)) * len(_LIMITS))
    sizes = np.bincount(votes)
    rare = sizes[votes] <= limit
    sizes = sizes[sizes <= limit]
    repeats = float((sizes * (sizes - 1)).sum())
    if not 0 < repeats <= 2 * _PAIRS:
        return
    order = np.lexsort((raters[rare], votes[rare]))
    raters, votes = raters[rare][order], votes[rare][order]
    keys = []
    for step in range(1, limit):  # each rater of a vote with the one `step` further on
        same = votes[step:] == votes[:-step]
        keys.append(pair_keys(raters[:-step][same], raters[step:][same]))
    pairs, shared = np.unique(np.concatenate(keys), return_counts=True)
    first, second = pair_ends(pairs)
    n_votes = np.bincount(raters)
    mean = n_votes[first] * n_votes[second] * repeats / len(votes) ** 2
    bound = mean - shared + shared * np.log(shared / mean)  # minus the logarithm
    joined = (shared > 1) & (shared > mean) & (bound >= enough)
    columns = first[joined], second[joined], bound[joined]
    yield from zip(*(column.tolist() for column in columns), strict=True)


def apart(log: Log, raters: Ints) -> float:
    """Return the mean distance of a group's ratings from those of others of the same ratees.

    A ratee has the square of the number of its raters in the group as weight, so that ratings of
    other agents do not hide a common target. A ratee without other raters is compared with the mean
    rating of the log.
    """
    own = np.isin(log.raters, raters)
    n_ratees = log.shape[1]
    pairs = np.unique(pair_keys(log.raters[own], log.ratees[own]))
    weights = np.bincount(pair_ends(pairs)[1], minlength=n_ratees) ** 2.0
    means = []
    for part in (own, ~own):
        ratees = log.ratees[part]
        sums = np.bincount(ratees, log.values[part], n_ratees)
        means.append(ratio(sums, np.bincount(ratees, minlength=n_ratees)))
    theirs, others = means
    others = np.where(np.isnan(others), log.values.mean(), others)
    rated = weights > 0
    return float(np.average(np.abs(theirs - others)[rated], weights=weights[rated]))
