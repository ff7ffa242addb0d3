"""BLADE against a slow reference, against its network summed out, and cases by hand."""

import math
from functools import partial

import numpy as np
import pytest
from model_cases import assert_matches
from scipy import integrate, stats

from roletrust_env.trust import Ratings, make_trust_model


def parts(rating, levels):
    """The share of an observation of each level that a rating is."""
    return [max(0.0, 1 - abs(rating * (levels - 1) - x)) for x in range(levels)]


def projected(n, q):
    """The Dirichlet distribution with the mean and the mean square of a mixture: one more of x with
    chance q[x]."""
    total, each = sum(n), range(len(n))
    mean = [sum(q[x] * (n[y] + (x == y)) for x in each) / (total + 1) for y in each]
    square = sum(
        q[x] * (n[y] + (x == y)) * (n[y] + (x == y) + 1) / ((total + 1) * (total + 2))
        for x in each
        for y in each
    )
    squared = sum(m * m for m in mean)
    return [m * (1 - square) / (square - squared) for m in mean]


def slow(rounds, peers, levels=3, keep=0.9):
    raters, providers, each = range(len(peers)), range(len(peers[0])), range(levels)
    seen = {(i, j): [1.0] * levels for i in raters for j in providers}
    said = {(i, k): [[1.0] * levels for _ in each] for i in raters for k in raters}

    def faded(n, before):
        fade = keep ** max(0.0, sum(n) - sum(before))
        return [1 + fade * (value - 1) for value in n]

    def told(i, j, ratings, mask):
        chance = [n / sum(seen[i, j]) for n in seen[i, j]]
        for k in raters:
            if mask[k][j]:
                for x in each:
                    row = said[i, k][x]
                    for r, part in enumerate(parts(ratings[k][j], levels)):
                        chance[x] *= (row[r] / sum(row)) ** part
        return [c / sum(chance) for c in chance]

    found = []
    for ratings, mask in rounds:
        for i in raters:
            for k in raters:
                rows = [list(row) for row in said[i, k]]
                for j in providers:
                    if mask[i][j] and mask[k][j]:
                        for x, mine in enumerate(parts(ratings[i][j], levels)):
                            for r, its in enumerate(parts(ratings[k][j], levels)):
                                rows[x][r] += mine * its
                said[i, k] = [faded(rows[x], said[i, k][x]) for x in each]
        for i in raters:
            for j in providers:
                if mask[i][j]:
                    more = parts(ratings[i][j], levels)
                    seen[i, j] = faded(
                        [n + m for n, m in zip(seen[i, j], more, strict=True)], seen[i, j]
                    )
                elif any(mask[k][j] for k in raters):
                    seen[i, j] = faded(projected(seen[i, j], told(i, j, ratings, mask)), seen[i, j])

        def trust(i, j):
            return sum(x * n for x, n in enumerate(seen[i, j])) / (levels - 1) / sum(seen[i, j])

        def agreement(i, k):
            near = sum(
                (1 - abs(x - r) / (levels - 1)) * said[i, k][x][r] for x in each for r in each
            )
            return near / sum(map(sum, said[i, k]))

        top = [sum(trust(i, j) for i in raters) / len(raters) for j in providers]
        judges = [[i for i in raters if i != k] for k in raters]
        tor = [
            sum(agreement(i, k) for i in js) / len(js) if js else 1.0
            for k, js in zip(raters, judges, strict=True)
        ]
        found.append((tor, top))
    return found


@pytest.mark.parametrize("parameters", [{}, {"levels": 2, "keep": 1.0}, {"levels": 5, "keep": 0.7}])
def test_it_is_the_formula(parameters) -> None:
    assert_matches(make_trust_model("blade", **parameters), partial(slow, **parameters))


