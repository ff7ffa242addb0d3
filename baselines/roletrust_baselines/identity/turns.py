"""The presence of identities: all at once or one after the other, or a new one for one with low trust."""

from roletrust_env.arrays import Array
from roletrust_env.game.views import IdentityView


def called(view: IdentityView, reserve: int, start: int, every: int) -> Array:
    """Return the first identity and those called until now, boolean, shape (...).

    Args:
        view: View of the identities.
        reserve: Number of identities in reserve that are called.
        start: Round in which the first of them is called, which is present after this round.
        every: Number of rounds between two identities; 0 calls all at once.
    """
    now = (view.turn <= reserve) & (view.round >= start + (view.turn - 1) * every)
    return (view.turn == 0) | now


def renewed(view: IdentityView, reserve: int, threshold: float) -> Array:
    """Return the current identity, unless its trust is too low, boolean, shape (...).

    Args:
        view: View of the identities.
        reserve: Number of identities in reserve that are taken. The last one stays, even with low trust.
        threshold: Trust below which an identity leaves, in [0, 1].
    """
    its_turn = (view.turn == 0) | view.succeeds & (view.turn <= reserve)
    tainted = view.present & (view.trust < threshold) & (view.turn < reserve)
    return its_turn & ~tainted
