"""How far trust was from later ratings in a log's past: which order of ranks forecasts them better,
and how wide an interval must be to cover them.

The log is cut at a few places. Trust at a cut knows the ratings before it, and is compared with the
mean of each agent's ratings after it. An interval is made of how far later means were from trust at
earlier cuts, among agents with about as many raters (split conformal prediction; Vovk et al.,
2005). The level of each such group is the one that covers 95% of it at the later cuts, since
ratings drift (Gibbs and Candès, 2021, adapt the level for the same reason).
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from roletrust_env.logs.log import Log
from roletrust_env.logs.log_rounds import played
from roletrust_env.logs.shrinkage import Shrinkage
from roletrust_env.metrics.resampling import correlation, ranks
from roletrust_env.randomness import generator
from roletrust_env.storage.untrusted import UntrustedModel
from roletrust_env.trust.edges import pair_keys
from roletrust_env.trust.key_index import Floats, Ints

_DIGITS = 12  # what differs less is equal

CUTS = 9
"""Number of cuts of a log."""

RATERS = (1, 2, 4, 8, 16, 32)
"""Least number of raters in each group of agents."""

COVERED = 0.95
"""Share of later means that intervals are to cover."""

FEWEST = 100
"""Number of later means without which nothing is calibrated."""

MOST = 1_000_000
"""Number of ratings, in a log without rounds, up to which all are used; else raters are drawn."""


class Past(NamedTuple):
    """Trust at a cut.

    Attributes:
        taken: Number of ratings before the cut.
        trust: Trust in each ratee, shape (P,).
    """

    taken: int
    trust: Floats


class Group(UntrustedModel):
    """Agents with about as many raters, and how far their later means were from their estimates."""

    raters: int = Field(ge=1)
    """Least number of raters."""
    low: float = Field(ge=-1, le=1)
    """Lower end of the interval, from the estimate on."""
    high: float = Field(ge=-1, le=1)
    """Upper end of the interval, from the estimate on, not below the lower one."""
    agents: int = Field(ge=0)
    """Number of later means at the later cuts."""
    coverage: float | None = Field(ge=0, le=1)
    """Share of these that the intervals of their time covered; None without any."""


class Calibration(UntrustedModel):
    """What a log's past says about its trust."""

    mean: float = Field(ge=0, le=1)
    """Mean trust, towards which estimates are drawn."""
    weight: float = Field(ge=0)
    """Number of raters by which they are; 0 unless that forecasts better at all later cuts."""
    trust_forecast: float = Field(ge=-1, le=1)
    """Spearman's correlation of trust with later means, the mean over later cuts."""
    estimate_forecast: float = Field(ge=-1, le=1)
    """Spearman's correlation of shrunken trust with later means."""
    coverage: float = Field(ge=0, le=1)
    """Share of later means at the later cuts that intervals covered, by levels of earlier cuts."""
    groups: tuple[Group, ...]
    """Groups by number of raters, ascending, as in `RATERS`."""

    @model_validator(mode="after")
    def _check(self) -> "Calibration":
        if tuple(group.raters for group in self.groups) != RATERS:
            raise ValueError(f"groups must begin with {RATERS} raters")
        if any(group.low > group.high for group in self.groups):
            raise ValueError("an interval ends below its lower end")
        return self

    @property
    def shrinkage(self) -> Shrinkage:
        """How trust is drawn towards its mean."""
        return Shrinkage(self.mean, self.weight)

    def interval(self, estimate: Floats, raters: Ints) -> tuple[Floats, Floats]:
        """Return the ends of the interval of each agent's later mean, each of shape (n,).

        Args:
            estimate: Estimate of each agent, shape (n,).
            raters: Number of its raters, shape (n,), at least 1.
        """
        ends = np.array([(one.low, one.high) for one in self.groups])[_group(raters)]
        low, high = np.clip(estimate[:, None] + ends, 0.0, 1.0).T
        return low, high


