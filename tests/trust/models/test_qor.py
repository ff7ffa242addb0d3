"""Quality of recommendation, against its formulas and by hand."""

import pytest
from judged import Matrix, Published, assert_gradients_are_finite, play, round_by_round
from model_cases import assert_matches

from roletrust_env.trust import make_trust_model


class Slow:
    """The formulas, judge by judge; every note and every QR is kept with its round."""

    def __init__(
        self, raters: int, providers: int, theta: float = 0.7, initial: float = 0.5
    ) -> None:
        self.judges, self.providers = range(raters), range(providers)
        self.theta, self.now = theta, 0
        self.notes: Matrix = [[[] for _ in self.providers] for _ in self.judges]
        self.quality: Matrix = [[[(0, 1.0)] for _ in self.judges] for _ in self.judges]
        self.trust = [[initial] * providers for _ in self.judges]

    def round(self, f: Matrix, m: Matrix) -> Published:
        self.now += 1
        note = [[2 * f[i][j] - 1 for j in self.providers] for i in self.judges]
        for i in self.judges:
            for k in self.judges:
                right = [
                    1 - abs(note[k][j] - note[i][j]) for j in self.providers if m[i][j] and m[k][j]
                ]
                if right:
                    self.feedback(self.quality[i][k], sum(right) / len(right))
            for j in self.providers:
                if m[i][j]:
                    self.notes[i][j].append((self.now, note[i][j]))
        for j in self.providers:
            if any(m[i][j] for i in self.judges):
                for i in self.judges:
                    self.trust[i][j] = (self.worth(i, j) + 1) / 2
        return Published.by(
            self.trust, [[(past[-1][1] + 1) / 2 for past in row] for row in self.quality]
        )

    def feedback(self, past: list[tuple[int, float]], right: float) -> None:
        """Append the new QR to the past ones."""
        weights = [self.theta ** (self.now - when) for when, _ in past]
        sums = sum(c * quality for c, (_, quality) in zip(weights, past, strict=True))
        past.append((self.now, (sums + right) / (sum(weights) + 1)))

    def worth(self, i: int, j: int) -> float:
        above = below = 0.0
        for k in self.judges:
            for when, note in self.notes[k][j][-10:]:
                s = (note**2 - note) / 2
                weight = self.theta ** ((s + 1) * (self.now - when))
                above += weight * self.quality[i][k][-1][1] * note
                below += weight
        return above / below


@pytest.mark.parametrize("parameters", [{}, {"theta": 1, "initial": 0.1}])
def test_it_is_the_formula(parameters: dict[str, float]) -> None:
    assert_matches(make_trust_model("qor", **parameters), round_by_round(Slow, **parameters))


def test_by_hand() -> None:
    """Three raters, one provider; the third lies: r = 1 - 2 = -1.

    QR among the honest stays 1; that of the liar becomes (0.7 * 1 - 1) / (0.7 + 1) = -0.3 / 1.7, so
    its note of -1 speaks a little for the provider: T = (1 + 1 + 0.3 / 1.7) / 3 on [-1, 1]. The
    liar's is (-1 - 2 * 0.3 / 1.7) / 3.
    """
    state = play(make_trust_model("qor"), [[1], [1], [0]])
    qr = -0.3 / 1.7
    assert state.quality[0] == pytest.approx([1, 1, qr])
    assert 2 * state.trust[:, 0] - 1 == pytest.approx(
        [(2 - qr) / 3, (2 - qr) / 3, (-1 + 2 * qr) / 3]
    )
    assert make_trust_model("qor").rater_trust(state) == pytest.approx(
        [(3 + qr) / 4, (3 + qr) / 4, (1 + qr) / 2]
    )


def test_the_next_quality_by_hand() -> None:
    """The same and a fair round, r = 1: the past is 1 at age 2 and -0.3 / 1.7 at age 1."""
    state = play(make_trust_model("qor"), [[1], [1], [0]], [[1], [1], [1]])
    assert state.quality[0, 2] == pytest.approx((0.49 - 0.7 * 0.3 / 1.7 + 1) / (0.49 + 0.7 + 1))


def test_bad_notes_fade_twice_as_fast() -> None:
    model = make_trust_model("qor")
    forgiven, spoilt = play(model, [[0]], [[1]]), play(model, [[1]], [[0]])
    assert model.provider_trust(forgiven) == pytest.approx([0.5 + 0.5 * (1 - 0.49) / (1 + 0.49)])
    assert model.provider_trust(spoilt) == pytest.approx([0.5 + 0.5 * (0.7 - 1) / (0.7 + 1)])


def test_gradients_are_finite() -> None:
    assert_gradients_are_finite(make_trust_model("qor"))
