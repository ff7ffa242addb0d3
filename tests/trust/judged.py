"""How the personal models are tested: random games, played by a model and by a slow reference of it."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import pytest
import torch

from roletrust_env.trust import Ratings

Matrix = list[list[Any]]

SHAPES = pytest.mark.parametrize("shape", [(3, 3), (1, 4), (5, 1), (4, 6), (1, 1)], ids=str)


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


class Reference(Protocol):
    """A model of one game, loop by loop, in plain Python."""

    def round(self, f: Matrix, m: Matrix) -> Published:
        """What is published after one more round of ratings f inside the mask m."""
        ...


def random_game(shape: tuple[int, int], seed: int, rounds: int = 15) -> tuple[np.ndarray, np.ndarray]:
    """Ratings and masks of shape (rounds, S, P), with late comers, a round without ratings, and NaN outside."""
    rng = np.random.default_rng(seed)
    f, m = rng.random((rounds, *shape)), rng.random((rounds, *shape)) < rng.choice([0.4, 0.9])
    m[: rounds // 3, -1:, :] &= shape[0] == 1
    m[: rounds // 2, :, -1:] &= shape[1] == 1
    m[2] = m[-2] = False
    return np.where(m, f, np.nan), m


def assert_follows(model: Any, reference: Callable[[int, int], Reference], shape: tuple[int, int]) -> None:
    """NumPy to 1e-9 and torch in float32 to 1e-4, game by game of a batch."""
    games = [random_game(shape, seed) for seed in range(6)]
    f, m = (np.stack(parts, axis=-1) for parts in zip(*games, strict=True))
    slow = [reference(*shape) for _ in games]
    state = model.start(f[0])
    single = model.start(torch.asarray(f[0], dtype=torch.float32))
    for now in range(len(f)):
        state = model.update(state, Ratings(f[now], m[now]))
        single = model.update(single, Ratings(torch.asarray(f[now], dtype=torch.float32), torch.asarray(m[now])))
        wanted = [one.round(f[now, ..., e].tolist(), m[now, ..., e].tolist()) for e, one in enumerate(slow)]
        for read, expected in (
            (model.rater_trust, [each.raters for each in wanted]),
            (model.provider_trust, [each.providers for each in wanted]),
        ):
            assert (read(state).dtype, read(single).dtype) == (np.float64, torch.float32)
            np.testing.assert_allclose(read(state), np.transpose(expected), rtol=0, atol=1e-9)
            np.testing.assert_allclose(read(single).numpy(), np.transpose(expected), rtol=0, atol=1e-4)


def play(model: Any, *rounds: Sequence[Sequence[float | None]]) -> Any:
    """The state after rounds of ratings; None is no rating."""
    state = None
    for each in rounds:
        f = np.asarray(each, dtype=float)  # None becomes NaN
        state = model.start(f) if state is None else state
        state = model.update(state, Ratings(f, ~np.isnan(f)))
    return state


def assert_gradients_are_finite(model: Any) -> None:
    """Of all that is published, by all ratings, among them equal, extreme and masked ones."""
    f, m = random_game((3, 4), seed=1)
    f[5], f[6] = 0.5, np.arange(12).reshape(3, 4) % 2
    ratings = torch.asarray(f).requires_grad_()
    state = model.start(ratings[0].detach())
    for now, each in enumerate(ratings):
        state = model.update(state, Ratings(each, torch.asarray(m[now])))
    (model.rater_trust(state).sum() + model.provider_trust(state).sum()).backward()
    assert bool(torch.isfinite(ratings.grad).all())
    assert bool((ratings.grad[-1][m[-1]] != 0).any())
