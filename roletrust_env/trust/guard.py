"""A look over the shoulder of trust models that others wrote, round by round."""

from typing import Any

from roletrust_env.arrays import Array, compiling
from roletrust_env.trust.model import State, TrustModel


def needs_watching(model: TrustModel[Any]) -> bool:
    """Whether a model comes from elsewhere. Those of the package are tested, and a look takes time."""
    return not type(model).__module__.startswith("roletrust_env.")


def watched_update(model: TrustModel[State], state: State, ratings: Array, mask: Array | None, round: Array) -> State:
    """What `model.update` makes of a round, if it is sound.

    Args:
        model: see `TrustModel`.
        state: of the model, before the round.
        ratings: see `TrustModel.update`.
        mask: see `TrustModel.update`.
        round: number of rounds played so far, (...), for the error.

    Raises:
        ValueError: the model raised something, or a read-out has another shape than (S, ...) and (P, ...), is NaN or
            outside [0, 1]. The message names the model and the round.
    """
    if compiling(ratings):  # a compiler cannot stop half-way
        return model.update(state, ratings, mask)
    where = f"trust model {model!r}, round {int(round.reshape(-1)[0])}"
    try:
        after = model.update(state, ratings, mask)
        read = {"rater_trust": model.rater_trust(after), "provider_trust": model.provider_trust(after)}
    except Exception as error:  # whatever a foreign model raises
        raise ValueError(f"{where}: {type(error).__name__}: {error}") from error
    needed = {"rater_trust": (len(ratings), *ratings.shape[2:]), "provider_trust": tuple(ratings.shape[1:])}
    for name, trust in read.items():
        shape = tuple(getattr(trust, "shape", ()))
        if shape != needed[name]:
            raise ValueError(f"{where}: {name} has shape {shape}; it must be {needed[name]}")
        wrong = trust[~((trust >= 0) & (trust <= 1))]
        if len(wrong):
            raise ValueError(f"{where}: {name} holds {float(wrong[0])}; a trust must lie in [0, 1]")
    return after
