"""Evidence of trust: on how many ratings, by how many independent agents and from which time each
score rests.
"""

from collections.abc import Iterable, Mapping, Sequence
from statistics import NormalDist
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.logs.log import Log, Pairs
from roletrust_env.logs.names import NameList
from roletrust_env.trust.edges import check_keys, pair_ends, pair_keys, pairs_left
from roletrust_env.trust.key_index import Floats, Ints, KeyIndex
from roletrust_env.trust.stored import taken

_Z = NormalDist().inv_cdf(0.975)

_NEVER = -(2**63)
"""Time of an agent without ratings, NumPy's NaT."""

_DATES = 10**17
"""Nanoseconds from which on times are shown as dates: those of 1973."""


Role = Literal["ratee", "rater"]
"""Role of agents: those that are rated, the providers, or those that rate."""

Rank = Literal["low", "trust"]
"""What agents are ranked by: the lower end of the interval of trust, or trust."""


class Evidence(NamedTuple):
    """Trust in the agents of one role, and what it rests on; all arrays have shape (n,).

    Attributes:
        names: Names of the agents.
        trust: Trust, in [0, 1].
        low: Lower end of the interval of trust, see `wilson_interval`.
        high: Upper end.
        ratings: Number of ratings.
        agents: Number of agents of the other role in these ratings: the raters of a provider.
        independent: Effective number of these, see `effective_number`.
        last: Time of the last rating, dates of NumPy in nanoseconds; NaT without times or ratings.
    """

    names: NameList
    trust: Floats
    low: Floats
    high: Floats
    ratings: Ints
    agents: Ints
    independent: Floats
    last: npt.NDArray[np.datetime64]

    def at(self, places: Any) -> "Evidence":
        """Return the agents at some places."""
        return Evidence(self.names.at(places), *(column[places] for column in self[1:]))

    def ranked(self, by: Rank = "low") -> "Evidence":
        """Return the agents with the best first.

        Of equals, those with the higher trust come first, then those with more ratings, then the
        first by name.
        """
        import pyarrow as arrow
        from pyarrow import compute

        columns = {name: getattr(self, name) for name in (by, "trust", "ratings")}
        keys = [*((name, "descending") for name in columns), ("names", "ascending")]
        order = compute.sort_indices(arrow.table({**columns, "names": self.names.column}), keys)
        return self.at(order.to_numpy())

    def table(self, role: Role, origin: Mapping[str, str]) -> Any:
        """Return the columns as a table of pyarrow, with those of a role and of an origin, which
        are the same for all.

        Times since 1970 are dates. The agents of the other role are `raters` or `ratees`.

        Args:
            role: Role of the agents.
            origin: Texts by column, such as the model.
        """
        import pyarrow as arrow

        columns: dict[str, Any] = {}
        for name, values in self._replace(last=as_dates(self.last))._asdict().items():
            named = {"names": "name", "agents": "raters" if role == "ratee" else "ratees"}.get(
                name, name
            )
            columns[named] = arrow.array(values, from_pandas=True)
        same = np.zeros(len(self.names), np.int32)
        for name, text in {"role": role, **origin}.items():
            columns[name] = arrow.DictionaryArray.from_arrays(
                same, arrow.array([text], arrow.string())
            )
        return arrow.table(columns)


class PairCounts:
    """The ratings of each pair that met, as they arrive: their number, and the time of the last
    one.
    """

    def __init__(self) -> None:
        self._index = KeyIndex()
        self._counts: Ints = np.zeros(0, np.int64)
        self._last: Ints = np.zeros(0, np.int64)

    def add(self, raters: Ints, providers: Ints, times: Ints | None) -> None:
        """Take ratings, by the places of their agents; without times the last one is unknown."""
        slots = self._index.places(pair_keys(raters, providers))
        if len(self._index) > len(self._counts):
            more = max(len(self._index) - len(self._counts), len(self._counts))
            self._counts = np.append(self._counts, np.zeros(more, np.int64))
            self._last = np.append(self._last, np.full(more, _NEVER))
        np.add.at(self._counts, slots, 1)
        if times is not None:
            np.maximum.at(self._last, slots, times)

    def keep(self, raters: npt.NDArray[np.bool_], providers: npt.NDArray[np.bool_]) -> None:
        """Keep the pairs of agents that stay, of which there is a flag for each place; those after
        them move up.
        """
        left, keys = pairs_left(self._index.keys, (raters, providers))
        self._index, self._counts, self._last = (
            KeyIndex.of(keys),
            self._counts[left],
            self._last[left],
        )

    def evidence(self, role: Role, names: list[Any], trust: Floats) -> Evidence:
        """Return trust with its evidence for the agents of a role, by place."""
        size = len(self._index)
        ends, counts = pair_ends(self._index.keys)[role == "ratee"], self._counts[:size]
        last = np.full(len(names), _NEVER)
        np.maximum.at(last, ends, self._last[:size])
        ratings = np.bincount(ends, counts, len(names)).astype(np.int64)
        return _of_pairs(names, trust, ratings, ends, counts, last)

    def save(self) -> dict[str, npt.NDArray[Any]]:
        """Return all that is kept, by name, for `load`."""
        size = len(self._index)
        return {
            "met": self._index.keys,
            "met_counts": self._counts[:size],
            "met_last": self._last[:size],
        }

    def load(
        self, arrays: dict[str, npt.NDArray[Any]], shape: tuple[int, int], latest: int | None
    ) -> None:
        """Take from arrays what `save` has returned.

        Args:
            arrays: Arrays by name.
            shape: Number of raters and of providers.
            latest: Time of the latest rating; None if ratings have no times.

        Raises:
            ValueError: It does not fit together, or is not what can be counted with these agents
                and times.
        """
        keys = taken(arrays, "met", np.int64, (None,))
        counts = taken(arrays, "met_counts", np.int64, keys.shape)
        last = taken(arrays, "met_last", np.int64, keys.shape)
        check_keys(keys, shape)
        if not (counts > 0).all() or not (last <= (_NEVER if latest is None else latest)).all():
            raise ValueError("a pair that met has no rating, or one after the latest")
        self._index, self._counts, self._last = KeyIndex.of(keys), counts, last


