"""Scripted attackers, by name."""

from typing import Any

from baselines.identity.sybil import Sybil
from baselines.identity.whitewashing import Whitewashing
from baselines.provider.on_off import OnOff
from baselines.rater.bad_mouthing import BadMouthing
from roletrust_env.game.policy import Policy
from roletrust_env.registry import Registry

registry: Registry[Policy] = Registry("attacker", "roletrust_env.attackers", Policy)
registry.register("on-off", OnOff)
registry.register("bad-mouthing", BadMouthing)
registry.register("whitewashing", Whitewashing)
registry.register("sybil", Sybil)


def register_attacker(name: str, factory: Any) -> None:
    """Make an attacker known by name.

    Args:
        name: the new name.
        factory: a callable `(**parameters) -> Policy`, usually the attacker's class.

    Raises:
        ValueError: the name is taken or is not a word.
    """
    registry.register(name, factory)


def make_attacker(name: str, **parameters: Any) -> Policy:
    """Make an attacker by name.

    Args:
        name: a registered name or that of an entry point in the group `roletrust_env.attackers`.
        **parameters: the attacker's own.

    Raises:
        ValueError: the name is unknown, the parameters are not the attacker's, or a value is not allowed.

    Example:
        >>> make_attacker("on-off", period=4, start=10)
        OnOff(start=10, stop=None, period=4, duty=0.5, bad=0.0, good=1.0, switching='regular')
    """
    return registry.make(name, **parameters)


def attackers() -> dict[str, str]:
    """The known attackers: name and one line of description."""
    return registry.describe()


__all__ = ["BadMouthing", "OnOff", "Sybil", "Whitewashing", "attackers", "make_attacker", "register_attacker"]
