"""When an attack is active."""

from typing import Any, Self

from pydantic import NonNegativeInt, PositiveInt, model_validator
from pydantic.dataclasses import dataclass

from roletrust_env.arrays import Array
from roletrust_env.game.policy import Policy


@dataclass(frozen=True)
class WindowedAttack(Policy):
    """A scripted attack that is active for a while, and honest play before and after.

    Attributes:
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    start: NonNegativeInt = 0
    stop: PositiveInt | None = None

    @model_validator(mode="after")
    def _check_window(self) -> Self:
        if self.stop is not None and self.stop <= self.start:
            raise ValueError(f"stop is {self.stop}; it must be later than start, {self.start}")
        return self

    def active(self, round: Array) -> Array:
        """Whether the attack is on in a round, shape (...), boolean."""
        on = round >= self.start
        return on if self.stop is None else on & (round < self.stop)


def woken(now: Array, memory: Any) -> tuple[Array, Array]:
    """Whether a sleeper is awake, and that as its memory: since the first round in which it should wake."""
    awake = now if memory is None else now | memory
    return awake, awake
