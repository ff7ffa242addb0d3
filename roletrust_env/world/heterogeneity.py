"""Differences between agents: the ability of providers, which may change from round to round, and
the perception of raters, which lasts for a whole game.
"""

from typing import Any, Literal, NamedTuple

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
    """Draws the properties of the agents of a scenario, and changes them from round to round.

    Args:
        roster: Agents and their groups, which give the ranges of the properties.
        like: Array of the library, dtype and device to work with.
    """

    def __init__(self, roster: Roster, like: Array) -> None:
        def constant(values: Any) -> Array:
            return namespace(like).asarray(values, dtype=like.dtype, device=like.device)

        def bounds(name: Property) -> tuple[Array, Array]:
            low, high = _ranges(roster, name).T
            axis = roster.providers if name == "ability" else roster.raters
            return constant(axis(low)), constant(axis(high - low))

        all_able = all(group.ability == 1 for group in roster.groups)
        self._ability = None if all_able else bounds("ability")
        subjective = any(group.subjective for group in roster.groups)
        self._perception = (bounds("bias"), bounds("scale")) if subjective else None
        drift = roster.providers(roster.of_groups(lambda group: group.drift))
        switch = roster.providers(roster.of_groups(lambda group: group.switch))
        self._changes = constant(drift), constant(switch)

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

    def step(
        self, properties: AgentProperties, drift: Array | None, switch: Array | None
    ) -> AgentProperties:
        """Return the properties of the agents in the next round.

        Args:
            properties: Properties in the round that ends.
            drift: Standard normal noise of shape (P, ...); None if no ability drifts.
            switch: Uniform noise of shape (P, ...); None if no ability switches. Divided by the
                probability of a switch, it is the uniform noise of the new ability.
        """
        ability = properties.ability
        if ability is None or self._ability is None:
            return properties
        xp, columns = namespace(ability), (*self._ability, *self._changes)
        low, width, deviation, chance = (
            column.reshape(column.shape + (1,) * (ability.ndim - 1)) for column in columns
        )
        if drift is not None:
            ability = ability + deviation * drift
        if switch is not None:
            drawn = low + width * switch / xp.where(chance > 0, chance, 1 + chance)
            ability = xp.where(switch < chance, drawn, ability)
        # A walk that is reflected at both ends repeats after twice the width.
        high, period = low + width, xp.where(width > 0, 2 * width, 1 + width)
        ability = ability - period * xp.floor((ability - low) / period)
        ability = xp.maximum(xp.minimum(ability, 2 * high - ability), low)
        return properties._replace(ability=ability)


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
