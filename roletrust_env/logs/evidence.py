"""Evidence of trust: on how many ratings, by how many independent agents and from which time each
score rests.
"""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.logs.names import NameList
from roletrust_env.trust.edges import check_keys, pair_ends, pair_keys
from roletrust_env.trust.key_index import Floats, Ints, KeyIndex
from roletrust_env.trust.stored import taken

_NEVER = -(2**63)
"""Time of an agent without ratings, NumPy's NaT."""

_MANY = 2**32
"""More ratings of a pair than a file of a stream can hold."""

_DATES = 10**17
"""Nanoseconds from which on times are shown as dates: those of 1973."""


Role = Literal["ratee", "rater"]
"""Role of agents: those that are rated, the providers, or those that rate."""


class Evidence(NamedTuple):
    """Trust in the agents of one role, and what it rests on; all arrays have shape (n,).

    Attributes:
        names: Names of the agents.
        trust: Trust, in [0, 1].
        ratings: Number of ratings.
        agents: Number of agents of the other role in these ratings: the raters of a provider.
        independent: Effective number of these, see `effective_number`.
        last: Time of the last rating, dates of NumPy in nanoseconds; NaT without times or ratings.
    """

    names: NameList
    trust: Floats
    ratings: Ints
    agents: Ints
    independent: Floats
    last: npt.NDArray[np.datetime64]

    def ranked(self, score: Floats | None = None) -> Ints:
        """Return the places of the agents with the best first, shape (n,).

        Of equals, those with the higher trust come first, then those with more ratings, then the
        first by name.

        Args:
            score: What they are ranked by, shape (n,); None for trust.
        """
        import pyarrow as arrow
        from pyarrow import compute

        first = self.trust if score is None else score
        columns = {"score": first, "trust": self.trust, "ratings": self.ratings}
        keys = [*((name, "descending") for name in columns), ("names", "ascending")]
        order = compute.sort_indices(arrow.table({**columns, "names": self.names.column}), keys)
        places: Ints = order.to_numpy().astype(np.int64)
        return places


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

    def evidence(self, role: Role, names: Sequence[Any], trust: Floats) -> Evidence:
        """Return trust with its evidence for the agents of a role that have ratings.

        Args:
            role: Role of the agents.
            names: Their names, by place.
            trust: Trust in them, by place.
        """
        size = len(self._index)
        ends, counts = pair_ends(self._index.keys)[role == "ratee"], self._counts[:size]
        last = np.full(len(names), _NEVER)
        np.maximum.at(last, ends, self._last[:size])
        ratings = np.bincount(ends, counts, len(names)).astype(np.int64)
        agents = np.bincount(ends, minlength=len(names))
        independent = effective_number(ends, counts, len(names))
        known, dates = np.flatnonzero(ratings), last.view("datetime64[ns]")
        return Evidence(
            NameList.of(names).at(known),
            trust[known],
            ratings[known],
            agents[known],
            independent[known],
            dates[known],
        )

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
        if (
            not ((counts > 0) & (counts < _MANY)).all()
            or not (last <= (_NEVER if latest is None else latest)).all()
        ):
            raise ValueError("a pair that met has no rating, or one after the latest")
        self._index, self._counts, self._last = KeyIndex.of(keys), counts, last


def effective_number(ends: Ints, counts: Ints, size: int) -> Floats:
    """Return the effective number of raters of each provider, shape (size,).

        n = (sum over raters i of c[i])^2 / sum over i of c[i]^2

    where c[i] is the number of ratings by rater i: the inverse of Simpson's index of their shares
    (Simpson, "Measurement of Diversity", 1949), and Kish's effective size of a sample. It is the
    number of raters where all have rated equally often, near 1 where one of them has given nearly
    all ratings, and 0 without ratings. Raters that act together count one by one.

    Example:
        >>> effective_number(np.array([0, 0, 1]), np.array([5, 5, 200]), 2).tolist()
        [2.0, 1.0]

    Args:
        ends: Provider of each pair of rater and provider, shape (k,).
        counts: Number of ratings of each pair, shape (k,), at least 1.
        size: Number of providers.
    """
    total, squares = (
        np.bincount(ends, weights, size) for weights in (counts, counts * 1.0 * counts)
    )
    return total**2 / np.maximum(squares, 1.0)


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
