"""The regression-aligned mean against a least-squares solver, pair by pair, and what it is for."""

import numpy as np
import pytest
from judged import History, Trusts, by_history, mean, play
from model_cases import assert_matches

from roletrust_env.trust import make_trust_model


def slow(history: History, lam: float, initial: float, ridge: float) -> Trusts:
    raters, providers = range(len(history[0])), range(len(history[0][0]))
    trust = [[initial for _ in providers] for _ in raters]
    found = []
    for now, current in enumerate(history):

        def aligned(i: int, k: int, note: float, now: int = now) -> float:
            """By least squares with two made-up rows, which are what a ridge comes to."""
            pairs = [
                (at[k][j], at[i][j])
                for at in history[:now]
                for j in providers
                if at[i][j] is not None and at[k][j] is not None
            ]
            center = mean([x for x, _ in pairs], 0.0)
            rows = [[1.0, x - center] for x, _ in pairs] + [[ridge**0.5, 0.0], [0.0, ridge**0.5]]
            shift, slope = np.linalg.lstsq(
                np.array(rows), np.array([y - x for x, y in pairs] + [0, 0])
            )[0]
            return min(1.0, max(0.0, note + shift + slope * (note - center)))

        for i in raters:
            for j in providers:
                heard = [aligned(i, k, current[k][j]) for k in raters if current[k][j] is not None]
                trust[i][j] = lam * mean(heard, trust[i][j]) + (1 - lam) * trust[i][j]
        found.append(
            ([1.0 for _ in raters], [mean([trust[i][j] for i in raters], 0) for j in providers])
        )
    return found


@pytest.mark.parametrize(
    "parameters",
    [{"lam": 0.5, "initial": 0.5, "ridge": 1.0}, {"lam": 0.8, "initial": 0.3, "ridge": 0.05}],
)
def test_it_is_a_ridge_regression_for_each_pair(parameters: dict[str, float]) -> None:
    assert_matches(
        make_trust_model("regression-aligned", **parameters), by_history(slow, **parameters)
    )


def test_a_constant_difference_is_unlearnt_by_hand() -> None:
    """One rates 1 and the other 0.5, so b = N / 2 / (N + 1), downwards for the one and upwards for
    the other.

    Round 1: both hear 0.75. Round 2, N = 1, b = 1/4: the one hears (1 + 0.75) / 2, the other (0.75
    + 0.5) / 2. Round 4, N = 3, b = 3/8: the one hears (1 + 0.875) / 2, the other (0.625 + 0.5) / 2.
    """
    model = make_trust_model(
        "regression-aligned", lam=0.999
    )  # so that the newest round is all but alone
    apart = []
    for rounds in (1, 2, 4):
        apart.append(play(model, *[[[1.0], [0.5]]] * rounds).trust[:, 0].tolist())
    assert apart[0] == pytest.approx([0.75, 0.75], abs=1e-3)
    assert apart[1] == pytest.approx([0.875, 0.625], abs=1e-3)
    assert apart[2] == pytest.approx([0.9375, 0.5625], abs=1e-3)


def test_ratings_turned_round_are_turned_back() -> None:
    """Who always says 1 - v is heard as saying v, once the judge has seen enough of it."""
    rng = np.random.default_rng(0)
    model = make_trust_model("regression-aligned", ridge=0.1)
    state = play(model, *([(v := rng.random(4)).tolist(), (1 - v).tolist()] for _ in range(200)))
    slope, base = model._lines(state.moments)
    assert base[0, 1] + (1 + slope[0, 1]) * 0.9 == pytest.approx(0.1, abs=0.01)
    assert model.rater_trust(state).tolist() == [1, 1]
