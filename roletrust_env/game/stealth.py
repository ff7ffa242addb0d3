"""The price of a trust gap that gives an attacker away."""

from collections.abc import Mapping

from pydantic import ConfigDict, NonNegativeFloat, ValidationError
from pydantic.dataclasses import dataclass

from roletrust_env.errors import explain, suggest
from roletrust_env.ranges import Share


@dataclass(frozen=True, config=ConfigDict(extra="forbid", allow_inf_nan=False))
class Stealth:
    """The price of a trust gap between compromised and honest agents, see `AttackTask`.

    Attributes:
        weight: Weight of the cost in the reward, 0 or more.
        tolerance: Trust gap of an agent that costs nothing, in [0, 1].
    """

    weight: NonNegativeFloat = 0.0
    tolerance: Share = 0.1


def make_stealth(price: "Stealth | Mapping[str, float] | None") -> Stealth:
    """Return the price of stealth from its fields.

    Args:
        price: Price, its fields by name, or None for no price.

    Raises:
        ValueError: `price` has another type, or a field is unknown or not allowed.
    """
    if price is None or isinstance(price, Stealth):
        return price or Stealth()
    if not isinstance(price, Mapping):
        raise ValueError(f"stealth is {price!r}; it must be a Stealth, or a mapping of its fields weight and tolerance")
    for name in price:
        if name not in ("weight", "tolerance"):
            raise ValueError(f"stealth: there is no field {name!r}{suggest(name, ('weight', 'tolerance'))}")
    try:
        return Stealth(**price)
    except ValidationError as error:
        raise ValueError(f"stealth: {explain(error)}") from None