def test_one_round_of_advice_is_the_network_summed_out() -> None:
    """Two levels, a judge that has seen a provider, two advisers that it has met: all parameters
    are integrated over.

    The density of the provider's chance t of a good service, after the advice, is Beta(t; n) times
    the sum over the level x of the service of P(x | t) and the mean of P(r | x) under the Beta
    distribution of each adviser.
    """
    rng, model = np.random.default_rng(5), make_trust_model("blade", levels=2, keep=1.0)
    seen = np.round(rng.random((9, 2)))
    told = [np.where(rng.random((9, 2)) < right, seen, 1 - seen) for right in (0.8, 0.2)]
    state = model.start(np.zeros((3, 2)))
    for values in zip(seen, *told, strict=True):
        state = model.update(state, Ratings(np.array(values)))

    def chance(adviser: int, x: int, said: float) -> float:
        rows = told[adviser][seen == x]
        density = stats.beta(1 + (rows == said).sum(), 1 + (rows != said).sum()).pdf
        return float(integrate.quad(lambda p: p * density(p), 0, 1)[0])

    def moment(power: int, likely: list[float]) -> float:
        density = stats.beta(1 + seen[:, 0].sum(), 1 + (1 - seen[:, 0]).sum()).pdf
        return float(
            integrate.quad(
                lambda t: t**power * density(t) * ((1 - t) * likely[0] + t * likely[1]), 0, 1
            )[0]
        )

    mask = np.array([[False, False], [True, False], [True, False]])
    for advice in ([1.0, 0.0], [1.0, 1.0], [0.0, 1.0]):
        last = np.array([[0.0, 0.0], *([said, 0.0] for said in advice)])
        bad, good = model.update(state, Ratings(last, mask)).evidence[0, :, 0]
        likely = [chance(0, x, advice[0]) * chance(1, x, advice[1]) for x in (0, 1)]
        mass, mean, square = (moment(power, likely) for power in range(3))
        kept = stats.beta(good, bad)
        assert (kept.mean(), kept.moment(2)) == pytest.approx(
            (mean / mass, square / mass), abs=1e-9
        )


def test_three_rounds_by_hand() -> None:
    """A judge sees good, bad, good; its adviser says the contrary each time, and then calls a
    newcomer bad.

    After the two good services the adviser says bad of a good one with (1 + 2) / (2 + 2) = 3/4, and
    of a bad one with 1/3. The newcomer's service is good with 3/4 / (3/4 + 1/3) = 9/13, and trust
    in it is (1 + 9/13) / 3.
    """
    model = make_trust_model("blade", levels=2, keep=1.0)
    state, both, alone = (
        model.start(np.zeros((2, 2))),
        np.array([[True, False]] * 2),
        np.array([[False] * 2, [False, True]]),
    )
    for good in (1.0, 0.0, 1.0):
        state = model.update(state, Ratings(np.array([[good, 0.0], [1 - good, 0.0]]), both))
    assert state.common[0, 1, 1].tolist() == [3, 1]
    assert state.common[0, 0, 1].tolist() == [1, 2]
    state = model.update(state, Ratings(np.zeros((2, 2)), alone))
    assert state.trust[0] == pytest.approx([3 / 5, (1 + 9 / 13) / 3])
    assert state.credence[0, 1] == pytest.approx(2 / 7)


def test_advice_of_strangers_changes_nothing_and_certain_advice_counts_one() -> None:
    model = make_trust_model("blade")
    state, mask = (
        model.start(np.zeros((3, 2))),
        np.array([[False, False], [True, True], [True, True]]),
    )
    after = model.update(state, Ratings(np.ones((3, 2)), mask))
    np.testing.assert_allclose(after.evidence[0], state.evidence[0], rtol=0, atol=1e-15)
    known = np.ones_like(state.common)
    known[0, :, 1] = 1e9 * np.eye(3) + 1e-9
    after = make_trust_model("blade", keep=1.0).update(
        state._replace(common=known), Ratings(np.ones((3, 2)), mask)
    )
    assert after.evidence[0, :, 0] == pytest.approx([1, 1, 2], abs=1e-6)


def test_a_liar_that_is_always_wrong_tells_as_much_as_who_is_right() -> None:
    """Judges that met both providers learn what two advisers say; then one serves, and only the
    advisers meet it."""
    rng, model = np.random.default_rng(0), make_trust_model("blade", keep=1.0)
    truth = rng.random((40, 2)) < 0.5
    trusts = []
    for lies in (False, True):
        state = model.start(np.zeros((2, 3)))
        for good in truth:
            values = np.array([[*good, 0.0], [*(good ^ lies), 0.0]], float)
            state = model.update(state, Ratings(values, np.array([[True, True, False]] * 2)))
        for _ in range(5):
            values, mask = np.zeros((2, 3)), np.zeros((2, 3), bool)
            values[1, 2], mask[1, 2] = not lies, True
            state = model.update(state, Ratings(values, mask))
        trusts.append(state.trust[0, 2])
    assert trusts[0] > 0.75
    assert math.isclose(trusts[0], trusts[1], abs_tol=1e-12)
    assert state.credence[0, 1] < 0.1
