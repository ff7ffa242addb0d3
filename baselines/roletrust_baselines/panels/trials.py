"""How well methods find the truth from votes, by the number of own labels."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_baselines.logs.resampling import correlation, interval, mean, ranks
from roletrust_baselines.panels.verdicts import Method, right
from roletrust_baselines.panels.votes import Votes
from roletrust_env.metrics.confidence import Interval
from roletrust_env.metrics.score import ratio
from roletrust_env.trust.key_index import Floats, Ints

ALL = "all"
"""Name of all kinds of items together."""


class Scope(NamedTuple):
    """Items on which verdicts are judged, and those that may be labelled.

    Attributes:
        scored: Kind of the items that are judged.
        labelled: Kind of the items that may be labelled; where it is another one, no judged item
            is.
        votes: Votes on both.
        judged: Whether each item is judged, shape (I,).
        pool: Places of the items that may be labelled.
    """

    scored: str
    labelled: str
    votes: Votes
    judged: npt.NDArray[np.bool_]
    pool: Ints


def scopes(votes: Votes) -> list[Scope]:
    """Return all items, and where there are kinds each with labels from itself and with labels from
    the others.
    """
    known = votes.truth >= 0
    found = [Scope(ALL, ALL, votes, known, np.flatnonzero(known))]
    if len(votes.kind_names) < 2:
        return found
    for place, name in enumerate(votes.kind_names):
        here = votes.kinds == place
        for labelled, source in ((name, here), ("other", ~here & (votes.kinds >= 0))):
            part = votes.only(here | source)
            of_kind, pool = (chosen[here | source] for chosen in (here & known, source & known))
            found.append(Scope(name, labelled, part, of_kind, np.flatnonzero(pool)))
    return found


def draws(scope: Scope, labels: int, many: int, seed: int) -> list[Ints]:
    """Return items to label, drawn many times; once without labels, and never if nothing would be
    left to judge.
    """
    if labels == 0:
        return [np.zeros(0, np.int64)]
    if labels >= len(scope.pool):
        return []
    rng = np.random.default_rng([seed, labels])
    return [np.sort(rng.choice(scope.pool, labels, replace=False)) for _ in range(many)]


def hits(
    scope: Scope, votes: Votes, method: Method, labelled: Sequence[Ints]
) -> tuple[Floats, list[Floats]]:
    """Return how right the verdict is on each judged item, shape (n,), and the trust in the judges,
    each time.

    An item counts with its mean over the sets of labels in which it has none.

    Args:
        scope: Items.
        votes: Votes on them, which may differ from those of the scope.
        method: Method.
        labelled: Sets of labels, see `draws`.
    """
    total, count = np.zeros((2, len(votes.truth)))
    trust = list[Floats]()
    for one in labelled if method.takes_labels else labelled[:1]:
        verdict, there = method(votes, one), scope.judged.copy()
        if method.takes_labels:
            there[one] = False
        total[there] += right(votes, verdict.support)[there]
        count += there
        trust += [] if verdict.trust is None else [verdict.trust]
    return total[count > 0] / count[count > 0], trust


def accuracy(
    scope: Scope, votes: Votes, method: Method, labelled: Sequence[Ints], seed: int = 0
) -> Interval:
    """Return the share of the judged items without a label in which a verdict is right, see `hits`.

    The interval resamples items.

    Args:
        scope: Items.
        votes: Votes on them, such as with bought judges.
        method: Method.
        labelled: Sets of labels, see `draws`.
        seed: Random seed of the resamples.
    """
    return _share(hits(scope, votes, method, labelled)[0], seed)


def judge(
    scope: Scope, method: Method, labelled: Sequence[Ints], seed: int = 0
) -> dict[str, Interval]:
    """Return how well a method does, over several sets of labels.

    - `accuracy`: see `accuracy`.
    - `spearman`: rank correlation of trust in the judges with their true accuracy on the judged
      items without a label, the mean over the sets of labels. Intervals resample judges. Missing
      without trust in judges.

    Args:
        scope: Items.
        method: Method.
        labelled: Sets of labels, see `draws`.
        seed: Random seed of the resamples.
    """
    each, trust = hits(scope, scope.votes, method, labelled)
    found = {"accuracy": _share(each, seed)}
    if trust:
        true = []
        for one in labelled[: len(trust)]:
            left = scope.judged.copy()
            if method.takes_labels:
                left[one] = False
            true.append(ratio(*scope.votes.graded(left)))
        some = ~np.isnan(true).all(axis=0)
        pairs = [(t[some], a[some]) for t, a in zip(trust, true, strict=True)]
        found["spearman"] = interval(_mean_spearman(pairs), np.arange(int(some.sum())), seed)
    return found


def _share(each: Floats, seed: int) -> Interval:
    return interval(mean(each), np.arange(len(each)), seed)


def _mean_spearman(pairs: Sequence[tuple[Floats, Floats]]) -> Callable[[Floats], float]:
    """Return a function from weights to the mean rank correlation of several pairs; the second may
    have NaN.
    """
    there = [~np.isnan(other) for _, other in pairs]
    each = [
        correlation(ranks(one[n]), ranks(other[n]))
        for (one, other), n in zip(pairs, there, strict=True)
    ]

    def of(weights: Floats) -> float:
        found = [one(weights[n]) for one, n in zip(each, there, strict=True)]
        known = [one for one in found if not np.isnan(one)]
        return float(np.mean(known)) if known else np.nan

    return of
