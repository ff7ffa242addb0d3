"""A look over the shoulder of trust models that others wrote: before a game, and round by round."""

from typing import Any

from roletrust_env.arrays import Array, compiling, copied, namespace
from roletrust_env.trust.model import State, TrustModel, start_model


def needs_watching(model: TrustModel[Any]) -> bool:
    """Whether a model comes from elsewhere. Those of the package are tested, and a look takes time."""
    return not type(model).__module__.startswith("roletrust_env.")


def check_trust_model(model: TrustModel[Any], peers: Array, like: Array) -> None:
    """Try a model on one round, in which all but the first pair meet and all ratings are low.

    One that comes from elsewhere is tried twice: only if it leaves what it is given as it is, and keeps nothing in
    itself, are the games of a batch, of a planner and after a reset each a game of its own.

    Args:
        model: to be tried.
        peers: shape (S, P), boolean, true where a rater and a provider are one agent.
        like: an array of the library, dtype and device that it has to work with.

    Raises:
        ValueError: the model raises something; a read-out is no array of the game's library and dtype, has the wrong
            shape or is not in [0, 1]; or the same round comes to something else the second time.
    """
    xp, where = namespace(like), f"trust model {model!r} cannot play one round"
    ratings = xp.zeros((*peers.shape, 1), dtype=like.dtype, device=like.device) + 0.25
    mask = ratings > 0
    mask[0, 0] = False
    try:
        start = start_model(model, ratings, peers)
    except Exception as error:  # whatever a foreign model raises
        raise ValueError(f"{where}: {type(error).__name__}: {error}") from error
    _, *trusts = _updated(model, start, ratings, mask, where)
    if not needs_watching(model):
        return
    if not bool((ratings == 0.25).all()) or bool(mask[0, 0].any()) or int(mask.sum()) != len(peers[0]) * len(peers) - 1:
        raise ValueError(f"{where}: it writes to the ratings or to the mask, which it must leave as they are")
    first = [copied(trust) for trust in trusts]
    for changes, state in (("itself", start_model(model, ratings, peers)), ("the state it is given", start)):
        _, *again = _updated(model, state, ratings, mask, where)
        if any(bool((abs(one - other) > 1e-6).any()) for one, other in zip(first, again, strict=True)):
            raise ValueError(f"{where} twice alike: it changes {changes}, and must return what it remembers anew")


def watched_update(
    model: TrustModel[State], state: State, ratings: Array, mask: Array | None, round: Array
) -> tuple[State, Array, Array]:
    """Return the state after a round and the trust of raters and of providers, once these are checked.

    Args:
        model: see `TrustModel`.
        state: of the model, before the round.
        ratings: see `TrustModel.update`.
        mask: see `TrustModel.update`.
        round: number of rounds played so far, (...), for the error.

    Raises:
        ValueError: the model raised something, or a read-out has another shape than (S, ...) and (P, ...) or another
            dtype than the ratings, is NaN or outside [0, 1]. The message names the model and the round.
    """
    if compiling(ratings):  # a compiler cannot stop half-way
        after = model.update(state, ratings, mask)
        return after, model.rater_trust(after), model.provider_trust(after)
    where = f"trust model {model!r}, round {int(round.reshape(-1)[0])}"
    return _updated(model, state, ratings, mask, where)


def _updated(
    model: TrustModel[State], state: State, ratings: Array, mask: Array | None, where: str
) -> tuple[State, Array, Array]:
    """The state after a round, and the sound trust of raters and providers that it reads."""
    try:
        after = model.update(state, ratings, mask)
        of_raters, of_providers = model.rater_trust(after), model.provider_trust(after)
    except Exception as error:  # whatever a foreign model raises
        raise ValueError(f"{where}: {type(error).__name__}: {error}") from error
    _check("rater_trust", of_raters, (len(ratings), *ratings.shape[2:]), ratings, where)
    _check("provider_trust", of_providers, tuple(ratings.shape[1:]), ratings, where)
    return after, of_raters, of_providers


def _check(name: str, trust: Any, needed: tuple[int, ...], ratings: Array, where: str) -> None:
    """Refuse a read-out that is no array as the game needs it."""
    if not isinstance(trust, type(ratings)):
        raise ValueError(f"{where}: {name} is a {type(trust).__name__}; it must be a {type(ratings).__name__}")
    shape = tuple(trust.shape)
    if shape != needed:
        raise ValueError(f"{where}: {name} has shape {shape}; it must be {needed}")
    if trust.dtype != ratings.dtype:
        raise ValueError(f"{where}: {name} is of dtype {trust.dtype}; it must be {ratings.dtype}, as the ratings are")
    wrong = trust[~((trust >= 0) & (trust <= 1))]
    if len(wrong):
        raise ValueError(f"{where}: {name} holds {float(wrong[0])}; a trust must lie in [0, 1]")
