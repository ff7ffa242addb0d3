"""Random numbers, drawn outside the pure core and handed to it."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from roletrust_env import counter_rng
from roletrust_env.arrays import Array, namespace

Dealt = TypeVar("Dealt", covariant=True)
Keys = npt.NDArray[np.uint32]

STREAMS = 12
"""Kinds of luck in a round, each with a key of its own, but for the one that is never dealt: `POLICIES`."""

POLICIES = 8
"""The stream of the numbers that policies draw. It lies among the others, since those behind it came later."""

_AHEAD = 64
"""Rounds whose keys are made at once."""


class Dealer(Protocol[Dealt]):
    """What makes the luck of rounds of their keys, which are (STREAMS, 4) each."""

    def ahead(self, batch: tuple[int, ...]) -> int:
        """Of how many rounds it is best made at once."""
        ...

    def of_round(self, key: Keys, batch: tuple[int, ...]) -> Dealt:
        """The luck of a round for a batch of this shape."""
        ...

    def of_rounds(self, keys: Keys, batch: tuple[int, ...]) -> Sequence[Dealt]:
        """The luck of R rounds, whose keys are (R, STREAMS, 4), for a batch of this shape."""
        ...


class Random:
    """A source of luck, for NumPy or for torch: keys drawn one after the other, and numbers made of them.

    The same seed gives the same numbers on both libraries, up to the rounding of float32.

    Args:
        generator: of the keys.
        like: an array of the library, dtype and device that numbers are made with; by default NumPy's float64.

    Raises:
        ValueError: the generator is no `numpy.random.Generator`. `Game.random(seed)` makes one that fits a game.
    """

    def __init__(self, generator: np.random.Generator, like: Array | None = None) -> None:
        if not isinstance(generator, np.random.Generator):
            raise ValueError(f"generator is {generator!r}; it must be a numpy.random.Generator")
        self.like = np.zeros(()) if like is None else like
        self._key = generator.integers(0, 2**32, 4, dtype=np.uint32)
        self._rounds = self._calls = 0
        self._keys: tuple[int, Keys] = (0, np.empty((0, STREAMS, 4), np.uint32))
        self._hand: tuple[int, tuple[Any, tuple[int, ...]], Sequence[Any]] = (0, (None, ()), ())

    def round_key(self) -> Array:
        """The key of the next round, which `Game.luck` turns into its luck: words, (STREAMS, 4)."""
        first, keys = self._keys
        if not 0 <= self._rounds - first < len(keys):
            self._keys = first, keys = self._rounds, self._round_keys(self._rounds, _AHEAD)
        key = keys[self._rounds - first]
        self._rounds += 1
        return self._on_device(key)

    def deal(self, luck: "Dealer[Dealt]", batch: tuple[int, ...]) -> Dealt:
        """The luck of the next round, on NumPy, where arrays may be so small that many rounds are best made at once."""
        first, whose, hand = self._hand
        at = self._rounds - first
        if whose[0] is not luck or whose[1] != batch or not 0 <= at < len(hand):
            ahead = min(luck.ahead(batch), 16 + self._rounds)  # fewer at first, since many a game is short
            if ahead == 1:
                return luck.of_round(self.round_key(), batch)
            hand = luck.of_rounds(self._round_keys(self._rounds, ahead), batch)
            self._hand, at = (self._rounds, (luck, batch), hand), 0
        self._rounds += 1
        dealt: Dealt = hand[at]
        return dealt

    def uniform(self, shape: Sequence[int]) -> Array:
        """Numbers from U[0, 1), of a shape (n, ...): n in each game, with more axes for the batch, as policies have it.

        A game's numbers do not depend on how many others there are.
        """
        return self._numbers(counter_rng.uniform, shape)

    def normal(self, shape: Sequence[int]) -> Array:
        """Numbers from N(0, 1), see `uniform`."""
        return self._numbers(counter_rng.normal, shape)

    def _numbers(self, made: Callable[..., Array], shape: Sequence[int]) -> Array:
        index = np.asarray([self._calls], np.uint32)
        key = self._on_device(np.stack(self._subkey(POLICIES, index)))
        self._calls += 1
        games = counter_rng.whole(self.like, math.prod(shape[1:]))
        return made(self.like, math.prod(shape[:1]), games, key).reshape(tuple(shape))

    def _round_keys(self, first: int, rounds: int) -> Keys:
        """The keys of some rounds, (rounds, STREAMS, 4)."""
        index = np.arange(first, first + rounds, dtype=np.uint32)[:, None]
        return np.stack(self._subkey(np.arange(STREAMS, dtype=np.uint32), index), axis=-1)

    def _subkey(self, stream: Any, index: Keys) -> list[Keys]:
        k = self._key
        words = np.broadcast_arrays(k[:1] + index, k[1:2] + np.asarray(stream, np.uint32), k[2:3], k[3:])
        return counter_rng.scramble(words)

    def _on_device(self, key: Keys) -> Array:
        if isinstance(self.like, np.ndarray):
            return key
        return namespace(self.like).asarray(key.view(np.int32), device=self.like.device)
