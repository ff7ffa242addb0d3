"""The strategies of providers and raters that earn by being trusted, and populations of agents that
play them.

A population has an array of parameters for each role, of shape (2, n, ...): the two parameters, the
n agents of the role, and the axes of the batch. So other agents, other runs and other games may
play other strategies in one batch.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.parameters import refuse_unknown_parameters
from roletrust_env.randomness import Random, generator

Floats = npt.NDArray[np.float64]
Side = Literal["providers", "raters"]

BOUNDS: dict[Side, tuple[tuple[float, float], ...]] = {
    "providers": ((0.0, 1.0), (-1.0, 1.0)),
    "raters": ((-1.0, 1.0), (0.0, 1.0)),
}
"""Range of each parameter: level and reaction of a provider, lift and following of a rater."""

HONEST: dict[Side, tuple[float, float]] = {"providers": (1.0, 0.0), "raters": (0.0, 0.0)}
"""Parameters of honest play."""

_GRID = np.linspace(0.0, 1.0, 21)
_NEUTRAL = 0.5  # trust at which a provider chooses its level


@refuse_unknown_parameters
@dataclass(frozen=True, eq=False)
class StrategicProvider(Policy):
    """A provider that chooses its quality by its own trust T: level + reaction (T - 1/2), cut to
    [0, 1].

    Attributes:
        level: Quality at a trust of 1/2, in [0, 1]; a number, or an array of shape (n, ...).
        reaction: Change of quality with trust, in [-1, 1]. Below 0 a provider that is trusted saves
            effort.
    """

    level: Array
    reaction: Array
    attacks: ClassVar[frozenset[Channel]] = frozenset({"quality"})

    def quality(self, view: ProviderView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the quality. See `Policy.quality`."""
        return _unit(self.level + self.reaction * (view.trust - _NEUTRAL)), memory


@refuse_unknown_parameters
@dataclass(frozen=True, eq=False)
class StrategicRater(Policy):
    """A rater that perceives s, knows the published trust T of a provider, and reports (1 -
    following) r + following T.

    Here r is s + lift (1 - s) with a lift from 0 on, and s (1 + lift) below 0.

    Attributes:
        lift: Move of each rating to 1 (above 0) or to 0 (below 0), in [-1, 1]; a number, or an
            array of shape (n, ...).
        following: Weight of published trust in a rating, in [0, 1].
    """

    lift: Array
    following: Array
    attacks: ClassVar[frozenset[Channel]] = frozenset({"ratings"})

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Return the ratings. See `Policy.ratings`."""
        seen = _unit(view.service)
        lift = 0 * seen + self.lift
        moved = seen + _unit(lift) * (1 - seen) - _unit(-lift) * seen
        return _unit(moved + self.following * (view.published - moved)), memory


class StrategyProfile(NamedTuple):
    """The parameters of all agents.

    Attributes:
        providers: Level and reaction of each provider, shape (2, P, ...).
        raters: Lift and following of each rater, shape (2, S, ...).
    """

    providers: Floats
    raters: Floats

    def seated(self, game: Game) -> JointPolicy:
        """Return the policies of all agents of a game.

        Raises:
            ValueError: An agent of the scenario is rater and provider at once, or has identities in
                reserve.
        """
        roster = game.roster
        if roster.n_both or any(roster.identity_index):
            raise ValueError(
                f"scenario {game.scenario.name!r} has agents with both roles or identities in "
                "reserve; "
                "strategic populations are of raters (SR) and providers (SP) with one identity each"
            )
        dtype = game.like.dtype
        provider, rater = (part.astype(dtype) for part in self)
        policies: dict[str, Policy] = dict.fromkeys(
            roster.provider_names, StrategicProvider(*provider)
        )
        return JointPolicy(
            game, policies | dict.fromkeys(roster.rater_names, StrategicRater(*rater))
        )


def honest_population(game: Game, batch: tuple[int, ...]) -> StrategyProfile:
    """Return a population of honest agents."""
    return uniform_population(game, HONEST["providers"], HONEST["raters"], batch)


def uniform_population(
    game: Game, provider: Any, rater: Any, batch: tuple[int, ...] = ()
) -> StrategyProfile:
    """Return a population in which the agents of a role play alike.

    Args:
        game: Game with the agents.
        provider: Level and reaction of the providers, shape (2,), or (2, ...) with axes of the
            batch.
        rater: Lift and following of the raters, likewise.
        batch: Shape of further axes of the batch.
    """

    def spread(parameters: Any, agents: int) -> Floats:
        strategy = np.asarray(parameters, np.float64)
        strategy = strategy.reshape(2, 1, *strategy.shape[1:], *[1] * len(batch))
        return np.broadcast_to(
            strategy, (2, agents, *strategy.shape[2 : strategy.ndim - len(batch)], *batch)
        ).copy()

    return StrategyProfile(
        spread(provider, game.roster.n_providers), spread(rater, game.roster.n_raters)
    )


def random_population(game: Game, batch: tuple[int, ...], seed: int) -> StrategyProfile:
    """Return a population whose parameters are uniform in their ranges."""
    rng = generator(seed)

    def draw(side: Side, agents: int) -> Floats:
        return np.stack([rng.uniform(*bounds, (agents, *batch)) for bounds in BOUNDS[side]])

    return StrategyProfile(
        draw("providers", game.roster.n_providers), draw("raters", game.roster.n_raters)
    )


def departure(side: Side, parameters: Floats) -> Floats:
    """Return how far strategies are from honest play, shape (n, ...), in [0, 1].

    For a provider it is the mean of 1 - quality over trust from 0 to 1. For a rater it is the mean
    distance between rating and perceived quality, over qualities and published trust from 0 to 1.
    It is a property of the strategy, so that a rater who always says 1 departs from honesty, also
    while all services happen to be good.

    Args:
        side: Role of the agents.
        parameters: Parameters, shape (2, n, ...).

    Example:
        >>> departure("providers", np.array([[1.0], [0.0]])), departure("raters", np.array([[1.0], [0.0]])).round(2)
        (array([0.]), array([0.5]))
    """  # noqa: E501
    grid = _GRID.reshape(-1, *[1] * (parameters.ndim - 1))
    if side == "providers":
        quality = _unit(parameters[0] + parameters[1] * (grid - _NEUTRAL))
        lacking: Floats = (1 - quality).mean(axis=0)
        return lacking
    service, published = grid[:, None], grid[None]
    moved = service + _unit(parameters[0]) * (1 - service) - _unit(-parameters[0]) * service
    false: Floats = np.abs(moved + parameters[1] * (published - moved) - service).mean(axis=(0, 1))
    return false


def _unit(values: Array) -> Array:
    """Return values cut to [0, 1]."""
    return namespace(values).clip(values, 0, 1)
