"""Policies that play, learn or plan, and the training of attackers."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from roletrust_agents.training.train import Training, train

__all__ = ["Training", "train"]


def __getattr__(name: str) -> Any:
    """Return `train` or `Training`, which need the extra `train`."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from roletrust_agents.training import train

    return getattr(train, name)
