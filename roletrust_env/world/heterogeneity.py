"""Differences between agents that last for a whole game: the ability of providers, and the
perception of raters.
"""

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array, namespace
from roletrust_env.shapes import PerProvider, PerRater
from roletrust_env.world.roster import Roster

Property = Literal["ability", "bias", "scale"]


class Perception(NamedTuple):
    """Perception of each rater: `scale` times quality plus `bias`.

    Attributes:
        bias: Bias of each rater, shape (S, ...).
        scale: Scale of each rater, shape (S, ...).
    """

    bias: PerRater
    scale: PerRater


class AgentProperties(NamedTuple):
    """Properties of the agents in a game.

    Attributes:
        ability: Delivered quality as a share of the quality that a provider chose, shape (P, ...);
            None if every provider delivers all of it.
        perception: Bias and scale of the raters; None if all raters perceive the quality as it is.
    """

    ability: PerProvider | None
    perception: Perception | None


class AgentPropertySampler:
    """Draws the properties of the agents of a scenario at the start of a game.

    Args:
        roster: Agents and their groups, which give the ranges of the properties.
        like: Array of the library, dtype and device to work with.
    """

    def __init__(self, roster: Roster, like: Array) -> None:
        def bounds(name: Property) -> tuple[Array, Array]:
            low, high = _ranges(roster, name).T
            axis = roster.providers if name == "ability" else roster.raters
            low, width = (
                namespace(like).asarray(axis(x), dtype=like.dtype, device=like.device)
                for x in (low, high - low)
            )
            return low, width

        all_able = all(group.ability == 1 for group in roster.groups)
        self._ability = None if all_able else bounds("ability")
        subjective = any(group.subjective for group in roster.groups)
        self._perception = (bounds("bias"), bounds("scale")) if subjective else None

    def start(
        self,
        raters: Array,
        providers: Array,
        ability: Array | None,
        bias: Array | None,
        scale: Array | None,
    ) -> AgentProperties:
        """Return the properties of the agents at the start of a batch of games.

        Args:
            raters: Zeros of shape (S, ...).
            providers: Zeros of shape (P, ...).
            ability: Uniform noise of shape (P, ...); None if no group gives a range.
            bias: Uniform noise of shape (S, ...); None if no group gives a range.
            scale: Uniform noise of shape (S, ...); None if no group gives a range.
        """
        perception = None
        if self._perception is not None:
            of_bias, of_scale = self._perception
            perception = Perception(_scale(raters, of_bias, bias), _scale(raters, of_scale, scale))
        return AgentProperties(
            None if self._ability is None else _scale(providers, self._ability, ability), perception
        )


def varies(roster: Roster, name: Property) -> bool:
    """Return whether a property is drawn anew for each game, for any agent."""
    low, high = _ranges(roster, name).T
    return bool((low < high).any())


def _ranges(roster: Roster, name: Property) -> npt.NDArray[np.float64]:
    """Return the lowest and the highest value of a property for each agent, shape (N, 2)."""
    return roster.of_groups(lambda group: np.broadcast_to(getattr(group, name), 2)).astype(float)


def _scale(zeros: Array, bounds: tuple[Array, Array], noise: Array | None) -> Array:
    """Return uniform noise of shape (n, ...) scaled to ranges, given by their low ends and their
    widths, (n,) each.
    """
    low, width = (bound.reshape(bound.shape + (1,) * (zeros.ndim - 1)) for bound in bounds)
    return zeros + low if noise is None else low + width * noise
