"""What attacks by ratings share: a window of time, and whom they lie about."""

from dataclasses import field
from typing import Annotated, Any, ClassVar

from pydantic import Field, NonNegativeInt
from pydantic.dataclasses import dataclass

from baselines.window import WindowedAttack
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Channel
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random
from roletrust_env.ranges import Victims

Places = Annotated[tuple[NonNegativeInt, ...], Field(min_length=1)]
"""Of providers, on their axis; at least one."""


@dataclass(frozen=True)
class Lying(WindowedAttack):
    """A rater that lies for a while, about all providers.

    Attributes:
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    attacks: ClassVar[frozenset[Channel]] = frozenset({"ratings"})

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """What it would rate everybody, shape (P, ...), and its new memory."""
        raise NotImplementedError

    def about(self, view: RaterView) -> Array:
        """About whom it lies now, boolean, (P, ...) or (...)."""
        return self.active(view.round)

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Lies while active, the truth otherwise. See `Policy.ratings`."""
        lies, memory = self.lies(view, memory, random)
        return namespace(lies).where(self.about(view), lies, view.service), memory


@dataclass(frozen=True)
class TargetedLying(Lying):
    """A rater that lies about chosen providers and tells the truth about the others.

    So each of these attacks is discriminatory (Dellarocas 2000) by its targets. The other side of discrimination, to
    serve chosen raters badly, is not in this game: a provider has one quality for all in a round.

    Attributes:
        targets: places of the victims on the provider axis; None lies about all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    targets: Annotated[Places | None, Victims()] = field(default=None, kw_only=True)

    def about(self, view: RaterView) -> Array:
        """The targets, while active. See `Lying.about`."""
        active = self.active(view.round)
        return active if self.targets is None else active & among(self.targets, view.service, "targets")


def among(places: tuple[int, ...], providers: Array, what: str) -> Array:
    """Whether each provider is among some places.

    Args:
        places: on the provider axis.
        providers: an array with one row for each, (P, ...).
        what: the places are, for error messages.

    Returns:
        Boolean, shape (P, 1 ...).

    Raises:
        ValueError: a place is beyond the last provider.
    """
    count = providers.shape[0]
    if max(places, default=0) >= count:
        raise ValueError(f"{what} is {places}; the last provider is {count - 1}")
    chosen = namespace(providers).asarray([place in places for place in range(count)], device=providers.device)
    return chosen.reshape(-1, *[1] * (providers.ndim - 1))
