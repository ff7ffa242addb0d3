"""What every trust model with a name keeps to on torch: the same trust, one graph for a compiler,
gradients."""

from typing import Any

import numpy as np
import pytest
import torch
from model_cases import (
    EVERY_MODEL,
    RoundRatings,
    arrays,
    assert_close,
    having,
    named,
    play,
    random_rounds,
    read,
)

from roletrust_agents.smooth import SmoothRoleTrust
from roletrust_env.testing.trust_models import check_torch
from roletrust_env.trust import Ratings, make_trust_model

SHAPES = [(3, 3), (1, 1), (2, 5, 6)]


def calm_rounds(shape: tuple[int, ...], count: int = 12) -> list[RoundRatings]:
    """Providers differ, their raters differ a little, and about two pairs of three meet."""
    rng = np.random.default_rng(2)
    quality = rng.uniform(0.2, 0.8, shape[1:])
    notes = [
        (quality + rng.uniform(-0.15, 0.15, shape)).astype(np.float32).astype(np.float64)
        for _ in range(count)
    ]
    return [RoundRatings.of(ratings, rng.random(shape) < 0.7) for ratings in notes]


@EVERY_MODEL
def test_torch_computes_what_numpy_does_and_single_precision_is_enough(name: str) -> None:
    model = named(name)
    for shape in SHAPES:
        check_torch(model, shape)
        rounds = calm_rounds(shape)
        singles = [RoundRatings(ratings.astype(np.float32), mask) for ratings, mask in rounds]
        state = play(model, singles, torch.zeros(shape), asarray=torch.asarray)
        assert not any(
            leaf.dtype == torch.float64 for leaf in arrays(state) if isinstance(leaf, torch.Tensor)
        )
        found = read(model, state)
        assert all(
            isinstance(trust, torch.Tensor) and trust.dtype == torch.float32 for trust in found
        )
        assert_close(found, read(model, play(model, rounds, np.zeros(shape))), 1e-4)


@EVERY_MODEL
@pytest.mark.slow
def test_a_round_compiles_into_one_graph(name: str) -> None:
    """Without the slow part: the graph is caught whole, and played as it is."""
    torch.compiler.reset()
    model, shape = named(name), (3, 4, 2)

    @torch.compile(fullgraph=True, backend="eager")
    def compiled(state: Any, ratings: torch.Tensor, mask: torch.Tensor) -> Any:
        state = model.update(state, Ratings(ratings, mask))
        return state, read(model, state)

    rounds = [
        RoundRatings(ratings.astype(np.float32), mask) for ratings, mask in calm_rounds(shape, 4)
    ]
    state = play(model, [], torch.zeros(shape), asarray=torch.asarray)
    for played, (ratings, mask) in enumerate(rounds, 1):
        state, found = compiled(state, torch.asarray(ratings), torch.asarray(mask))
        plain = play(model, rounds[:played], torch.zeros(shape), asarray=torch.asarray)
        assert_close(found, read(model, plain), 1e-5)


@having("differentiable")
def test_gradients_are_finite(name: str) -> None:
    """Also of masked cells, of a provider that nobody or only one rates, and where raters agree."""
    model = (
        SmoothRoleTrust(lam=0.7, initial=0.3) if name == "role-trust" else named(name)
    )  # its root is steep at 0
    shape = (4, 3, 5)
    for agreed in (None, 0.75, 0.0, 1.0):
        state, given = (
            play(model, [], torch.zeros(shape, dtype=torch.float64), asarray=torch.asarray),
            [],
        )
        for ratings, mask in random_rounds(shape, 6):
            values = (
                ratings if agreed is None else RoundRatings.of(np.full(shape, agreed), mask).ratings
            )
            given.append(torch.tensor(values, requires_grad=True))
            state = model.update(state, Ratings(given[-1], torch.asarray(mask)))
        torch.stack([trust.sum() for trust in read(model, state)]).sum().backward()
        assert all(
            ratings.grad is not None and bool(ratings.grad.isfinite().all()) for ratings in given
        )
        assert agreed is not None or any(bool((ratings.grad != 0).any()) for ratings in given)


@pytest.mark.parametrize("name", ["first-hand", "leave-one-out"])
@pytest.mark.parametrize("power", [0.0, 0.3, 1.0, 6.0])
def test_gradients_are_finite_where_a_rater_agrees_with_nobody(name: str, power: float) -> None:
    """Without doubt, the agreement of a lone rater, or of one at the other end, is 0, where a root
    is steep."""
    model = make_trust_model(name, doubt=0.0, power=power)
    ratings = torch.tensor(
        [[[1.0, 1.0], [0.0, 0.0], [0.4, 0.7]]] * 2, dtype=torch.float64, requires_grad=True
    )
    mask = torch.tensor([[True, False], [False, True], [False, False]])
    state = model.start(ratings[0].detach())
    for values in ratings:
        state = model.update(state, Ratings(values, mask))
        mask = torch.tensor([[True, True], [True, True], [False, True]])
    (model.rater_trust(state).sum() + model.provider_trust(state).sum()).backward()
    assert ratings.grad is not None
    assert bool(torch.isfinite(ratings.grad).all())
