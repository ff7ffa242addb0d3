"""Yu, Singh and Sycara's model, against its formula and by hand."""

import numpy as np
import pytest
from judged import Matrix, Published, assert_gradients_are_finite, play, round_by_round
from model_cases import assert_matches

from roletrust_env.trust import Ratings, make_trust_model


class Slow:
    """The formula, judge by judge; a judge keeps every rating it gave."""

    def __init__(
        self, raters: int, providers: int, beta: float = 0.5, memory: int = 10, initial: float = 0.5
    ) -> None:
        self.judges, self.providers = range(raters), range(providers)
        self.beta, self.memory = beta, memory
        self.given: Matrix = [[[] for _ in self.providers] for _ in self.judges]
        self.credence = [[1.0] * raters for _ in self.judges]
        self.trust = [[initial] * providers for _ in self.judges]

    def round(self, f: Matrix, m: Matrix) -> Published:
        for j in self.providers:
            for i in self.judges:
                for k in self.judges:
                    if m[i][j] and m[k][j]:
                        self.credence[i][k] *= 1 - (1 - self.beta) * abs(f[k][j] - f[i][j])
                if m[i][j]:
                    self.given[i][j].append(f[i][j])
        for j in self.providers:
            if any(m[i][j] for i in self.judges):
                for i in self.judges:
                    self.judge(i, j)
        return Published.by(self.trust, self.credence)

    def judge(self, i: int, j: int) -> None:
        own = self.given[i][j][-self.memory :]
        advisers = [k for k in self.judges if k != i and self.given[k][j]]
        if advisers:
            advice = sum(self.credence[i][k] * self.given[k][j][-1] for k in advisers)
            advice /= sum(self.credence[i][k] for k in advisers)
            local = sum(own) / len(own) if own else 0.0
            h = len(own) / self.memory
            self.trust[i][j] = h * local + (1 - h) * advice
        elif own:
            self.trust[i][j] = sum(own) / len(own)


@pytest.mark.parametrize("parameters", [{}, {"beta": 0.9, "memory": 3, "initial": 0.2}])
def test_it_is_the_formula(parameters: dict[str, float]) -> None:
    assert_matches(make_trust_model("yu-singh", **parameters), round_by_round(Slow, **parameters))


def test_by_hand() -> None:
    """Three raters, one provider; the third lies.

    After a round C = 1 among the honest and 1 - 0.5 * 1 = 0.5 between each of them and the liar,
    whom the honest therefore give a mean credence of 0.5, and each other of (1 + 0.5) / 2. Honest:
    h = 0.1, local = 1, advice = (1 * 1 + 0.5 * 0) / 1.5 = 2/3, T = 0.1 + 0.9 * 2/3 = 0.7. Liar: 0.1
    * 0 + 0.9 * 1 = 0.9.
    """
    model = make_trust_model("yu-singh")
    state = play(model, [[1], [1], [0]])
    assert state.trust[:, 0] == pytest.approx([0.7, 0.7, 0.9])
    assert model.rater_trust(state) == pytest.approx([0.75, 0.75, 0.5])
    assert model.provider_trust(state) == pytest.approx([2.3 / 3])


def test_advisers_that_are_silent_in_a_round_say_what_they_said_last() -> None:
    model = make_trust_model("yu-singh")
    state = play(model, [[1.0], [0.6], [None]], [[None], [None], [0.2]])
    assert state.trust[0, 0] == pytest.approx(0.1 * 1.0 + 0.9 * (0.8 * 0.6 + 1 * 0.2) / 1.8)


def test_after_ten_experiences_advice_counts_no_more() -> None:
    model = make_trust_model("yu-singh")
    state = play(model, *[[[0.5], [1.0]]] * 5, *[[[0.7], [1.0]]] * 8)
    assert state.trust[0, 0] == pytest.approx((2 * 0.5 + 8 * 0.7) / 10)


def test_credences_that_fell_beyond_all_numbers_still_weigh() -> None:
    """In float32 both 0.5^400 and 0.75^400 are 0, and so is the one over the other.

    The first rater believes the third, who was less wrong, and the second where nobody else has
    anything to say.
    """
    model = make_trust_model("yu-singh", memory=1000)
    state = model.start(np.zeros((3, 2), np.float32))
    lies, lied = np.array([[1, 0], [0, 0], [0.5, 0]], np.float32), np.array([[True, False]] * 3)
    for _ in range(400):
        state = model.update(state, Ratings(lies, lied))
    met = np.array([[False] * 2, [False, True], [False] * 2])
    state = model.update(state, Ratings(np.full((3, 2), 0.9, np.float32), met))
    assert model.rater_trust(state)[0] == 0
    assert state.trust[0] == pytest.approx([0.4 * 1 + 0.6 * 0.5, 0.9], abs=1e-5)


def test_gradients_are_finite() -> None:
    assert_gradients_are_finite(make_trust_model("yu-singh"))
