"""A run of any trust model on a grid of all pairs of raters and providers."""

import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from roletrust_env.shapes import PerPair, Shape
from roletrust_env.trees import leaves, map_leaves
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.model import Peers, start_model
from roletrust_env.trust.model_checks import watched_update
from roletrust_env.trust.ratings import Ratings, merge_repeats
from roletrust_env.trust.stored import restoring, taken, taken_counts
from roletrust_env.trust.trust_run import TrustRun

MEMORY = 2e9
"""Bytes that a state on a grid may take. An update takes some times as much for a moment."""

_SIDES = 11, 13  # numbers of raters and providers of a trial, which no shape has by chance


class GridRun(TrustRun):
    """A run of any model on a grid of all pairs, as in a game; the games of a batch have further
    axes.

    A newcomer has the values of the start. For a model in which the memory of silent agents
    changes, too, that is not what it would have if it had been there all along.

    Attributes:
        state: State of the model, which is not written to.
        peers: Pairs in which rater and provider are one agent, shape (S, P), boolean.
    """

    def __init__(self, model: Any, like: PerPair, peers: Peers, *, one_role: bool = True) -> None:
        """Start with all agents.

        Args:
            model: Trust model.
            like: Array of shape (S, P, ...) that shows shapes, dtype and array library.
            peers: Pairs that are one agent.
            one_role: Whether raters and providers that join by `play` are different agents.
                Otherwise rater 7 and provider 7 are one agent.
        """
        self.model, self.rounds, self.peers, self._one_role = model, 0, peers, one_role
        self.state = start_model(model, like, peers)

    @property
    def shape(self) -> tuple[int, int]:
        """The number of raters and of providers."""
        raters, providers = self.peers.shape[:2]
        return raters, providers

    @property
    def rater_trust(self) -> Any:
        """The trust of each rater. See `TrustRun.rater_trust`."""
        return self.model.rater_trust(self.state)

    @property
    def provider_trust(self) -> Any:
        """The trust of each provider. See `TrustRun.provider_trust`."""
        return self.model.provider_trust(self.state)

    def play(self, raters: Ints, providers: Ints, values: Floats) -> None:
        """Play one round. See `TrustRun.play`.

        Raises:
            ValueError: The model fails, see `watched_update`.
        """
        self.join(int(raters.max(initial=-1)) + 1, int(providers.max(initial=-1)) + 1)
        raters, providers, values, _ = merge_repeats(
            raters, providers, values, raters * self.shape[1] + providers
        )
        ratings, mask = np.zeros(self.shape), np.zeros(self.shape, bool)
        ratings[raters, providers], mask[raters, providers] = values, True
        self.update(Ratings(ratings, mask))

    def update(self, ratings: Ratings) -> None:
        """Play one round of ratings on the grid.

        Raises:
            ValueError: The model fails, see `watched_update`.
        """
        if all(self.shape):  # without agents there is nothing to compute
            self.state = watched_update(self.model, self.state, ratings, np.asarray(self.rounds))[0]
        self.rounds += 1

    def join(self, raters: int, providers: int, peers: Peers | None = None) -> None:
        """Make room for so many raters and providers. See `TrustRun.join`.

        Args:
            raters: Number of raters.
            providers: Number of providers.
            peers: Pairs that are one agent then, shape (S, P); left out, those that `play` would
                have.

        Raises:
            MemoryError: The state would take more than `MEMORY`. The message says how much.
        """
        shape = max(raters, self.shape[0]), max(providers, self.shape[1])
        if not self._one_role:
            shape = (max(shape),) * 2
        if shape == self.shape:
            return
        check_grid_memory(self.model, shape)
        self.peers = self._pairs(shape) if peers is None else peers
        start = start_model(self.model, np.zeros(shape), self.peers)
        self.state = map_leaves(_grown, self.state, start) if self.rounds else start

    def _pairs(self, shape: tuple[int, int]) -> npt.NDArray[np.bool_]:
        return pairs_of(shape, one_role=self._one_role)

    def save(self) -> dict[str, npt.NDArray[Any]]:
        """Return all that the run keeps, by name. See `TrustRun.save`."""
        state_leaves = (leaf for leaf in leaves(self.state) if leaf is not None)
        leaves_by_name = {f"state_{n}": np.asarray(leaf) for n, leaf in enumerate(state_leaves)}
        return {
            "counts": np.array([*self.shape, self.rounds]),
            "peers": self.peers,
            **leaves_by_name,
        }

    def load(self, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from what another run has kept. See `TrustRun.load`."""
        left = dict(arrays)
        *shape, rounds = taken_counts(left)
        peers = taken(left, "peers", bool, tuple(shape))
        check_grid_memory(self.model, peers.shape)
        if not np.array_equal(
            peers, self.peers if peers.shape == self.shape else self._pairs(peers.shape)
        ):
            raise ValueError("other pairs are one agent")
        state = map_leaves(restoring(left), start_model(self.model, np.zeros(peers.shape), peers))
        self.state, self.peers, self.rounds = state, peers, rounds
        self._check_loaded(state, left)


def pairs_of(
    shape: tuple[int, int], *, one_role: bool
) -> Annotated[npt.NDArray[np.bool_], Shape("S P", "bool")]:
    """Return the pairs that are one agent, shape (S, P): none, or those of equal places."""
    return np.zeros(shape, bool) if one_role else np.eye(*shape, dtype=bool)


def check_grid_memory(model: Any, shape: tuple[int, int]) -> None:
    """Refuse a state on a grid of so many raters and providers that would take more than `MEMORY`.

    Raises:
        MemoryError: It would. The message says how much.
    """
    sizes = dict(zip(_SIDES, shape, strict=True))
    arrays = (leaf for leaf in leaves(_trial(model)) if isinstance(leaf, np.ndarray))
    needed = sum(leaf.itemsize * math.prod(sizes.get(n, n) for n in leaf.shape) for leaf in arrays)
    if needed > MEMORY:
        raise MemoryError(
            f"trust model {model!r} keeps numbers for pairs of agents: with {shape[0]:,} raters "
            f"and {shape[1]:,} "
            f"ratees its state would take {needed / 1e9:,.1f} GB, and {MEMORY / 1e9:.0f} GB are "
            "allowed; central "
            "models keep what the ratings take"
        )


def _trial(model: Any) -> Any:
    """Return a small state, whose shapes show which axes of a state are about raters and which
    about providers.
    """
    return start_model(model, np.zeros(_SIDES), np.zeros(_SIDES, bool))


def _grown(old: Any, new: Any) -> Any:
    """Return the array of a larger start with the values that were there before."""
    if not (
        isinstance(old, np.ndarray) and isinstance(new, np.ndarray) and old.ndim == new.ndim > 0
    ):
        return old
    grown = new.astype(old.dtype)
    grown[tuple(slice(size) for size in old.shape)] = old
    return grown
