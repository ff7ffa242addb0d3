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
    """A rater that lies about some providers or about all, for a while.

    Attributes:
        targets: places of the victims on the provider axis; None lies about all.
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    targets: Annotated[Places | None, Victims()] = field(default=None, kw_only=True)
    attacks: ClassVar[frozenset[Channel]] = frozenset({"ratings"})

    def lies(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """What it would rate everybody, shape (P, ...), and its new memory."""
        raise NotImplementedError

    def ratings(self, view: RaterView, memory: Any, random: Random) -> tuple[Array, Any]:
        """Lies about the targets while active, the truth otherwise. See `Policy.ratings`."""
        lies, memory = self.lies(view, memory, random)
        about = self.active(view.round)
        if self.targets is not None:
            about = about & among(self.targets, view.service, "targets")
        return namespace(lies).where(about, lies, view.service), memory


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