def cuts(numbers: Ints) -> Ints:
    """Return the numbers of ratings before the cuts, ascending: at ends of rounds, or anywhere in a
    log with a single round.

    Args:
        numbers: Number of the round of each rating, shape (n,), ascending.
    """
    wanted = len(numbers) * np.arange(1, CUTS + 1) // (CUTS + 1)
    if numbers[-1] > numbers[0]:
        wanted = np.searchsorted(numbers, numbers[wanted])
    found: Ints = np.unique(wanted[wanted > 0])
    return found


def replayed(model: Any, log: Log, seed: int) -> tuple[Log, list[Past]]:
    """Return a log in a single round, and trust at its cuts.

    Without times its order is drawn. Of more than `MOST` ratings, those of drawn raters are taken.

    Raises:
        MemoryError: The model does not fit, see `make_run`.
    """
    rng, some = generator(seed), np.arange(len(log.values))
    if len(some) > MOST:
        some = np.flatnonzero((rng.random(log.shape[0]) < MOST / len(some))[log.raters])
    if log.times is None:
        some = rng.permutation(some)
    log = first(log, some)
    numbers = np.zeros(len(some), np.int64)
    return log, [
        Past(end, played(model, first(log, slice(end)), numbers[:end]).provider_trust)
        for end in cuts(numbers).tolist()
    ]


def first(log: Log, some: Any) -> Log:
    """Return some ratings of a log; its names stay."""
    times = None if log.times is None else log.times[some]
    return log._replace(
        raters=log.raters[some], ratees=log.ratees[some], values=log.values[some], times=times
    )


