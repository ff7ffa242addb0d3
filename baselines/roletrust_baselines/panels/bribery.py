"""Bought judges: an attacker that knows all votes and the truth chooses which judges to buy and how
they vote.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from roletrust_baselines.panels.trials import Scope, hits
from roletrust_baselines.panels.verdicts import TIE, Method, log_odds
from roletrust_baselines.panels.votes import Votes
from roletrust_env.randomness import generator
from roletrust_env.trust.key_index import Ints

Choice = Literal["best", "worst", "kindred", "random"]
Elsewhere = Literal["own", "truth", "majority"]

_CHOICES: tuple[Choice, ...] = ("best", "worst", "kindred", "random")
_ELSEWHERE: tuple[Elsewhere, ...] = ("own", "truth", "majority")


class Bribe(NamedTuple):
    """How bought judges vote on the items on which they voted.

    The lead of an item is that of the truth over the wrong answer with most votes, as a share of
    the votes of judges that are not bought: from -1 to 1. These may have equal weights, or those of
    one who knows how accurate they are. Where the lead is in a window, bought judges lie, and all
    vote for that wrong answer. Elsewhere they may earn trust, and on the first items, too.

    Attributes:
        choice: Judges that are bought: the most or the least accurate, those that agree most with
            one another, or any.
        low: Least lead at which they lie.
        high: Greatest lead at which they lie.
        elsewhere: What they vote on other items: as they did before, the truth, or the favourite of
            the others.
        known: Share of the log-odds of accuracy in the weights of the others' votes, in [0, 1]; the
            rest is equal.
        honest: Share of the items, the first ones in the order of the votes, on which they do not
            lie, in [0, 1].
    """

    choice: Choice = "best"
    low: float = -1.0
    high: float = 1.0
    elsewhere: Elsewhere = "own"
    known: float = 0.0
    honest: float = 0.0

    def __str__(self) -> str:
        """Return the bribe in words."""
        where = f" at leads from {self.low:.2f} to {self.high:.2f} (known {self.known:.2f})"
        part = "" if (self.low, self.high) == (-1, 1) else where
        late = f" after {self.honest:.2f} of the items" if self.honest else ""
        lies = f"lie{part}{late}, else {self.elsewhere}" if part or late else "always lie"
        return f"{self.choice}, {lies}"


def _changed(bribe: Bribe | None, rng: np.random.Generator) -> Bribe:
    """Return a bribe at random, or one that differs from another in one choice or in its
    numbers.
    """
    one, other, known, honest = rng.uniform((-1, -1, 0, 0), 1).tolist()
    low, high = sorted((one if rng.random() < 0.5 else -1.0, other))
    known, honest = (value if rng.random() < 0.5 else 0.0 for value in (known, honest))
    new = Bribe(_CHOICES[rng.integers(4)], low, high, _ELSEWHERE[rng.integers(3)], known, honest)
    if bribe is None:
        return new
    step = rng.normal(0, (0.15, 0.15, 0.3, 0.2))
    low, high = np.sort(np.clip([bribe.low + step[0], bribe.high + step[1]], -1, 1)).tolist()
    known, honest = np.clip([bribe.known + step[2], bribe.honest + step[3]], 0, 1).tolist()
    near = {"low": low, "high": high, "known": known, "honest": honest if bribe.honest else 0.0}
    part = ({"choice": new.choice}, {"elsewhere": new.elsewhere}, {"honest": new.honest}, near)
    return bribe._replace(**part[rng.choice(4, p=(0.2, 0.1, 0.1, 0.6))])


def chosen(votes: Votes, bought: int, choice: Choice, seed: int = 0) -> Ints:
    """Return the places of the judges that are bought."""
    accuracy = np.nan_to_num(votes.accuracy, nan=0.5)
    if choice == "random":
        return generator(seed).permutation(len(accuracy))[:bought]
    if (
        choice == "kindred"
    ):  # the judge that others agree with most, and those that agree most with it
        judges, items, answers = votes.shape
        grid = np.zeros((judges, items * answers))
        grid[votes.judges[:, None], votes.answers_to(votes.items)] = votes.shares
        alike = grid @ grid.T
        return np.argsort(-alike[alike.sum(axis=0).argmax()], kind="stable")[:bought]
    return np.argsort(accuracy if choice == "worst" else -accuracy, kind="stable")[:bought]


def bribed(votes: Votes, judges: Ints, bribe: Bribe) -> Votes:
    """Return the votes as they are once these judges are bought, see `chosen`."""
    _, items, answers = votes.shape
    odds, every = log_odds(votes.accuracy, answers), np.arange(items)
    weights = 1 - bribe.known + bribe.known * odds / max(abs(odds).mean(), TIE)
    weights[judges] = 0
    tally, total = votes.tally(weights), votes.tally(abs(weights)).sum(axis=1)
    favourite = tally.argmax(axis=1)
    true = np.where(votes.truth >= 0, votes.truth, favourite)
    others = tally.copy()
    others[every, true] = -np.inf
    wrong = others.argmax(axis=1)
    ahead = tally[every, true] - tally[every, wrong]
    lead = np.divide(ahead, total, out=np.zeros(items), where=total > 0)
    lies = (lead >= bribe.low) & (lead <= bribe.high) & (every >= bribe.honest * items)
    said = np.where(lies, wrong, true if bribe.elsewhere == "truth" else favourite)
    rows = np.isin(votes.judges, judges)
    if bribe.elsewhere == "own":
        rows &= lies[votes.items]
    shares = votes.shares.copy()
    shares[rows] = np.eye(answers)[said[votes.items[rows]]]
    return votes._replace(shares=shares)


def find_bribe(
    scope: Scope,
    method: Method,
    bought: int,
    labelled: Sequence[Ints],
    budget: int,
    seed: int = 0,
    starts: Sequence[Bribe] = (),
) -> Bribe:
    """Return the bribe under which a method is right in the fewest items, of those that a search
    tries.

    The search begins with plain lies by each choice of judges and with given bribes, goes on with
    as many at random as make half of the budget, and then changes the best.

    Args:
        scope: Items.
        method: Method.
        bought: Number of judges that are bought.
        labelled: Sets of labels, see `draws`. They are others than those with which the bribe is
            measured, since the attacker does not know which items have one.
        budget: Number of bribes that are tried, of which plain lies are the first; these are tried
            in any case.
        seed: Random seed.
        starts: Bribes that are tried in addition.
    """
    rng, least, found = generator(seed), np.inf, Bribe()
    judges = {choice: chosen(scope.votes, bought, choice, seed) for choice in _CHOICES}
    given = [*(Bribe(choice) for choice in _CHOICES), *dict.fromkeys(starts)]
    for at in range(max(budget - len(_CHOICES), 0) + len(given)):
        bribe = (
            given[at]
            if at < len(given)
            else _changed(found if 2 * (at - len(given)) > budget else None, rng)
        )
        each, _ = hits(scope, bribed(scope.votes, judges[bribe.choice], bribe), method, labelled)
        if each.mean() < least:
            least, found = float(each.mean()), bribe
    return found
