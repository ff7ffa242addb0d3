"""When an attack is active."""

from dataclasses import dataclass

from roletrust_env.arrays import Array
from roletrust_env.policy import Policy


@dataclass(frozen=True)
class WindowedAttack(Policy):
    """A scripted attack that is active for a while and honest play before and after.

    Attributes:
        start: first round of the attack.
        stop: first round after it; None attacks to the end.
    """

    start: int = 0
    stop: int | None = None

    def __post_init__(self) -> None:
        check(self.start >= 0, "start", self.start, "0 or more")
        late = self.stop is None or self.stop > self.start
        check(late, "stop", self.stop, f"None or later than start, {self.start}")

    def active(self, round: Array) -> Array:
        """Whether the attack is on in a round, shape (...), boolean."""
        on = round >= self.start
        return on if self.stop is None else on & (round < self.stop)


def check(ok: bool, name: str, value: object, allowed: str) -> None:
    """Refuse a parameter.

    Raises:
        ValueError: `ok` is false; names the parameter, its value and what is allowed.
    """
    if not ok:
        raise ValueError(f"{name} is {value!r}; it must be {allowed}")