def calibrated(log: Log, pasts: Sequence[Past], final: Shrinkage) -> Calibration | None:
    """Return what the past of a log says about its trust; None if it has too few later ratings.

    Args:
        log: Log.
        pasts: Trust at its cuts, ascending.
        final: How trust is drawn to its mean at the end, if it is.
    """
    if len(pasts) < 2:
        return None
    seen, end = _Seen.of(log, [past.taken for past in pasts]), len(pasts)
    trust = [past.trust for past in pasts]
    shrunken = [
        Shrinkage.fitted(first(log, slice(past.taken)), past.trust[number > 0]).of(
            past.trust, number
        )
        for past, number in zip(pasts, seen.raters, strict=True)
    ]
    later = range(max(end // 2, 1), end)
    plain, drawn = (seen.forecasts(scores, later) for scores in (trust, shrunken))
    estimates = shrunken if (drawn > plain).all() else trust
    p, group, covered = np.zeros(0), np.zeros(0, np.int64), np.zeros(0, bool)
    for at in later:
        groups, residuals = seen.residuals(estimates, [at], end)
        new = _p_values(seen.residuals(estimates, range(at), at), groups, residuals)
        covered = np.append(covered, new > _levels(group, p)[groups])
        p, group = np.append(p, new), np.append(group, groups)
    if len(p) < FEWEST:
        return None
    levels, known = _levels(group, p), seen.residuals(estimates, range(end), end)
    found = list[Group]()
    for number, least in enumerate(RATERS):
        low, high = _ends(_near(known, number), levels[number])
        own = covered[group == number]
        share = float(own.mean()) if len(own) else None
        found.append(Group(raters=least, low=low, high=high, agents=len(own), coverage=share))
    return Calibration(
        mean=final.mean,
        weight=final.weight if estimates is shrunken else 0.0,
        trust_forecast=float(plain.mean()),
        estimate_forecast=float(drawn.mean()),
        coverage=float(covered.mean()),
        groups=tuple(found),
    )


def _levels(groups: Ints, p: Floats) -> Floats:
    """Return the level of each group: the greatest one, up to 5%, that at least 95% of its p-values
    exceed.
    """
    levels = np.full(len(RATERS), 1 - COVERED)
    for number in range(len(RATERS)):
        near = _near((groups, p), number)
        if len(near):
            wanted = np.nextafter(near[int((1 - COVERED) * len(near))], 0.0)
            levels[number] = min(wanted, 1 - COVERED)
    return levels


class _Seen(NamedTuple):
    """What is known of each ratee at the cuts, and at the end of a log.

    Attributes:
        raters: Number of raters at each cut, shape (cuts, P).
        sums: Sum of the ratings before each cut and before the end, shape (cuts + 1, P).
        counts: Number of these ratings.
    """

    raters: Ints
    sums: Floats
    counts: Floats

    @classmethod
    def of(cls, log: Log, taken: Sequence[int]) -> "_Seen":
        """Return it for cuts after so many ratings."""
        size = log.shape[1]
        _, new = np.unique(pair_keys(log.raters, log.ratees), return_index=True)
        met = np.zeros(len(log.values))
        met[new] = 1.0
        parts = [slice(*ends) for ends in zip([0, *taken], [*taken, len(met)], strict=True)]
        raters, sums, counts = (
            np.cumsum([np.bincount(log.ratees[part], w[part], size) for part in parts], axis=0)
            for w in (met, log.values, np.ones(len(met)))
        )
        return cls(raters[:-1].astype(np.int64), sums, counts)

    def later(self, cut: int, until: int) -> tuple[Ints, Floats]:
        """Return the ratees with ratings before a cut and after it, and the mean of the ratings
        between it and a later one.
        """
        counts = self.counts[until] - self.counts[cut]
        there = np.flatnonzero((self.raters[cut] > 0) & (counts > 0))
        sums = self.sums[until] - self.sums[cut]
        return there, np.round(sums[there] / counts[there], _DIGITS)

    def residuals(
        self, estimates: Sequence[Floats], some: Iterable[int], until: int
    ) -> tuple[Ints, Floats]:
        """Return the groups of ratees, and how far their means between some cuts and a later one
        are above their estimates.
        """
        groups, found = list[Ints](), list[Floats]()
        for cut in some:
            there, means = self.later(cut, until)
            groups.append(_group(self.raters[cut][there]))
            found.append(means - estimates[cut][there])
        return np.concatenate(groups), np.concatenate(found)

    def forecasts(self, scores: Sequence[Floats], some: Sequence[int]) -> Floats:
        """Return Spearman's correlation of scores with later means at each of some cuts; 0 where
        one does not vary.
        """
        found = list[float]()
        for cut in some:
            there, means = self.later(cut, len(scores))
            ranked = correlation(ranks(np.round(scores[cut][there], _DIGITS)), ranks(means))
            found.append(ranked(np.ones(len(there))))
        return np.nan_to_num(found)


def _group(raters: Ints) -> Ints:
    """Return the number of the group of each agent, by its number of raters, at least 1."""
    found: Ints = np.searchsorted(RATERS, raters, side="right") - 1
    return found


def _near(known: tuple[Ints, Floats], group: int) -> Floats:
    """Return the values of a group, ascending, and those of neighbouring groups while there are too
    few.
    """
    groups, values = known
    for far in range(len(RATERS)):
        some = values[np.abs(groups - group) <= far]
        if len(some) >= FEWEST:
            break
    return np.sort(some)


def _ends(residuals: Floats, level: Any) -> tuple[float, float]:
    """Return the ends of the interval that leaves out this share of residuals; -1 and 1 if they are
    too few.
    """
    out = int(level / 2 * (len(residuals) + 1))
    return (float(residuals[out - 1]), float(residuals[-out])) if out else (-1.0, 1.0)


def _p_values(known: tuple[Ints, Floats], groups: Ints, residuals: Floats) -> Floats:
    """Return the highest level at which the interval of known residuals leaves out each other
    residual.
    """
    p = np.ones(len(residuals))
    for group in np.unique(groups).tolist():
        there, near = groups == group, _near(known, group)
        below = np.searchsorted(near, residuals[there], side="right")
        above = len(near) - np.searchsorted(near, residuals[there], side="left")
        p[there] = np.minimum(2 * (np.minimum(below, above) + 1) / (len(near) + 1), 1.0)
    return p
