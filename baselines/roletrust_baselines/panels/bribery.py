"""Bought judges: an attacker that knows all votes and the truth chooses which judges to buy and how they vote."""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from roletrust_baselines.logs.resampling import interval, mean
from roletrust_baselines.panels.trials import Scope, hits
from roletrust_baselines.panels.verdicts import Method
from roletrust_baselines.panels.votes import Votes
from roletrust_env.metrics.confidence import Interval
from roletrust_env.trust.key_index import Ints

Choice = Literal["best", "worst", "kindred", "random"]
Elsewhere = Literal["own", "truth", "majority"]

_CHOICES: tuple[Choice, ...] = ("best", "worst", "kindred", "random")
_ELSEWHERE: tuple[Elsewhere, ...] = ("own", "truth", "majority")

BOUGHT = (1, 3, 10, 30)
"""Numbers of bought judges."""


class Bribe(NamedTuple):
    """How bought judges vote on the items on which they voted.

    The lead of an item is that of the truth over the wrong answer with most votes, as a share of the votes of judges
    that are not bought: from -1 to 1. Where it is in a window, bought judges lie, and all vote for that wrong answer.
    Elsewhere they may earn trust.

    Attributes:
        choice: Judges that are bought: the most or the least accurate, those that agree most with one another, or any.
        low: Least lead at which they lie.
        high: Greatest lead at which they lie.
        elsewhere: What they vote on other items: as they did before, the truth, or the majority of the others.
    """

    choice: Choice = "best"
    low: float = -1.0
    high: float = 1.0
    elsewhere: Elsewhere = "own"

    def __str__(self) -> str:
        """Return the bribe in words."""
        if (self.low, self.high) == (-1, 1):
            return f"{self.choice}, always lie"
        return f"{self.choice}, lie at leads from {self.low:.2f} to {self.high:.2f}, else {self.elsewhere}"


def _changed(bribe: Bribe | None, rng: np.random.Generator) -> Bribe:
    """Return a bribe at random, or one that differs from another in one choice or in its window."""
    low, high = np.sort(rng.uniform(-1, 1, 2))
    new = Bribe(
        _CHOICES[rng.integers(4)], float(low) if rng.random() < 0.5 else -1.0, float(high), _ELSEWHERE[rng.integers(3)]
    )
    if bribe is None:
        return new
    step = rng.normal(0, 0.15, 2)
    low, high = np.sort(np.clip([bribe.low + step[0], bribe.high + step[1]], -1, 1))
    near = (
        bribe._replace(choice=new.choice),
        bribe._replace(elsewhere=new.elsewhere),
        bribe._replace(low=low, high=high),
    )
    return near[rng.choice(3, p=(0.2, 0.2, 0.6))]


def chosen(votes: Votes, bought: int, choice: Choice, seed: int = 0) -> Ints:
    """Return the places of the judges that are bought."""
    accuracy = np.nan_to_num(votes.accuracy, nan=0.5)
    if choice == "random":
        return np.random.default_rng(seed).permutation(len(accuracy))[:bought]
    if choice == "kindred":  # the judge that others agree with most, and those that agree most with it
        judges, items, answers = votes.shape
        grid = np.zeros((judges, items * answers))
        grid[votes.judges[:, None], votes.answers_to(votes.items)] = votes.shares
        alike = grid @ grid.T
        return np.argsort(-alike[alike.sum(axis=0).argmax()], kind="stable")[:bought]
    return np.argsort(accuracy if choice == "worst" else -accuracy, kind="stable")[:bought]


def bribed(votes: Votes, judges: Ints, bribe: Bribe) -> Votes:
    """Return the votes as they are once these judges are bought."""
    _, items, answers = votes.shape
    free, every = np.ones(votes.shape[0]), np.arange(items)
    free[judges] = 0
    tally = votes.tally(free)
    total, favourite = tally.sum(axis=1), tally.argmax(axis=1)
    true = np.where(votes.truth >= 0, votes.truth, favourite)
    others = tally.copy()
    others[every, true] = -1
    wrong = others.argmax(axis=1)
    ahead = tally[every, true] - tally[every, wrong]
    lead = np.divide(ahead, total, out=np.zeros(items), where=total > 0)
    lies = (lead >= bribe.low) & (lead <= bribe.high)
    said = np.where(lies, wrong, true if bribe.elsewhere == "truth" else favourite)
    rows = np.isin(votes.judges, judges)
    if bribe.elsewhere == "own":
        rows &= lies[votes.items]
    shares = votes.shares.copy()
    shares[rows] = np.eye(answers)[said[votes.items[rows]]]
    return votes._replace(shares=shares)


def worst_bribe(
    scope: Scope, method: Method, bought: int, labelled: Sequence[Ints], budget: int, seed: int = 0
) -> tuple[Interval, Bribe]:
    """Return the least accuracy that a search finds, with its interval, and the bribe.

    The search begins with plain lies by each choice of judges, goes on with as many at random as make half of the
    budget, and then changes the best. The owner's labels are true, and the attacker does not know which items have one.

    Args:
        scope: Items.
        method: Method.
        bought: Number of judges that are bought.
        labelled: Sets of labels, see `draws`.
        budget: Number of bribes that are tried.
        seed: Random seed.
    """
    rng, least, found = np.random.default_rng(seed), np.zeros(0), Bribe()
    plain = [Bribe(choice) for choice in _CHOICES]
    for at in range(budget):
        bribe = plain[at] if at < len(plain) else _changed(found if 2 * at > budget else None, rng)
        attacked = bribed(scope.votes, chosen(scope.votes, bought, bribe.choice, seed), bribe)
        each, _ = hits(scope, attacked, method, labelled)
        if not len(least) or each.mean() < least.mean():
            least, found = each, bribe
    return interval(mean(least), np.arange(len(least)), seed), found
