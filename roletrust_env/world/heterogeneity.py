"""What sets agents apart for a whole game: what a provider can deliver, and how a rater sees it."""

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array, namespace
from roletrust_env.world.roster import Roster

Property = Literal["ability", "bias", "scale"]


class Perception(NamedTuple):
    """How raters see services: as `scale` times quality plus `bias`, each of shape (S, ...)."""

    bias: Array
    scale: Array


class Nature(NamedTuple):
    """What agents are like in a game.

    Attributes:
        ability: delivered quality as a share of the one that a provider chose, (P, ...); None where all deliver it.
        taste: how raters see; None where all see quality as it is.
    """

    ability: Array | None
    taste: Perception | None


class Natures:
    """What the agents of a scenario are like in a game that starts.

    Args:
        roster: whose groups say what their agents are like.
        like: an array of the library, dtype and device to work with.
    """

    def __init__(self, roster: Roster, like: Array) -> None:
        def bounds(trait: Property) -> tuple[Array, Array]:
            low, high = _ranges(roster, trait).T
            axis = roster.providers if trait == "ability" else roster.raters
            low, width = (
                namespace(like).asarray(axis(x), dtype=like.dtype, device=like.device) for x in (low, high - low)
            )
            return low, width

        alike = all(group.ability == 1 for group in roster.groups)
        self._ability = None if alike else bounds("ability")
        subjective = any(group.subjective for group in roster.groups)
        self._taste = (bounds("bias"), bounds("scale")) if subjective else None

    def start(self, nothing: Array, ability: Array | None, bias: Array | None, scale: Array | None) -> Nature:
        """The nature of the agents in games that start.

        Args:
            nothing: zeros, shape (S, P, ...).
            ability: uniform luck, shape (P, ...); None where no range is given.
            bias: the same, (S, ...).
            scale: the same, (S, ...).
        """
        taste = None
        if self._taste is not None:
            rows = nothing[:, 0, ...]
            taste = Perception(_drawn(rows, self._taste[0], bias), _drawn(rows, self._taste[1], scale))
        return Nature(None if self._ability is None else _drawn(nothing[0], self._ability, ability), taste)


def varies(roster: Roster, trait: Property) -> bool:
    """Whether a trait is drawn anew for each game, of anybody."""
    low, high = _ranges(roster, trait).T
    return bool((low < high).any())


def _ranges(roster: Roster, trait: Property) -> npt.NDArray[np.float64]:
    """The lowest and the highest that a trait can be, for each agent, (N, 2)."""
    return np.asarray([np.broadcast_to(getattr(group, trait), 2) for group in roster.groups], float)


def _drawn(nothing: Array, bounds: tuple[Array, Array], luck: Array | None) -> Array:
    """A trait, shape (n, ...), from its lowest value and its width, (n,) each."""
    low, width = (bound.reshape(bound.shape + (1,) * (nothing.ndim - 1)) for bound in bounds)
    return nothing + low if luck is None else low + width * luck
