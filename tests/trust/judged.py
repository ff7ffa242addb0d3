"""How the personal models are tested: slow references, judge by judge, and states after a few
rounds."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from model_cases import Reference, Rounds, varied_rounds

from roletrust_env.trust import Ratings
from roletrust_env.trust.model import start_model

Matrix = list[list[Any]]


class Published(NamedTuple):
    """What judges publish together, of the trust and the credence of each."""

    raters: list[float]
    providers: list[float]

    @classmethod
    def by(cls, trust: Matrix, credence: Matrix) -> "Published":
        judges = range(len(trust))
        raters = []
        for k in judges:
            heard = [credence[i][k] for i in judges if i != k]
            raters.append(sum(heard) / len(heard) if heard else 1.0)
        providers = [sum(trust[i][j] for i in judges) / len(trust) for j in range(len(trust[0]))]
        return cls(raters, providers)


def round_by_round(kind: Callable[..., Any], **parameters: Any) -> Reference:
    """The reference of a class of so many raters and providers, whose method `round` returns what
    is published."""

    def reference(rounds: Rounds, peers: Any) -> Iterator[Published]:
        slow = kind(len(peers), len(peers[0]), **parameters)
        return (slow.round(*each) for each in rounds)

    return reference


History = list[list[list[float | None]]]
"""Ratings by round, rater and provider; None where there is none."""

Trusts = list[tuple[list[float], list[float]]]
"""By round, the trust of the raters and that of the providers."""


def by_history(slow: Callable[..., Trusts], **parameters: float) -> Reference:
    """The reference of a function of a history."""
    return lambda rounds, peers: slow(
        [np.where(m, f, None).tolist() for f, m in rounds], **parameters
    )


DELIVERED, RECEIVED = (varied_rounds((5, 4, 2), 12, seed) for seed in (1, 2))
"""Rounds of ratings that were delivered, and of services that their raters received."""


def judge_trust(model: Any, rounds: list[Any], received: list[Any] | None = None) -> np.ndarray:
    """The trust of each judge after rounds of ratings, and of services that judges received."""
    like = np.zeros(rounds[0][0].shape)
    state = start_model(model, like, np.zeros(like.shape[:2], bool))
    for now, (values, mask) in enumerate(rounds):
        own = None if received is None else Ratings(*received[now])
        state = model.update(state, Ratings(values, mask, experience=own))
    trust: np.ndarray = model.judge_trust(state)
    return trust


def assert_matches_with_experience(
    model: Any, slow: Callable[..., Trusts], **parameters: float
) -> None:
    """The model computes what a function of delivered ratings and of received services does."""
    trust = judge_trust(model, DELIVERED, RECEIVED)
    for game in range(trust.shape[2]):
        delivered, received = (
            [np.where(m, f, None)[..., game].tolist() for f, m in rounds]
            for rounds in (DELIVERED, RECEIVED)
        )
        *_, (_, top) = slow(delivered, **parameters, received=received)
        np.testing.assert_allclose(trust[..., game].mean(axis=0), top, rtol=0, atol=1e-9)


def mean(values: Sequence[float], otherwise: float) -> float:
    """The mean of some values, or something else if there are none."""
    return sum(values) / len(values) if values else otherwise


def play(model: Any, *rounds: Sequence[Sequence[float | None]]) -> Any:
    """The state after rounds of ratings; None is no rating."""
    state = None
    for each in rounds:
        f = np.asarray(each, dtype=float)  # None becomes NaN
        state = start_model(model, f, np.zeros(f.shape, bool)) if state is None else state
        state = model.update(state, Ratings(f, ~np.isnan(f)))
    return state


def assert_gradients_are_finite(model: Any) -> None:
    """Of all that is published, by all ratings, among them equal, extreme and masked ones."""
    f, m = (np.array(parts) for parts in zip(*varied_rounds((3, 4), 15, seed=1), strict=True))
    f[5], f[6] = 0.5, np.arange(12).reshape(3, 4) % 2
    ratings = torch.asarray(f).requires_grad_()
    state = model.start(ratings[0].detach())
    for now, each in enumerate(ratings):
        state = model.update(state, Ratings(each, torch.asarray(m[now])))
    (model.rater_trust(state).sum() + model.provider_trust(state).sum()).backward()
    assert bool(torch.isfinite(ratings.grad).all())
    assert bool((ratings.grad[-1][m[-1]] != 0).any())
