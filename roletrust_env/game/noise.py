"""The noise of a game: the random numbers of a round, and how a key becomes them."""

from collections.abc import Callable
from itertools import repeat
from math import prod

import numpy as np

from roletrust_env import counter_rng
from roletrust_env.arrays import Array
from roletrust_env.game.state import Noise
from roletrust_env.randomness import LENGTHS, POLICIES, STREAMS
from roletrust_env.world.heterogeneity import varies
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Choice, Encounters, InRange, Scenario

_AHEAD = 256
"""Number of rounds of a single small game for which noise is made at once."""

_MANY = 4096
"""Random numbers in a round above which a call for each round is cheaper than one call for many
rounds."""

_OF_THE_START = ("position", "ability", "bias", "scale")
"""NoiseSource that only the start of a game takes."""

_STREAM = dict(
    zip(Noise._fields, (k for k in range(STREAMS) if k not in (POLICIES, LENGTHS)), strict=True)
)

_Kind = tuple[Callable[..., Array], tuple[int, ...]]
"""Function that makes random numbers, and their shape in one game."""


class NoiseSource:
    """A source of noise: it makes the noise of a round from a key, see `counter_rng`. Each field
    has its own stream.

    Args:
        scenario: Scenario of the game.
        roster: Agents of the scenario.
        changes: Whether agents join, leave or are cut off.
        like: Array of the library, dtype and device to work with.
        width: Number of cells of each rater: P, or fewer in a `SparseGame`.

    Attributes:
        starts: Whether the start uses further noise, for positions of agents or for their
            properties.
    """

    def __init__(
        self, scenario: Scenario, roster: Roster, changes: bool, like: Array, width: int
    ) -> None:
        s, p, n = roster.n_raters, roster.n_providers, roster.n_agents
        moves = isinstance(scenario.access, InRange)
        choice: _Kind | None = None
        explore: _Kind | None = None
        if isinstance(scenario.access, Choice):
            choice = counter_rng.uniform, (s, p)
            if scenario.access.explore > 0:
                explore = counter_rng.uniform, (s,)
        elif isinstance(scenario.access, Encounters):
            choice = counter_rng.uniform, (s, scenario.access.providers)
        fields: dict[str, _Kind | None] = {
            "perception": (counter_rng.normal, (s, width)),
            "lost": (counter_rng.uniform, (s, width)) if scenario.ratings.lost > 0 else None,
            "late": (counter_rng.uniform, (s, width)) if scenario.ratings.late > 0 else None,
            "choice": choice,
            "presence": (counter_rng.uniform, (n,)) if changes else None,
            "value": (counter_rng.uniform, (p,)) if len(set(scenario.values)) > 1 else None,
            "goal": (counter_rng.uniform, (n, 2)) if moves else None,
            "position": (counter_rng.uniform, (n, 2)) if moves else None,
            "ability": (counter_rng.uniform, (p,)) if varies(roster, "ability") else None,
            "bias": (counter_rng.uniform, (s,)) if varies(roster, "bias") else None,
            "scale": (counter_rng.uniform, (s,)) if varies(roster, "scale") else None,
            "explore": explore,
            "claim": (counter_rng.uniform, (s, p)) if scenario.ratings.open is not None else None,
            "drift": (counter_rng.normal, (p,)) if any(g.drift for g in scenario.agents) else None,
            "switch": (counter_rng.uniform, (p,))
            if any(g.switch for g in scenario.agents)
            else None,
        }
        self._fields = {name: kind for name, kind in fields.items() if kind is not None}
        self.starts = any(name in self._fields for name in _OF_THE_START)
        self._like = like
        self._cells = sum(prod(shape) for _, shape in self._fields.values())

    def rounds_at_once(self, batch: tuple[int, ...]) -> int:
        """Return the number of rounds for which noise is best made at once; small arrays gain from
        more than one.
        """
        numbers = max(1, self._cells * prod(batch))
        return 1 if numbers > _MANY else min(_AHEAD, 4 * counter_rng.BLOCK // numbers)

    def make_round(self, key: Array, batch: tuple[int, ...], start: bool = False) -> Noise:
        """Return the noise of one round, or of the start, which uses all fields.

        The key has shape (STREAMS, 4), or (STREAMS, 4, ...) if every game has its own; then all
        have the number 0.
        """
        games = counter_rng.counters(self._like, prod(batch) if key.ndim == 2 else 1)

        def make(kind: Callable[..., Array], shape: tuple[int, ...], stream: int) -> Array:
            words = [key[stream, k, ...].reshape(-1) for k in range(4)]
            return kind(self._like, prod(shape), games, words).reshape(*shape, *batch)

        return self._noise(make, start)

    def make_rounds(self, keys: Array, batch: tuple[int, ...]) -> list[Noise]:
        """Return the noise of R rounds, on NumPy. The keys have shape (R, STREAMS, 4)."""
        rounds, games = len(keys), prod(batch)
        numbers = np.tile(counter_rng.counters(self._like, games), rounds)

        def make(kind: Callable[..., Array], shape: tuple[int, ...], stream: int) -> Array:
            words = [np.repeat(keys[:, stream, k], games) for k in range(4)]
            made = kind(self._like, prod(shape), numbers, words).reshape(*shape, rounds, *batch)
            by_round = np.moveaxis(made, len(shape), 0)
            return (
                by_round if batch else np.ascontiguousarray(by_round)
            )  # a round of one game lies together

        parts = (
            repeat(None, rounds) if part is None else part for part in self._noise(make, False)
        )
        return [Noise(*noise) for noise in zip(*parts, strict=True)]

    def _noise(
        self, make: Callable[[Callable[..., Array], tuple[int, ...], int], Array], start: bool
    ) -> Noise:
        return Noise(
            **{
                name: make(*kind, _STREAM[name])
                for name, kind in self._fields.items()
                if start or name not in _OF_THE_START
            }
        )
