"""First-hand trust, against its formulas judge by judge, and what its parts are for."""

from typing import Any

import numpy as np
import pytest
from judged import Matrix, Published, assert_gradients_are_finite, play, round_by_round
from model_cases import assert_matches

from roletrust_env.trust import make_trust_model

PRIOR, POWER, DOUBT, INITIAL = 0.2, 8.0, 0.8, 0.5


class Slow:
    """The formulas, judge by judge, from the lists of all ratings."""

    def __init__(
        self,
        raters: int,
        providers: int,
        keep: float = 1.0,
        own: float = 5.0,
        limit: float = 0.3,
    ) -> None:
        self.raters, self.providers = range(raters), range(providers)
        self.keep, self.own, self.limit = keep, own, limit
        self.given: dict[tuple[int, int], list[float]] = {}

    def weights(self, i: int, j: int) -> list[float]:
        count = len(self.given.get((i, j), []))
        return [self.keep ** float(count - 1 - at) for at in range(count)]

    def number(self, i: int, j: int) -> float:
        return sum(self.weights(i, j))

    def mean(self, i: int, j: int) -> float:
        return sum(
            w * f for w, f in zip(self.weights(i, j), self.given[i, j], strict=True)
        ) / self.number(i, j)

    def voice(self, i: int, j: int) -> float:
        return self.number(i, j) / (1 + self.limit * self.number(i, j))

    def credence(self, i: int, k: int) -> float:
        agreed, compared = DOUBT, 1.0
        for j in self.providers:
            if (i, j) in self.given and (k, j) in self.given:
                weight = self.voice(i, j) * self.voice(k, j)
                agreed += weight * (1 - abs(self.mean(i, j) - self.mean(k, j)))
                compared += weight
        return (agreed / compared) ** POWER

    def trust(self, i: int, j: int) -> float:
        said, weight = PRIOR * INITIAL, PRIOR
        for k in self.raters:
            if (k, j) in self.given:
                w = (
                    self.own * self.number(k, j)
                    if k == i
                    else self.credence(i, k) * self.voice(k, j)
                )
                said, weight = said + w * self.mean(k, j), weight + w
        return said / weight

    def round(self, f: Matrix, m: Matrix) -> Published:
        for i in self.raters:
            for j in self.providers:
                if m[i][j]:
                    self.given.setdefault((i, j), []).append(f[i][j])
        return Published.by(
            [[self.trust(i, j) for j in self.providers] for i in self.raters],
            [[self.credence(i, k) for k in self.raters] for i in self.raters],
        )


@pytest.mark.parametrize("parameters", [{}, {"keep": 0.7, "own": 1, "limit": 1}])
def test_it_is_the_formula(parameters: dict[str, float]) -> None:
    assert_matches(make_trust_model("first-hand", **parameters), round_by_round(Slow, **parameters))


def test_gradients_are_finite() -> None:
    assert_gradients_are_finite(make_trust_model("first-hand"))


def judged(model: Any, *rounds: Any) -> np.ndarray:
    trust: np.ndarray = model.judge_trust(play(model, *rounds))
    return trust


def test_a_majority_of_liars_misleads_nobody_who_has_met_the_providers() -> None:
    """Two honest raters of seven: each has the right order of what it has met, and of what it has
    not."""
    honest, lie = [0.9, 0.1, None], [0.1, 0.9, 0.1]
    trust = judged(make_trust_model("first-hand"), *[[honest, [0.9, 0.1, 0.8], *[lie] * 5]] * 3)
    assert trust[0, 0] > 0.85
    assert trust[0, 1] < 0.15
    assert trust[0, 2] > 0.75  # it has not met the third, and believes the one that agrees with it


def test_a_newcomer_without_experience_believes_the_majority() -> None:
    trust = judged(
        make_trust_model("first-hand"), *[[[None, None], *[[0.9, 0.1]] * 2, *[[0.1, 0.9]] * 3]] * 3
    )
    assert trust[0, 0] < trust[0, 1]


@pytest.mark.parametrize("lies", [1, 2, 5])
def test_nobody_is_believed_more_for_repeating_itself_without_end(lies: int) -> None:
    """The weight of what one rater says about a provider stays below 1 / limit."""
    model = make_trust_model("first-hand", power=0, prior=1)
    trust = judged(model, *[[[None], [1.0]]] * lies)
    assert trust[0, 0] < (0.5 + 1 / 0.3) / (1 + 1 / 0.3)


def test_by_its_own_rule_it_goes_to_unknown_providers_first() -> None:
    model = make_trust_model("first-hand")
    state = play(model, [[0.9, None, None], [None, 0.5, None]])
    wanted = model.preference(state, np.array([[0.3, 0.2, 0.1]] * 2))
    np.testing.assert_array_equal(wanted[:, :2], state.trust[:, :2])
    assert wanted[:, 2] == pytest.approx([1.1, 1.1])
