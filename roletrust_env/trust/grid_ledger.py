"""Rounds of edges played on a grid, for models that keep a number for each pair of agents."""

import math
from typing import Any, Protocol

import numpy as np

from roletrust_env.trees import leaves
from roletrust_env.trust.edge_state import runs_on_edges
from roletrust_env.trust.key_index import Ints
from roletrust_env.trust.ledger import Floats, Ledger
from roletrust_env.trust.model import start_model
from roletrust_env.trust.ratings import Ratings, merge_repeats

MEMORY = 2e9
"""Bytes that a state on a grid may take. An update takes some times as much for a moment."""

_SIDES = 11, 13  # numbers of raters and providers of a trial, which no shape has by chance


class AnyLedger(Protocol):
    """Trust of raters and providers, round by round, wherever a model keeps it: see `Ledger`."""

    @property
    def rounds(self) -> int:
        """The number of rounds so far."""

    @property
    def rater_trust(self) -> Floats:
        """The trust of each rater, shape (S,), in [0, 1]."""

    @property
    def provider_trust(self) -> Floats:
        """The trust of each provider, shape (P,), in [0, 1]."""

    def play(self, raters: Ints, providers: Ints, values: Floats) -> None:
        """Play one round."""

    def skip(self, rounds: int) -> None:
        """Play so many rounds without ratings."""


class GridLedger:
    """Trust of a fixed number of raters and providers on a grid, round by round; otherwise as `Ledger`.

    Attributes:
        model: Trust model of any kind.
        rounds: Number of rounds so far.
        shape: Number of raters and of providers.
    """

    def __init__(self, model: Any, shape: tuple[int, int], *, one_role: bool = True) -> None:
        """Start with all agents.

        Raises:
            MemoryError: The state would take more than `MEMORY`. The message says how much.
        """
        self.model, self.rounds, self.shape = model, 0, shape
        needed = state_bytes(model, shape)
        if needed > MEMORY:
            raise MemoryError(
                f"trust model {model!r} keeps numbers for pairs of agents: with {shape[0]:,} raters and {shape[1]:,} "
                f"ratees its state would take {needed / 1e9:,.1f} GB, and {MEMORY / 1e9:.0f} GB are allowed; central "
                "models keep what the ratings take"
            )
        self._peers = np.zeros(shape, bool) if one_role else np.eye(*shape, dtype=bool)
        self._state = start_model(model, np.zeros(shape), self._peers)

    @property
    def rater_trust(self) -> Floats:
        """The trust of each rater, shape (S,), in [0, 1]."""
        return np.array(self.model.rater_trust(self._state))

    @property
    def provider_trust(self) -> Floats:
        """The trust of each provider, shape (P,), in [0, 1]."""
        return np.array(self.model.provider_trust(self._state))

    def play(self, raters: Ints, providers: Ints, values: Floats) -> None:
        """Play one round. See `Ledger.play`."""
        pair = raters * self.shape[1] + providers
        raters, providers, values, _ = merge_repeats(raters, providers, values, pair)
        ratings, mask = np.zeros(self.shape), np.zeros(self.shape, bool)
        ratings[raters, providers], mask[raters, providers] = values, True
        self._state = self.model.update(self._state, Ratings(ratings, mask))
        self.rounds += 1

    def skip(self, rounds: int) -> None:
        """Play so many rounds without ratings. See `Ledger.skip`."""
        nobody = np.zeros(0, np.int64)
        for _ in range(rounds):
            self.play(nobody, nobody, np.zeros(0))


def make_ledger(model: Any, shape: tuple[int, int], *, one_role: bool = True) -> AnyLedger:
    """Return a ledger with so many raters and providers: on edges if the model runs there, otherwise on a grid.

    A model of another kind may bring a ledger of its own: a method `ledger(shape)`.

    Raises:
        MemoryError: The state on a grid would be too large, see `GridLedger`.
    """
    if hasattr(model, "ledger"):
        own: AnyLedger = model.ledger(shape)
        return own
    if not runs_on_edges(model):
        return GridLedger(model, shape, one_role=one_role)
    ledger = Ledger(model, one_role=one_role)
    ledger.join(*shape)
    return ledger


def state_bytes(model: Any, shape: tuple[int, int]) -> float:
    """Return the bytes of a model's state with so many raters and providers, from the shapes of a small state."""
    state = start_model(model, np.zeros(_SIDES), np.zeros(_SIDES, bool))
    sizes = dict(zip(_SIDES, shape, strict=True))
    found = (leaf for leaf in leaves(state) if isinstance(leaf, np.ndarray))
    return float(sum(leaf.itemsize * math.prod(sizes.get(n, n) for n in leaf.shape) for leaf in found))
