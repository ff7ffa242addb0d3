"""Evidence of trust: on how many ratings, by how many independent agents and from which time each score rests."""

from collections.abc import Iterable, Mapping
from statistics import NormalDist
from typing import Any, Literal, NamedTuple

import numpy as np

from roletrust_env.data.log import RatingLog
from roletrust_env.data.units import find_unit
from roletrust_env.trust.edges import pair_ends, pair_keys
from roletrust_env.trust.key_index import Floats, Ints

_Z = NormalDist().inv_cdf(0.975)


Role = Literal["ratee", "rater"]
"""Role of agents: those that are rated, the providers, or those that rate."""

Rank = Literal["low", "trust"]
"""What agents are ranked by: the lower end of the interval of trust, or trust."""


class Evidence(NamedTuple):
    """Trust in the agents of one role, and what it rests on; all arrays have shape (n,).

    Attributes:
        names: Names of the agents.
        trust: Trust, in [0, 1].
        low: Lower end of the interval of trust, see `wilson_interval`; NaN where earlier ratings are not known.
        high: Upper end.
        ratings: Number of ratings in the log.
        agents: Number of agents of the other role in these ratings: the raters of a provider.
        independent: Effective number of these, see `effective_number`.
        last: Time of the last rating; NaN without times or ratings.
    """

    names: list[str]
    trust: Floats
    low: Floats
    high: Floats
    ratings: Ints
    agents: Ints
    independent: Floats
    last: Floats

    def at(self, places: Any) -> "Evidence":
        """Return the agents at some places."""
        names = [self.names[place] for place in np.asarray(places).tolist()]
        return Evidence(names, *(column[places] for column in self[1:]))

    def ranked(self, by: Rank = "low") -> "Evidence":
        """Return the agents with the best first; of equals, those with the higher trust, and with more ratings."""
        return self.at(np.lexsort((-self.ratings, -self.trust, -(self.low if by == "low" else self.trust))))

    def table(self, role: Role, origin: Mapping[str, str]) -> Any:
        """Return the columns as a table of pyarrow, with those of a role and of an origin, which are the same for all.

        Times since 1970 are dates. The agents of the other role are `raters` or `ratees`.

        Args:
            role: Role of the agents.
            origin: Texts by column, such as the model.
        """
        import pyarrow as arrow

        columns: dict[str, Any] = {}
        for name, values in self._replace(last=as_dates(self.last))._asdict().items():
            named = {"names": "name", "agents": "raters" if role == "ratee" else "ratees"}.get(name, name)
            columns[named] = arrow.array(values, from_pandas=True)
        same = np.zeros(len(self.names), np.int32)
        for name, text in {"role": role, **origin}.items():
            columns[name] = arrow.DictionaryArray.from_arrays(same, arrow.array([text], arrow.string()))
        return arrow.table(columns)


def evidence(log: RatingLog, role: Role, trust: Mapping[Any, float], *, by_name: bool = False) -> Evidence:
    """Return trust with its evidence in a log, for the agents that have ratings there.

    Args:
        log: Log.
        role: Role of the agents.
        trust: Trust by the place of an agent among the names of the log.
        by_name: Whether trust is by name, and rests on earlier ratings, too. Then all who have trust are returned, and
            intervals are unknown.
    """
    own, others = (log.ratees, log.raters) if role == "ratee" else (log.raters, log.ratees)
    names = log.ratee_names if role == "ratee" else log.rater_names
    if by_name:
        known = {name: place for place, name in enumerate(trust)}
        own, names = np.array([known.get(name, len(known)) for name in names], np.int64)[own], list(trust)
    size = len(names)
    ratings = np.bincount(own, minlength=size)[:size]
    keys, counts = np.unique(pair_keys(own, others), return_counts=True)
    ends = pair_ends(keys)[0]
    agents = np.bincount(ends, minlength=size)[:size]
    independent = effective_number(ends, counts, max(size, int(ends.max(initial=-1)) + 1))[:size]
    values = np.fromiter(trust.values(), np.float64, len(trust))
    low, high = wilson_interval(values, independent) if not by_name else np.full((2, size), np.nan)
    last = np.full(max(size, int(own.max(initial=-1)) + 1), np.nan)
    if log.times is not None:
        last[own] = log.times  # ascending, so the last one stays
    found = Evidence(names, values, low, high, ratings, agents, independent, last[:size])
    return found if by_name else found.at(np.flatnonzero(ratings))


def effective_number(groups: Ints, counts: Ints, size: int) -> Floats:
    """Return the effective number of raters in each of so many groups, from the number of ratings of each rater.

        n = (sum over raters i of c[i])^2 / sum over i of c[i]^2

    where c[i] is the number of ratings of rater i in the group: the inverse of Simpson's index of their shares
    (Simpson, "Measurement of Diversity", 1949), and Kish's effective size of a sample. It is the number of raters where
    all have rated equally often, near 1 where one of them has given nearly all ratings, and 0 without ratings. Raters
    that act together count one by one.

    Example:
        >>> effective_number(np.array([0, 0, 1, 1]), np.array([5, 5, 200, 1]), 2).round(2).tolist()
        [2.0, 1.01]

    Args:
        groups: Group of each rater, such as the provider that it rates, shape (n,).
        counts: Number of its ratings there, shape (n,).
        size: Number of groups.
    """
    total = np.bincount(groups, counts, size)
    squares = np.bincount(groups, counts.astype(np.float64) ** 2, size)
    return total**2 / np.maximum(squares, 1.0)


def wilson_interval(trust: Floats, number: Floats) -> tuple[Floats, Floats]:
    """Return the ends of Wilson's 95% interval for trust as the mean of so many independent raters.

        low, high = (p + z^2 / 2n -+ z root(p (1 - p) / n + z^2 / 4n^2)) / (1 + z^2 / n),   z = 1.96

    Wilson, "Probable Inference, the Law of Succession, and Statistical Inference" (1927). It takes p (1 - p) for the
    variance of a rating. No values in [0, 1] with the mean p have more, so where raters agree the interval is wider
    than need be: an approximation on the safe side. A bootstrap over raters has no width for an agent with one rater.
    Without raters the interval is from 0 to 1. For raters the ratees count, as if trust were the mean of a comparison
    with each.

    Example:
        >>> [end.round(3).tolist() for end in wilson_interval(np.array([0.9, 0.9]), np.array([1.0, 100.0]))]
        [[0.168, 0.826], [0.998, 0.945]]

    Args:
        trust: Trust p, shape (n,), in [0, 1].
        number: Effective number n of raters, shape (n,), at least 0.
    """
    square = _Z**2
    middle = (trust * number + square / 2) / (number + square)
    half = _Z * np.sqrt(trust * (1 - trust) * number + square / 4) / (number + square)
    return np.clip(middle - half, 0.0, 1.0), np.clip(middle + half, 0.0, 1.0)


def joined(tables: Iterable[Any]) -> Any:
    """Return tables of both roles as one; counts of agents of the own role are missing."""
    import pyarrow as arrow

    return arrow.concat_tables(tables, promote_options="default").unify_dictionaries()


def window(log: RatingLog) -> dict[str, str]:
    """Return the times of the first and of the last rating as texts, by `since` and `until`; nothing without times."""
    if log.times is None:
        return {}
    return dict(zip(("since", "until"), map(str, as_dates(log.times[[0, -1]]).tolist()), strict=True))


def as_dates(times: Floats) -> Any:
    """Return times as dates of NumPy to the second if they are seconds since 1970 by their size, else as they are."""
    known = times[~np.isnan(times)]
    return times.astype("datetime64[s]") if len(known) and find_unit(known) == "s" else times
