"""Schedules of attacks."""

from typing import Self

from pydantic import NonNegativeInt, PositiveInt, model_validator

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.policy import Policy
from roletrust_env.parameters import checked_dataclass
from roletrust_env.randomness import Random


@checked_dataclass
class WindowedAttack(Policy):
    """A scripted attack with a beginning and an end; before and after it the agent plays honestly.

    Attributes:
        start: First round of the attack.
        stop: First round after the attack; None attacks to the end.
    """

    start: NonNegativeInt = 0
    stop: PositiveInt | None = None

    @model_validator(mode="after")
    def _check_window(self) -> Self:
        if self.stop is not None and self.stop <= self.start:
            raise ValueError(f"stop is {self.stop}; it must be later than start, {self.start}")
        return self

    def active(self, round: Array) -> Array:
        """Return whether the attack is active in a round, boolean, shape (...)."""
        on = round >= self.start
        return on if self.stop is None else on & (round < self.stop)


def asleep(random: Random, shape: tuple[int, ...]) -> Array:
    """Return the memory of sleepers before the first round, boolean, see `wake` and `Policy.begin`."""
    like = random.like
    return namespace(like).zeros(shape, dtype=like.dtype, device=like.device) > 0


def wake(now: Array, memory: Array) -> tuple[Array, Array]:
    """Return whether a sleeper is awake, and its new memory. Once it has woken up, it stays awake.

    Args:
        now: Whether the sleeper wakes up in this round, boolean.
        memory: Whether it was awake before.
    """
    awake = now | memory
    return awake, awake
