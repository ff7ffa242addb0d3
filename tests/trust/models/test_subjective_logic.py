"""Trust networks in subjective logic, against the formulas and by hand."""

import pytest
from judged import Matrix, Published, assert_gradients_are_finite, play, round_by_round
from model_cases import assert_matches

from roletrust_env.trust import make_trust_model

Three = tuple[float, float, float]


def opinion(r: float, s: float) -> Three:
    return r / (r + s + 2), s / (r + s + 2), 2 / (r + s + 2)


def discount(trust: Three, advice: Three) -> Three:
    (b1, d1, u1), (b2, d2, u2) = trust, advice
    return b1 * b2, b1 * d2, d1 + u1 + b1 * u2


def fuse(one: Three, two: Three) -> Three:
    (b1, d1, u1), (b2, d2, u2) = one, two
    k = u1 + u2 - u1 * u2
    return (b1 * u2 + b2 * u1) / k, (d1 * u2 + d2 * u1) / k, u1 * u2 / k


class Slow:
    """The formulas, judge by judge, advisers fused one after the other."""

    def __init__(self, raters: int, providers: int, initial: float = 0.5) -> None:
        self.judges, self.providers, self.base_rate = range(raters), range(providers), initial
        self.seen: Matrix = [[[] for _ in self.providers] for _ in self.judges]
        self.alike: Matrix = [[[] for _ in self.judges] for _ in self.judges]
        self.trust = [[initial] * providers for _ in self.judges]

    def round(self, f: Matrix, m: Matrix) -> Published:
        for j in self.providers:
            for i in self.judges:
                if m[i][j]:
                    self.seen[i][j].append(f[i][j])
                for k in self.judges:
                    if m[i][j] and m[k][j]:
                        self.alike[i][k].append(1 - abs(f[i][j] - f[k][j]))
        for j in self.providers:
            if any(m[i][j] for i in self.judges):
                for i in self.judges:
                    self.trust[i][j] = self.expected(self.judge(i, j))
        credence = [
            [self.expected(self.of(self.alike[i][k])) for k in self.judges] for i in self.judges
        ]
        return Published.by(self.trust, credence)

    def of(self, evidence: list[float]) -> Three:
        return opinion(sum(evidence), sum(1 - each for each in evidence))

    def expected(self, held: Three) -> float:
        return held[0] + self.base_rate * held[2]

    def judge(self, i: int, j: int) -> Three:
        held = self.of(self.seen[i][j])
        for k in self.judges:
            if k != i:
                held = fuse(held, discount(self.of(self.alike[i][k]), self.of(self.seen[k][j])))
        return held


@pytest.mark.parametrize("parameters", [{}, {"initial": 0.9}])
def test_it_is_the_formula(parameters: dict[str, float]) -> None:
    assert_matches(
        make_trust_model("subjective-logic", **parameters), round_by_round(Slow, **parameters)
    )


def test_by_hand() -> None:
    """Two raters who agree on one provider: every opinion is from one success, (1/3, 0, 2/3).

    Discounted (1/9, 0, 8/9); fused with one's own k = 2/3 + 8/9 - 16/27 = 26/27, u = (16/27) /
    (26/27) = 8/13, b = (1/3 * 8/9 + 1/9 * 2/3) / (26/27) = 5/13, and E = 5/13 + 4/13 = 9/13. Each
    trusts the other 1/3 + 1/3.
    """
    model = make_trust_model("subjective-logic")
    state = play(model, [[1], [1]])
    assert model.provider_trust(state) == pytest.approx([9 / 13])
    assert model.rater_trust(state) == pytest.approx([2 / 3, 2 / 3])


def test_an_adviser_that_was_always_wrong_is_not_heard() -> None:
    """Its opinion, discounted by (0, d, u), is vacuous: the judge's own two successes make 1/2 +
    1/4."""
    state = play(make_trust_model("subjective-logic"), *[[[1], [0]]] * 2)
    assert state.trust[:, 0] == pytest.approx([3 / 4, 1 / 4])


def test_gradients_are_finite() -> None:
    assert_gradients_are_finite(make_trust_model("subjective-logic"))