def evidence(log: Log, role: Role, trust: Floats, pairs: Pairs) -> Evidence:
    """Return trust with its evidence in a log, for the agents of a role that have ratings there.

    Args:
        log: Log.
        role: Role of the agents.
        trust: Trust by the place of an agent among the names of the log, shape (n,).
        pairs: Pairs of the log, see `Log.pairs`.
    """
    side = int(role == "ratee")
    own, names = (log.raters, log.ratees)[side], (log.rater_names, log.ratee_names)[side]
    last = np.full(len(names), _NEVER)
    if log.times is not None:
        last[own] = log.times  # ascending, so the last one stays
    ratings = np.bincount(own, minlength=len(names))
    return _of_pairs(names, trust, ratings, pair_ends(pairs.repeated)[side], pairs.counts, last)


def _of_pairs(
    names: Sequence[Any], trust: Floats, ratings: Ints, ends: Ints, counts: Ints, last: Ints
) -> Evidence:
    """Return the evidence of agents with ratings, from the agent and the number of ratings of pairs
    with several.
    """
    import pyarrow as arrow

    agents = ratings - np.bincount(ends, counts - 1, len(names)).astype(np.int64)
    independent = effective_number(ratings, ends, counts)
    interval = wilson_interval(trust, agents)
    dates = last.view("datetime64[ns]")
    found = Evidence(
        NameList(arrow.array(names)), trust, *interval, ratings, agents, independent, dates
    )
    return found.at(np.flatnonzero(ratings))


def effective_number(ratings: Ints, ends: Ints, counts: Ints) -> Floats:
    """Return the effective number of raters of each provider, from its pairs that have several
    ratings.

        n = (sum over raters i of c[i])^2 / sum over i of c[i]^2

    where c[i] is the number of ratings by rater i: the inverse of Simpson's index of their shares
    (Simpson, "Measurement of Diversity", 1949), and Kish's effective size of a sample. It is the
    number of raters where all have rated equally often, near 1 where one of them has given nearly
    all ratings, and 0 without ratings. Raters that act together count one by one.

    Example:
        >>> effective_number(np.array([10, 201]), np.array([0, 0, 1]), np.array([5, 5, 200])).round(2).tolist()
        [2.0, 1.01]

    Args:
        ratings: Number of ratings of each provider, shape (n,).
        ends: Provider of each pair, shape (k,); of pairs with one rating all or none are given.
        counts: Number of ratings of each pair, shape (k,).
    """  # noqa: E501
    total = ratings.astype(np.float64)
    squares = total + np.bincount(ends, counts * (counts - 1.0), len(total))
    return total**2 / np.maximum(squares, 1.0)


def wilson_interval(trust: Floats, number: Floats | Ints) -> tuple[Floats, Floats]:
    """Return the ends of Wilson's 95% interval for trust as the mean of so many raters.

        low, high = (p + z^2 / 2n -+ z root(p (1 - p) / n + z^2 / 4n^2)) / (1 + z^2 / n),   z = 1.96

    Wilson, "Probable Inference, the Law of Succession, and Statistical Inference" (1927). It takes
    p (1 - p) for the variance of a rating. No values in [0, 1] with the mean p have more, so where
    raters agree the interval is wider than need be: an approximation on the safe side. A bootstrap
    over raters has no width for an agent with one rater. Without raters the interval is from 0 to
    1. For raters the ratees count, as if trust were the mean of a comparison with each.

    Each rater counts once, however often it repeats itself. With `effective_number` one account
    could lower the rank of an agent by repeating what others say; a number that no repeats lower
    cannot be below that of the raters.

    Example:
        >>> [end.round(3).tolist() for end in wilson_interval(np.array([0.9, 0.9]), np.array([1.0, 100.0]))]
        [[0.168, 0.826], [0.998, 0.945]]

    Args:
        trust: Trust p, shape (n,), in [0, 1].
        number: Number n of raters, shape (n,), at least 0.
    """  # noqa: E501
    square = _Z**2
    middle = (trust * number + square / 2) / (number + square)
    half = _Z * np.sqrt(trust * (1 - trust) * number + square / 4) / (number + square)
    return np.clip(middle - half, 0.0, 1.0), np.clip(middle + half, 0.0, 1.0)


def joined(tables: Iterable[Any]) -> Any:
    """Return tables of both roles as one; counts of agents of the own role are missing."""
    import pyarrow as arrow

    return arrow.concat_tables(tables, promote_options="default").unify_dictionaries()


def window(times: Ints | None) -> dict[str, str]:
    """Return the first and the last of ascending times as texts, by `since` and `until`; nothing
    without times.
    """
    if times is None:
        return {}
    ends = as_dates(times[[0, -1]].view("datetime64[ns]")).tolist()
    return dict(zip(("since", "until"), map(str, ends), strict=True))


def as_dates(times: npt.NDArray[np.datetime64]) -> Any:
    """Return times as dates of NumPy to the second, or as seconds where none is after 1973: then
    they are not dates.
    """
    known = times[~np.isnat(times)]
    if len(known) and int(known.view(np.int64).max()) >= _DATES:
        return times.astype("datetime64[s]")
    return np.where(np.isnat(times), np.nan, times.view(np.int64) / 1e9)
