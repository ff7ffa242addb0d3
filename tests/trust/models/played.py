"""Random games for comparing a model with a slow reference, which is written for one game in plain numbers."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from roletrust_env.trust import Ratings

SHAPES = [(1, 4), (4, 1), (1, 1), (3, 3), (5, 2), (6, 4)]
KINDS = [(np.asarray, np.float64, 1e-9), (torch.asarray, np.float64, 1e-9), (torch.asarray, np.float32, 1e-4)]


def random_game(shape: tuple[int, ...], rounds: int = 15, seed: int = 0) -> list[tuple[np.ndarray, np.ndarray]]:
    """Ratings, NaN where nobody rates, and masks; the last rater and provider come late, and one round is silent."""
    rng, game = np.random.default_rng(seed), []
    quality = rng.random((1, *shape[1:]))
    for now in range(rounds):
        ratings = np.clip(quality + rng.normal(0, 0.3, shape), 0, 1)
        ratings[0] = 1 - quality[0]  # a liar
        mask = rng.random(shape) < 0.7
        if now < rounds // 3:
            mask[-1] = mask[:, -1] = False
        mask &= now != rounds // 2
        game.append((np.where(mask, ratings, np.nan), mask))
    return game


def compare(model: Any, reference: Callable[..., Any], shape: tuple[int, int], kind: tuple[Any, Any, float]) -> None:
    """Play a batch of two games and, one by one, the reference: a list of (rater trust, provider trust) by round."""
    asarray, dtype, within = kind
    game = random_game((*shape, 2))
    wanted = [reference([(f[..., e].tolist(), m[..., e].tolist()) for f, m in game]) for e in range(2)]
    state = model.start(asarray(np.zeros((*shape, 2), dtype)))
    for now, (ratings, mask) in enumerate(game):
        state = model.update(state, Ratings(asarray(ratings.astype(dtype)), asarray(mask)))
        for e in range(2):
            for read, trust in zip((model.rater_trust, model.provider_trust), wanted[e][now], strict=True):
                np.testing.assert_allclose(np.asarray(read(state))[..., e], trust, rtol=0, atol=within)
