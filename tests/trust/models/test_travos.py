"""TRAVOS against a slow reference, and a case by hand."""

import math
from functools import partial

import numpy as np
import pytest
from model_cases import assert_matches
from scipy import special

from roletrust_env.trust import Ratings, make_trust_model


def mass(a, b, low, high):
    return special.betainc(a, b, min(high, 1)) - special.betainc(a, b, max(low, 0))


def weakened(r, s, rho):
    """The successes and failures that a judge makes of r and s, believing them as far as rho."""
    flat = math.sqrt(1 / 12)
    mu = (r + 1) / (r + s + 2)
    sd = math.sqrt((r + 1) * (s + 1) / ((r + s + 2) ** 2 * (r + s + 3)))
    mu, sd = 0.5 + rho * (mu - 0.5), flat + rho * (sd - flat)
    return (mu**2 - mu**3) / sd**2 - mu - 1, ((1 - mu) ** 2 - (1 - mu) ** 3) / sd**2 - (1 - mu) - 1


def slow(rounds, peers, error=0.2, threshold=0.95, bins=5):
    raters, providers = range(len(peers)), range(len(peers[0]))
    good, bad = ([[0.0 for _ in providers] for _ in raters] for _ in range(2))
    after, found = {}, []  # after opinions: (judge, adviser, bin) -> [successes, failures]

    def opinion(k, j):
        seen = good[k][j] + bad[k][j]
        return int((good[k][j] + 1) / (seen + 2) * bins) if seen else None

    def rho(i, k, part):
        right, wrong = after.get((i, k, part), (0, 0))
        return mass(right + 1, wrong + 1, part / bins, (part + 1) / bins)

    for ratings, mask in rounds:
        for i in raters:
            for k in raters:
                for j in providers:
                    if mask[i][j] and opinion(k, j) is not None:
                        counts = after.setdefault((i, k, opinion(k, j)), [0, 0])
                        counts[0] += ratings[i][j]
                        counts[1] += 1 - ratings[i][j]
        for i in raters:
            for j in providers:
                if mask[i][j]:
                    good[i][j] += ratings[i][j]
                    bad[i][j] += 1 - ratings[i][j]
        top = []
        for j in providers:
            trust = 0
            for i in raters:
                m, n = good[i][j], bad[i][j]
                mu = (m + 1) / (m + n + 2)
                if mass(m + 1, n + 1, mu - error, mu + error) <= threshold:
                    for k in raters:
                        if k != i and opinion(k, j) is not None:
                            more, less = weakened(good[k][j], bad[k][j], rho(i, k, opinion(k, j)))
                            m, n = m + more, n + less
                    mu = (m + 1) / (m + n + 2)
                trust += mu / len(raters)
            top.append(trust)
        tor = []
        for k in raters:
            held = [opinion(k, j) for j in providers if opinion(k, j) is not None]
            judges = [i for i in raters if i != k]
            credence = [
                sum(rho(i, k, part) for part in held) / len(held) if held else 1 / bins
                for i in judges
            ]
            tor.append(sum(credence) / len(judges) if judges else 1.0)
        found.append((tor, top))
    return found


@pytest.mark.parametrize("parameters", [{}, {"error": 0.1, "threshold": 0.7, "bins": 3}])
def test_it_is_the_formula(parameters) -> None:
    assert_matches(make_trust_model("travos", **parameters), partial(slow, **parameters))


def test_a_first_round_by_hand() -> None:
    """The first of two saw one success, so mu = 2/3, and the mass of Beta(2, 1) above 7/15 and
    below 13/15 is 8/15.

    It asks the second, which saw one failure: mu = 1/3, sd = 1 / sqrt(18), in the second bin, which
    holds 1/5 of what has never been tried. So mu' = 7/15 and sd' = 0.8 / sqrt(12) + 0.2 / sqrt(18)
    = 0.27808.
    """
    model = make_trust_model("travos")
    state = model.update(model.start(np.zeros((2, 1))), Ratings(np.array([[1.0], [0.0]])))
    k = 7 / 15 * 8 / 15 / 0.278080**2 - 1
    more, less = 7 / 15 * k - 1, 8 / 15 * k - 1
    assert (more, less) == pytest.approx((0.03536, 0.18327), abs=1e-4)
    trust = (1 + more + 1) / (1 + more + less + 2)
    assert state.trust[:, 0] == pytest.approx([trust, 1 - trust], abs=1e-5)
    assert model.rater_trust(state) == pytest.approx([0.2, 0.2])


def test_a_liar_loses_credence_and_its_say() -> None:
    """Two providers are good and one is bad, and it says the contrary; a judge that never saw the
    first is told."""
    model = make_trust_model("travos")
    notes = np.array([[1.0, 1.0, 0.0]] * 4 + [[0.0, 0.0, 1.0]])
    mask = np.ones(notes.shape, bool)
    mask[0, 0] = False
    state = model.start(notes)
    for _ in range(10):
        state = model.update(state, Ratings(notes, mask))
    tor = model.rater_trust(state)
    assert tor[4] < 0.01
    assert tor[:4].min() > 0.6
    assert state.trust[0, 0] > 0.8


def test_with_a_threshold_of_1_even_who_is_certain_asks() -> None:
    """All of the distribution lies within 1 of its mean, so confidence is 1."""
    rounds = np.array([[1.0], [0.0]])
    asks, asks_nobody = (make_trust_model("travos", error=1.0, threshold=x) for x in (1.0, 0.999))
    alone, advised = (
        m.update(m.start(rounds), Ratings(rounds)).trust[:, 0] for m in (asks_nobody, asks)
    )
    assert alone == pytest.approx([2 / 3, 1 / 3])
    assert advised[0] < 0.66
    assert advised[1] > 0.34
