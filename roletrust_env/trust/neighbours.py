"""What a round of few ratings touches among many pairs, and the median of all providers while few
of them change.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from roletrust_env.shapes import Shape
from roletrust_env.trust.key_index import Floats, Ints

_SHARE = 4  # one pair in so many is too many to be told apart from all
_LINKS = (
    200  # pairs for each link of a chain that is followed, since all pairs take about as long then
)
_PAIR_BITS = 31
_WIDTH = 1000  # places on either side of the median whose values are at hand


class PairChains:
    """The known pairs of each agent of one role, as chains: the newest, the one before it, and so
    on.

    Example:
        >>> chains = PairChains()
        >>> chains.extend(np.array([0, 2, 0]), 3)
        >>> chains.of(np.array([1, 2]), 4)
        array([1])
    """

    def __init__(self) -> None:
        self._newest: Ints = np.zeros(0, np.int64)
        self._before: Ints = np.zeros(0, np.int64)
        self._turns: Ints = np.zeros(0, np.int64)  # a number for each agent, for a moment
        self._count = 0

    def __len__(self) -> int:
        """Return the number of pairs."""
        return self._count

    def extend(self, agents: Annotated[Ints, Shape("n", "whole")], size: int) -> None:
        """Add pairs.

        Args:
            agents: Place of the agent of each further pair, shape (n,).
            size: Number of agents.
        """
        self._newest = _longer(self._newest, size)
        self._before = _longer(self._before, self._count + len(agents))
        keys = np.sort((agents << _PAIR_BITS) | np.arange(self._count, self._count + len(agents)))
        ordered, pairs = keys >> _PAIR_BITS, keys & ((1 << _PAIR_BITS) - 1)
        again = (ordered[1:] == ordered[:-1]).nonzero()[0]
        before = self._newest.take(ordered)
        before[again + 1] = pairs.take(again)
        self._before[pairs] = before
        self._newest[ordered] = pairs  # the last assignment to an agent stays
        self._count += len(agents)

    def of(self, agents: Ints, most: int) -> Ints | None:
        """Return the pairs of some agents in any order, each once; None if there are more, or too
        long chains.

        Args:
            agents: Places of agents, which may repeat.
            most: Number of pairs up to which the chains are followed.
        """
        self._turns, turns = _longer(self._turns, len(self._newest)), np.arange(len(agents))
        self._turns[agents] = turns
        at = self._newest.take(
            agents.compress(self._turns.take(agents) == turns)
        )  # every agent once
        parts, n_pairs = list[Ints](), 0
        for _ in range(2 + self._count // _LINKS):
            at = at.compress(at >= 0)
            n_pairs += len(at)
            if n_pairs > most:
                return None
            if not len(at):
                return np.concatenate(parts) if parts else at
            parts.append(at)
            at = self._before.take(at)
        return None


class LowerMedian:
    """The upper median of the providers' values, at most 0, while few of them change.

    It counts the values below a window around the median, and keeps those in the window at hand.

    Attributes:
        value: The median at the last call of `put`; 0 of fewer than two values.
    """

    def __init__(self) -> None:
        self.value = 0.0
        self._values: Floats = np.zeros(0)  # infinity where a provider has none
        self._low, self._high = math.inf, math.inf
        self._inside = np.zeros(
            0, np.int64
        )  # places of the values in the window, from `low` to below `high`
        self._count = self._negative = self._below = self._room = 0

    def put(self, places: Ints, size: int, values: Floats, present: npt.NDArray[np.bool_]) -> float:
        """Take the values of some providers, and return the median over all.

        Args:
            places: Places of these providers, each once.
            size: Number of providers.
            values: Their values, finite.
            present: Whether each has a value.
        """
        self._values = _longer(self._values, size, math.inf)
        new, old = np.where(present, values, math.inf), self._values.take(places)
        self._values[places] = new
        self._count += _more(new < math.inf, old < math.inf)
        self._negative += _more(new < 0, old < 0)
        self._below += _more(new < self._low, old < self._low)
        entered = places.compress(self._in_window(new) & ~self._in_window(old))
        inside = np.concatenate([self._inside, entered])
        self._inside = inside.compress(self._in_window(self._values.take(inside)))
        rank = self._count // 2
        if self._count < 2 or self._negative <= rank:
            self.value = 0.0
            return self.value
        if not 0 <= rank - self._below < len(self._inside) <= self._room:
            self._open_window(rank)
        at = rank - self._below
        self.value = float(np.partition(self._values.take(self._inside), at)[at])
        return self.value

    def _in_window(self, values: Floats) -> npt.NDArray[np.bool_]:
        return (values >= self._low) & (values < self._high)

    def _open_window(self, rank: int) -> None:
        """Lay the window around a rank."""
        ends = max(rank - _WIDTH, 0), min(rank + _WIDTH, self._count - 1)
        ordered = np.partition(self._values, ends)
        self._low, self._high = ordered[ends[0]], np.nextafter(ordered[ends[1]], math.inf)
        self._below = int((self._values < self._low).sum())
        self._inside = np.flatnonzero(self._in_window(self._values))
        self._room = 2 * len(self._inside) + _WIDTH  # many values may be equal


class Neighbourhood:
    """Facts on all pairs and providers for a model that is `nearby`.

    Attributes:
        median: Median of the providers.
        known: Whether the median knows all providers.
        stale: Whether the trust of providers is that of an earlier median.
    """

    def __init__(self) -> None:
        self.median, self.known, self.stale = LowerMedian(), False, False
        self._given, self._received, self._providers = PairChains(), PairChains(), 0

    def pairs(
        self,
        raters: Ints,
        ends: Callable[[Ints | slice], tuple[Ints, Ints]],
        size: int,
        shape: tuple[int, int],
    ) -> Ints | None:
        """Return all pairs of all providers that some raters ever rated, in their order; None if
        these are too many.

        Args:
            raters: Places of raters, which may repeat.
            ends: Function from pairs to their raters and providers.
            size: Number of pairs.
            shape: Number of raters and of providers.
        """
        if not self.known or not len(raters):
            return None
        new = ends(slice(len(self._given), size))
        self._given.extend(new[0], shape[0])
        self._received.extend(new[1], shape[1])
        given = self._given.of(raters, size // _SHARE)
        if given is None:
            return None
        pairs = self._received.of(ends(given)[1], size // _SHARE)
        return None if pairs is None else np.sort(pairs)

    def all_providers(self, size: int) -> Callable[[Floats, npt.NDArray[np.bool_]], float]:
        """Return `lower_median` for a round that updates all providers, of which there are so
        many.
        """
        self.known, self.stale, self._providers = True, False, size
        return partial(self.median.put, np.arange(size), size)

    def follow(self, before: float, providers: int) -> None:
        """Note after a round whether the median is another than before, or newcomers without
        ratings do not know it.
        """
        newcomers, self._providers = providers > self._providers, providers
        self.stale |= self.median.value != before or (newcomers and before != 0)


def _more(after: npt.NDArray[np.bool_], before: npt.NDArray[np.bool_]) -> int:
    return int(np.count_nonzero(after)) - int(np.count_nonzero(before))


def _longer(array: npt.NDArray[Any], size: int, missing: float = -1) -> npt.NDArray[Any]:
    """Return an array of at least so many entries, with room to grow."""
    if size <= len(array):
        return array
    longer = np.full(max(size, 2 * len(array)), missing, array.dtype)
    longer[: len(array)] = array
    return longer
