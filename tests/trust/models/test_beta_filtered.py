"""Filtered Beta reputation against a slow reference, and what the filter drops."""

from functools import partial

import numpy as np
import pytest
from model_cases import assert_matches
from scipy import special

from roletrust_env.trust import Ratings, make_trust_model
from roletrust_env.trust.models.central import beta_reputation


def mean(raters, good, bad, initial):
    r, s = sum(good[i] for i in raters), sum(bad[i] for i in raters)
    return (r + 2 * initial) / (r + s + 2)


def heard(good, bad, q, initial):
    """Whom the filter keeps, of the successes and failures of one provider by rater; it ends by
    itself."""
    kept = [i for i in range(len(good)) if good[i] + bad[i] > 0]
    while True:
        center = mean(kept, good, bad, initial)
        still = [
            i
            for i in kept
            if special.betaincinv(1 + good[i], 1 + bad[i], q) <= center
            and special.betaincinv(1 + good[i], 1 + bad[i], 1 - q) >= center
        ]
        if still == kept or not still:
            return kept
        kept = still


def slow(rounds, peers, keep=0.9, initial=0.5, q=0.01):
    raters, providers = range(len(peers)), range(len(peers[0]))
    good, bad = ([[0.0 for _ in raters] for _ in providers] for _ in range(2))
    found = []
    for ratings, mask in rounds:
        for j in providers:
            if any(mask[i][j] for i in raters):
                for i in raters:
                    good[j][i] = keep * good[j][i] + (ratings[i][j] if mask[i][j] else 0)
                    bad[j][i] = keep * bad[j][i] + (1 - ratings[i][j] if mask[i][j] else 0)
        kept = [heard(good[j], bad[j], q, initial) for j in providers]
        tor = []
        for i in raters:
            rated = [j for j in providers if good[j][i] + bad[j][i] > 0]
            tor.append(sum(i in kept[j] for j in rated) / len(rated) if rated else initial)
        found.append((tor, [mean(kept[j], good[j], bad[j], initial) for j in providers]))
    return found


@pytest.mark.parametrize("parameters", [{}, {"keep": 0.95, "initial": 0.3, "q": 0.2}])
def test_it_is_the_formula(parameters) -> None:
    assert_matches(make_trust_model("beta-filtered", **parameters), partial(slow, **parameters))


def played(name: str, ratings: np.ndarray, rounds: int = 20):
    model = make_trust_model(name)
    state = model.start(ratings)
    for _ in range(rounds):
        state = model.update(state, Ratings(ratings))
    return model.rater_trust(state), model.provider_trust(state)


def test_one_of_two_raters_is_dropped() -> None:
    """Thirty good ratings by one, three bad ones by the other: the mean is beyond the quantiles of
    the second."""
    model = make_trust_model("beta-filtered", keep=1.0)
    state = model.start(np.zeros((2, 1)))
    state = state._replace(successes=np.array([[29.0], [0.0]]), failures=np.array([[0.0], [2.0]]))
    assert model.update(state, Ratings(np.array([[1.0], [0.0]]))).tor.tolist() == [1, 0]


def test_a_lone_liar_is_dropped() -> None:
    """Then trust is what the other four alone give, with r = 4 (1 + 0.9 + 0.81 + ...) below 40."""
    notes = np.full((5, 2), 1.0)
    notes[4, 0] = 0
    tor, top = played("beta-filtered", notes)
    r = 4 * (1 - 0.9**20) / (1 - 0.9)
    assert top == pytest.approx([(r + 1) / (r + 2), (1.25 * r + 1) / (1.25 * r + 2)])
    assert tor.tolist() == [1, 1, 1, 1, 0.5]
    assert played("beta", notes)[1][0] < 0.8


def test_the_majority_has_its_way_and_camps_of_like_size_stay() -> None:
    """Liars who are four of five drop the honest one; where they are three, the mean is too far
    from both camps."""
    notes = np.array([[1.0], [0], [0], [0], [0]])
    assert played("beta-filtered", notes)[0].tolist() == [0, 1, 1, 1, 1]
    notes[1] = 1
    assert played("beta-filtered", notes)[0].tolist() == [1, 1, 1, 1, 1]


def test_where_nobody_is_dropped_it_is_beta_reputation() -> None:
    notes = np.clip(0.6 + np.random.default_rng(0).normal(0, 0.05, (6, 3)), 0, 1)
    np.testing.assert_allclose(
        played("beta-filtered", notes)[1], played("beta", notes)[1], rtol=0, atol=1e-12
    )


def test_a_pass_that_would_drop_everybody_drops_nobody() -> None:
    """Each of 151 raters speaks for Beta(11, 1), of which 99% lie below 0.9991, and the mean is
    above that."""
    notes = np.ones((151, 1))
    _, top = played("beta-filtered", notes, 100)
    assert top[0] > special.betaincinv(11, 1, 0.99)
    assert np.array_equal(top, played("beta", notes, 100)[1])


def test_twelve_passes_are_enough_for_thirty_raters(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    liars = np.arange(30)[:, None] < 18 * rng.random(2_000)
    rates = np.clip(np.where(liars, 0, 1) + rng.normal(0, 0.1, (30, 2_000)), 0, 1)
    evidence = rng.uniform(0, 10, (30, 2_000))
    model = beta_reputation.BetaFiltered()
    pairs = Ratings(rates)
    kept, _ = model._filter(pairs, rates * evidence, (1 - rates) * evidence)
    for passes, same in ((29, True), (5, False)):
        monkeypatch.setattr(beta_reputation, "_PASSES", passes)
        assert (
            np.array_equal(model._filter(pairs, rates * evidence, (1 - rates) * evidence)[0], kept)
            == same
        )
