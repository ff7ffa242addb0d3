"""HABIT against a slow reference, against its hypotheses with all parameters integrated out, and
cases by hand."""

import math
from functools import partial

import numpy as np
import pytest
from model_cases import assert_matches
from scipy import integrate, stats

from roletrust_env.trust import Ratings, make_trust_model


def log_beta(parameters):
    return sum(map(math.lgamma, parameters)) - math.lgamma(sum(parameters))


def added(*lists):
    return [sum(numbers) for numbers in zip(*lists, strict=True)]


def slow(rounds, peers, levels=3, alpha=1.0):
    """As the first author's code goes, judge by judge, with the integral of two densities as it
    comes out."""
    raters, providers, each = range(len(peers)), range(len(peers[0])), range(levels)
    seen = {(k, j): [0.0] * levels for k in raters for j in providers}
    prior, found = [1.0] * levels, []

    def evidence(i, j, like):
        """What judge i saw of j, and the opinions of all others, if j is like a provider, or like
        none."""
        before = added(prior, seen[i, like]) if like is not None else prior
        weight = log_beta(added(before, seen[i, j])) - log_beta(before)
        for k in raters:
            if k != i:
                one = added(prior, seen[k, j])
                other = added(prior, seen[k, like]) if like is not None else prior
                weight += log_beta([a + b - 1 for a, b in zip(one, other, strict=True)])
                weight -= log_beta(one) + log_beta(other)
        return weight, added(before, seen[i, j])

    def trust(i, j):
        rated = [
            like for like in providers if like != j and any(sum(seen[k, like]) for k in raters)
        ]
        parts = [evidence(i, j, like) for like in (None, *rated)]
        top = max(weight for weight, _ in parts)
        shares = [math.exp(weight - top) for weight, _ in parts]
        shares[0] *= alpha
        means = [
            sum(x * n for x, n in enumerate(after)) / (levels - 1) / sum(after)
            for _, after in parts
        ]
        return sum(s * m for s, m in zip(shares, means, strict=True)) / sum(shares)

    for ratings, mask in rounds:
        for k in raters:
            for j in providers:
                if mask[k][j]:
                    part = [max(0.0, 1 - abs(ratings[k][j] * (levels - 1) - x)) for x in each]
                    seen[k, j] = added(seen[k, j], part)
        found.append(
            (
                [1.0] * len(raters),
                [sum(trust(i, j) for i in raters) / len(raters) for j in providers],
            )
        )
    return found


@pytest.mark.parametrize(
    "parameters", [{}, {"levels": 2, "alpha": 5.0}, {"levels": 5, "alpha": 0.1}]
)
def test_it_is_the_formula(parameters) -> None:
    assert_matches(make_trust_model("habit", **parameters), partial(slow, **parameters))


def state_after(*rounds, **parameters):
    """The model, and its state after rounds of ratings, NaN where nobody rated."""
    model = make_trust_model("habit", levels=2, **parameters)
    state = model.start(np.zeros(np.shape(rounds[0])))
    for values in np.array(rounds, float):
        state = model.update(state, Ratings(values, ~np.isnan(values)))
    return state


def test_it_is_the_hypotheses_with_all_parameters_integrated_out() -> None:
    """Provider 0 is like 1, like 2 or like none; each agent's ratings of the two have one chance of
    a good service."""
    rng, alpha = np.random.default_rng(3), 0.7
    rounds = np.where(rng.random((12, 3, 3)) < 0.6, np.round(rng.random((12, 3, 3))), np.nan)
    good, bad = (rounds == 1).sum(axis=0), (rounds == 0).sum(axis=0)

    def integral(k: int, like: int | None, power: int) -> float:
        density = (
            stats.beta(1 + good[k, like], 1 + bad[k, like]).pdf
            if like is not None
            else stats.beta(1, 1).pdf
        )
        return float(
            integrate.quad(
                lambda p: density(p) * p ** (good[k, 0] + power) * (1 - p) ** bad[k, 0], 0, 1
            )[0]
        )

    trust = state_after(*rounds, alpha=alpha).trust
    for i in range(3):
        chances = [
            weight * math.prod(integral(k, like, 0) for k in range(3))
            for weight, like in ((alpha, None), (1, 1), (1, 2))
        ]
        means = [integral(i, like, 1) / integral(i, like, 0) for like in (None, 1, 2)]
        assert trust[i, 0] == pytest.approx(np.average(means, weights=chances), abs=1e-9)


def test_evidence_of_many_raters_does_not_overflow() -> None:
    model = make_trust_model("habit")
    state = model.start(np.zeros((100, 2)))
    best = np.array([[[0], [0], [5000]]])
    state = state._replace(own=state.own + best, said=state.said + best)
    state = model.update(state, Ratings(np.ones((100, 2))))
    assert state.trust == pytest.approx(np.ones((100, 2)), abs=1e-3)


def test_one_round_by_hand() -> None:
    """A judge saw a good service of one provider; its adviser saw one of each, both good, or the
    second one bad.

    B(3, 1) B(1, 1) / B(2, 1)^2 = 4/3 and B(2, 2) B(1, 1) / B(2, 1)^2 = 2/3, so the second is like
    the first with 4/7 or with 2/5. The judge then expects 2/3 of it, and 1/2 otherwise.
    """
    trust = state_after([[1, np.nan], [1, 1]]).trust
    assert trust[0, 1] == pytest.approx(4 / 7 * 2 / 3 + 3 / 7 / 2)
    assert trust[1, 1] == pytest.approx(4 / 7 * 3 / 4 + 3 / 7 * 2 / 3)
    assert state_after([[1, np.nan], [1, 0]]).trust[0, 1] == pytest.approx(
        2 / 5 * 2 / 3 + 3 / 5 / 2
    )


def test_who_always_says_the_contrary_is_of_the_same_use_and_a_silent_provider_of_none() -> None:
    rng = np.random.default_rng(0)
    rounds = np.where(rng.random((20, 4, 5)) < 0.5, np.round(0.8 * rng.random((20, 4, 5))), np.nan)
    trust = state_after(*rounds).trust
    lies = rounds.copy()
    lies[:, 3] = 1 - lies[:, 3]
    np.testing.assert_allclose(state_after(*lies).trust[:3], trust[:3], rtol=0, atol=1e-12)
    wider = np.concatenate([rounds, np.full((20, 4, 2), np.nan)], axis=2)
    np.testing.assert_allclose(state_after(*wider).trust[:, :5], trust, rtol=0, atol=1e-12)


def test_a_judge_learns_of_a_provider_that_it_never_met_unless_an_adviser_lies_of_it_alone() -> (
    None
):
    """It met four providers, two of them good; four advisers met all. The last lies of all, or of
    the fifth alone."""
    seen, honest = [1, 1, 0, 0, np.nan], [[1, 1, 0, 0, 1]] * 3
    assert state_after(*[[seen, *honest, [0, 0, 1, 1, 0]]] * 10).trust[0, 4] > 0.85
    assert state_after(*[[seen, *honest, [1, 1, 0, 0, 0]]] * 10).trust[0, 4] == pytest.approx(
        0.5, abs=0.01
    )
