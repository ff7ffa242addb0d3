"""Source of random numbers, which are drawn outside the pure core and passed to it."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env import counter_rng
from roletrust_env.arrays import Array, namespace, whole_dtype
from roletrust_env.parameters import whole_number

Keys = npt.NDArray[np.uint32]

STREAMS = 17
"""Number of random streams, each with its own key. Two of them, `POLICIES` and `LENGTHS`, are not
part of the noise."""

POLICIES = 8
"""Stream of the numbers that policies draw. Streams that were added later have higher numbers."""

LENGTHS = 12
"""Stream of the lengths of games, which is none of a round: games that end sooner have the same
rounds until then."""

_KEYS_AT_ONCE = 64
"""Number of rounds whose keys are made at once."""


def stream_key(key: Array | Sequence[Array], stream: Any, index: Any) -> list[Array]:
    """Return the key of a stream, four words.

    Args:
        key: Key of the source, four words of one shape.
        stream: Number of the stream.
        index: Number of the round, or of the call among those of policies.
    """
    words = key[0] + index, key[1] + stream, key[2], key[3]
    return counter_rng.scramble(namespace(key[0]).broadcast_arrays(*words))


def generator(seed: int | None = None) -> np.random.Generator:
    """Return NumPy's generator of a seed; None takes fresh entropy.

    Raises:
        ValueError: The seed is no whole number, 0 or more.
    """
    return np.random.default_rng(None if seed is None else whole_number("seed", seed))


def own_seeds(seed: int, many: int) -> list[int]:
    """Return a seed for each of some agents; neighbouring seeds have none in common, as `seed + i`
    would.
    """
    seeds: list[int] = np.random.SeedSequence(seed).generate_state(many, np.uint64).tolist()
    return seeds


class Random:
    """Source of random numbers for NumPy or torch: it draws one key after the other and makes
    numbers from each.

    The same seed gives the same numbers on both libraries, up to the rounding of float32.

    Args:
        generator: Generator of the keys.
        like: Array of the library, dtype and device of the numbers; by default NumPy's float64.

    Raises:
        ValueError: The generator is not a `numpy.random.Generator`. `Game.random(seed)` makes a
            source for a game.
    """

    def __init__(self, generator: np.random.Generator, like: Array | None = None) -> None:
        if not isinstance(generator, np.random.Generator):
            raise ValueError(f"generator is {generator!r}; it must be a numpy.random.Generator")
        self.like = np.zeros(()) if like is None else like
        self._key = generator.integers(0, 2**32, 4, dtype=np.uint32)
        self._rounds = self._calls = 0
        self._keys: tuple[int, Keys] = (0, np.empty((0, STREAMS, 4), np.uint32))
        # Noise made ahead: its first round, the source and the batch that it was made for, and the
        # noise of each round.
        self._stock: tuple[int, tuple[Any, tuple[int, ...]], Sequence[Any]] = (0, (None, ()), ())

    def round_key(self) -> Array:
        """Return the key of the next round, words of shape (STREAMS, 4). `Game.noise` turns it into
        noise.
        """
        first, keys = self._keys
        if not 0 <= self._rounds - first < len(keys):
            self._keys = first, keys = self._rounds, self._round_keys(self._rounds, _KEYS_AT_ONCE)
        key = keys[self._rounds - first]
        self._rounds += 1
        return self._on_device(key)

    def draw_noise(self, source: Any, batch: tuple[int, ...]) -> Any:
        """Return the noise of the next round, on NumPy.

        If the arrays are small, the noise of many rounds is made at once, which is faster.

        Args:
            source: Source of the noise of a game, see `roletrust_env.game.noise.NoiseSource`.
            batch: Shape of the batch.
        """
        first, made_for, stock = self._stock
        at = self._rounds - first
        if made_for[0] is not source or made_for[1] != batch or not 0 <= at < len(stock):
            count = min(
                source.rounds_at_once(batch), 16 + self._rounds
            )  # fewer at first, as many games are short
            if count == 1:
                return source.make_round(self.round_key(), batch)
            stock = source.make_rounds(self._round_keys(self._rounds, count), batch)
            self._stock, at = (self._rounds, (source, batch), stock), 0
        self._rounds += 1
        return stock[at]

    def uniform(self, shape: Sequence[int]) -> Array:
        """Return random numbers from U[0, 1).

        The numbers of a game do not depend on the number of games in the batch.

        Args:
            shape: Shape (n, ...): n numbers in each game, then the axes of the batch, as in
                policies.
        """
        return self._numbers(counter_rng.uniform, shape)

    def normal(self, shape: Sequence[int]) -> Array:
        """Return random numbers from N(0, 1), see `uniform`."""
        return self._numbers(counter_rng.normal, shape)

    def lengths(self, continuation: float, most: int, batch: tuple[int, ...]) -> Array:
        """Return the lengths of games that begin now, in rounds, from the geometric distribution,
        of the batch's shape.

        Args:
            continuation: Probability that a game goes on after a round, in (0, 1).
            most: Greatest length.
            batch: Shape of the batch.
        """
        key = self._on_device(
            np.stack(self._subkey(LENGTHS, np.asarray([self._rounds], np.uint32)))
        )
        games = counter_rng.counters(self.like, math.prod(batch))
        chance = counter_rng.uniform(self.like, 1, games, key).reshape(batch)
        xp = namespace(chance)
        whole = 1 + xp.floor(xp.log1p(-chance) / math.log(continuation))
        return xp.astype(xp.clip(whole, None, most), whole_dtype(chance))

    def policy_key(self) -> Array:
        """Return the key of the next numbers that policies draw, words of shape (4, 1)."""
        index = np.asarray([self._calls], np.uint32)
        self._calls += 1
        return self._on_device(np.stack(self._subkey(POLICIES, index)))

    def _numbers(self, distribution: Callable[..., Array], shape: Sequence[int]) -> Array:
        key = self.policy_key()
        games = counter_rng.counters(self.like, math.prod(shape[1:]))
        return distribution(self.like, math.prod(shape[:1]), games, key).reshape(tuple(shape))

    def _round_keys(self, first: int, rounds: int) -> Keys:
        """Return the keys of consecutive rounds, shape (rounds, STREAMS, 4)."""
        index = np.arange(first, first + rounds, dtype=np.uint32)[:, None]
        return np.stack(self._subkey(np.arange(STREAMS, dtype=np.uint32), index), axis=-1)

    def _subkey(self, stream: Any, index: Keys) -> list[Keys]:
        return stream_key(np.split(self._key, 4), np.asarray(stream, np.uint32), index)

    def _on_device(self, key: Keys) -> Array:
        if isinstance(self.like, np.ndarray):
            return key
        return namespace(self.like).asarray(key.view(np.int32), device=self.like.device)
