"""Attacks by name."""

from typing import Any

from roletrust_env.game.policy import Policy
from roletrust_env.registry import Registry

registry: Registry[Policy] = Registry("attacker", "roletrust_env.attackers", Policy)


def register_attacker(name: str, factory: Any) -> None:
    """Register an attacker under a name.

    Args:
        name: New name.
        factory: Callable `(**parameters) -> Policy`, usually the attacker's class.

    Raises:
        ValueError: The name is taken or is not a word.
    """
    registry.register(name, factory)


def make_attacker(name: str, **parameters: Any) -> Policy:
    """Make an attacker by name.

    Args:
        name: Registered name, or name of an entry point in the group `roletrust_env.attackers`.
        **parameters: Parameters of the attacker.

    Raises:
        ValueError: The name is unknown, the attacker has no such parameter, or a value is not allowed.

    Example:
        >>> make_attacker("on-off", period=4, start=10)
        OnOff(start=10, stop=None, period=4, duty=0.5, bad=0.0, good=1.0, switching='regular')
    """
    return registry.make(name, **parameters)


def attackers() -> dict[str, str]:
    """Return the known attackers: name and one line of description."""
    return registry.describe()
