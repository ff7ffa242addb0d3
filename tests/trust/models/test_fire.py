"""FIRE, interaction and witness parts, against its formulas and by hand."""

from math import exp, log

import pytest
from judged import Matrix, Published, play, round_by_round
from model_cases import assert_matches

from roletrust_env.trust import make_trust_model

L, GAMMA = -5 / log(0.5), -log(0.5)


def weighted_mean(rated: list[tuple[float, float]]) -> float:
    """Of pairs of weight and value."""
    return sum(w * v for w, v in rated) / sum(w for w, _ in rated)


def reliability(rated: list[tuple[float, float]], mean: float) -> float:
    enough = 1 - exp(-GAMMA * sum(w for w, _ in rated))
    return enough * (1 - weighted_mean([(w, abs(v - mean)) for w, v in rated]) / 2)


class Slow:
    """The formulas, judge by judge; everybody keeps every rating it gave with its round."""

    def __init__(
        self,
        raters: int,
        providers: int,
        tolerance: float = 0.5,
        credibility: float = 0.5,
        initial: float = 0.5,
    ) -> None:
        self.judges, self.providers = range(raters), range(providers)
        self.tolerance, self.unknown, self.now = tolerance, credibility, 0
        self.given: Matrix = [[[] for _ in self.providers] for _ in self.judges]
        self.found: Matrix = [[[] for _ in self.judges] for _ in self.judges]
        self.trust = [[initial] * providers for _ in self.judges]

    def round(self, f: Matrix, m: Matrix) -> Published:
        self.now += 1
        for j in self.providers:
            for i in self.judges:
                if m[i][j]:
                    self.given[i][j].append((self.now, 2 * f[i][j] - 1))
                for k in self.judges:
                    if m[i][j] and m[k][j]:
                        off = abs((2 * f[k][j] - 1) - (2 * f[i][j] - 1))
                        self.found[i][k].append((self.now, 1 - off if off < self.tolerance else -1))
        for j in self.providers:
            if any(m[i][j] for i in self.judges):
                for i in self.judges:
                    self.judge(i, j)
        credence = [[(self.credibility(i, k) + 1) / 2 for k in self.judges] for i in self.judges]
        return Published.by(self.trust, credence)

    def aged(self, rated: list[tuple[int, float]]) -> list[tuple[float, float]]:
        return [(exp(-(self.now - when) / L), value) for when, value in rated]

    def credibility(self, i: int, k: int) -> float:
        return weighted_mean(self.aged(self.found[i][k])) if self.found[i][k] else self.unknown

    def judge(self, i: int, j: int) -> None:
        own = self.aged(self.given[i][j][-10:])
        heard = []
        for k in self.judges:
            credibility = self.credibility(i, k)
            if k != i and credibility > 0:
                heard += [(credibility * w, v) for w, v in self.aged(self.given[k][j][-1:])]
        parts = []
        for component_weight, rated in ((2, own), (1, heard)):
            if rated:
                component = weighted_mean(rated)
                parts.append((component_weight * reliability(rated, component), component))
        if parts:
            self.trust[i][j] = (weighted_mean(parts) + 1) / 2


@pytest.mark.parametrize("parameters", [{}, {"tolerance": 1.2, "credibility": 0.1, "initial": 0.9}])
def test_it_is_the_formula(parameters: dict[str, float]) -> None:
    assert_matches(make_trust_model("fire", **parameters), round_by_round(Slow, **parameters))


def test_by_hand() -> None:
    """Three raters, one provider; the third lies, and is off by 2, more than 0.5.

    The honest find each other's credibility to be 1 and the liar's -1, so its word weighs 0. One
    rating of weight 1 has the reliability 1 - exp(-g) = 0.5 and makes T = 1; the liar, who believes
    no witness, has T = 0.
    """
    model = make_trust_model("fire")
    state = play(model, [[1], [1], [0]])
    assert state.trust[:, 0] == pytest.approx([1, 1, 0])
    assert model.rater_trust(state) == pytest.approx([0.5, 0.5, 0])


def test_a_witness_at_the_tolerance_is_not_within_it() -> None:
    """Ratings 0.25 apart differ by 0.5 on the scale from -1 to 1, which is not below the tolerance
    0.5."""
    state = play(make_trust_model("fire"), [[0.5], [0.75]])
    assert state.credibility[0, 1] == -1


def test_witnesses_of_unknown_credibility_by_hand() -> None:
    """The judge rated 1, and a round later a stranger rates 0.

    Own: value 1, weight .5^(1/5). Witness: value -1, weight .5 (the default). Neither deviates from
    itself.
    """
    model = make_trust_model("fire")
    state = play(model, [[1], [None]], [[None], [0]])
    own, witness = 2 * (1 - 0.5**0.5**0.2), 1 * (1 - 0.5**0.5)
    assert state.trust[0, 0] == pytest.approx(0.5 + 0.5 * (own - witness) / (own + witness))


def test_the_last_ten_ratings_count() -> None:
    model = make_trust_model("fire")
    state = play(model, *[[[0.0]]] * 7, *[[[0.8]]] * 10)
    assert model.provider_trust(state) == pytest.approx([0.8])


def test_evidence_that_faded_beyond_all_numbers_leaves_trust_as_it_was() -> None:
    """The judge knew the provider long ago, and all that it hears since is a witness of no
    credibility."""
    model = make_trust_model("fire")
    first = [[0.9, 1.0], [None, 0.0]]
    later = [[None, 1.0], [None, 0.0]]
    state = play(model, first, *[later] * 600, [[None, 1.0], [0.1, 0.0]])
    assert state.trust[:, 0] == pytest.approx([0.9, 0.1])
