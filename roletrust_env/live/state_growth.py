"""Growth of the state of a trust model when agents join a team, without a replay of the rounds so far."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from roletrust_env.trees import map_leaves
from roletrust_env.trust import Ratings, TrustModel
from roletrust_env.trust.model import start_model

_TRIALS, _ROUNDS = 18, 12
_DENSITIES = 0.2, 0.5, 0.9  # shares of the pairs that meet in a round
_NEAR = 1e-12  # sums over more agents may be rounded in another way


def grown_state(model: TrustModel[Any], state: Any, peers: NDArray[np.bool_]) -> Any:
    """Return the state of a larger team: newcomers have the start values, all others what they had.

    Args:
        model: Trust model.
        state: State of the team before; newcomers are the last ones of its axes.
        peers: Pairs of the larger team, see `start_model`.
    """
    start = start_model(model, np.zeros(peers.shape), peers)
    return map_leaves(_grown, state, start)


def _grown(old: Any, new: Any) -> Any:
    if not (isinstance(old, np.ndarray) and isinstance(new, np.ndarray) and old.ndim == new.ndim > 0):
        return old
    grown = new.astype(old.dtype)
    grown[tuple(slice(size) for size in old.shape)] = old
    return grown


def grows(model: TrustModel[Any]) -> bool:
    """Return whether growing the state of a model is as good as a replay in which newcomers were silent before.

    This is tried on random ratings of small teams, with newcomers of every role.
    """
    random = np.random.default_rng(0)
    return all(_grows_once(model, random, trial) for trial in range(_TRIALS))


def _grows_once(model: TrustModel[Any], random: np.random.Generator, trial: int) -> bool:
    few = random.integers(1, 7, 2)
    many = few + [[1, 0], [0, 1], [2, 2]][trial % 3]
    peers = np.zeros(many, bool)
    peers[-1, -1] = peers[0, 0] = trial % 2 == 1
    ratings = random.random((2 * _ROUNDS, *many))
    mask = random.random((2 * _ROUNDS, *many)) < _DENSITIES[trial // 6]
    mask[:_ROUNDS, few[0] :] = mask[:_ROUNDS, :, few[1] :] = False
    mask &= ~peers
    ratings[~mask] = 0
    try:
        whole = start_model(model, np.zeros(many), peers)
        part = start_model(model, np.zeros(few), peers[: few[0], : few[1]])
        for one, there in zip(ratings[:_ROUNDS], mask[:_ROUNDS], strict=True):
            whole = model.update(whole, Ratings(one, there))
            part = model.update(part, Ratings(one[: few[0], : few[1]].copy(), there[: few[0], : few[1]].copy()))
        grown = grown_state(model, part, peers)
        for one, there in zip(ratings[_ROUNDS:], mask[_ROUNDS:], strict=True):
            whole, grown = (model.update(state, Ratings(one, there)) for state in (whole, grown))
            if not (_near(model.rater_trust, whole, grown) and _near(model.provider_trust, whole, grown)):
                return False
    except Exception:  # a model of another package may have any state
        return False
    return True


def _near(read: Any, one: Any, other: Any) -> bool:
    return bool(np.all(np.abs(read(one) - read(other)) <= _NEAR))
