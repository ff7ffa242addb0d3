"""Judges that block who contradicts them, against a slow copy, and by hand."""

from typing import Any

import numpy as np
import pytest
from judged import Matrix, Published, play, round_by_round
from model_cases import assert_matches

from roletrust_env.trust import make_trust_model


class Slow:
    """Judge by judge, from the lists of all ratings."""

    def __init__(
        self,
        raters: int,
        providers: int,
        initial: float = 0.5,
        limit: float = 0.3,
        forgive: bool = False,
        strangers: bool = True,
    ) -> None:
        self.raters, self.providers = range(raters), range(providers)
        self.initial, self.limit, self.forgive, self.strangers = initial, limit, forgive, strangers
        self.given: dict[tuple[int, int], list[float]] = {}
        self.contradicted: set[tuple[int, int]] = set()
        self.agreed: set[tuple[int, int]] = set()

    def mean(self, i: int, j: int) -> float:
        return sum(self.given[i, j]) / len(self.given[i, j])

    def listens(self, i: int, k: int) -> bool:
        known = self.strangers or (i, k) in self.agreed
        return known and (i, k) not in self.contradicted

    def trust(self, i: int, j: int) -> float:
        heard = [
            rating
            for k in self.raters
            if k == i or self.listens(i, k)
            for rating in self.given.get((k, j), [])
        ]
        return sum(heard) / len(heard) if heard else self.initial

    def round(self, f: Matrix, m: Matrix) -> Published:
        for i in self.raters:
            for j in self.providers:
                if m[i][j]:
                    self.given.setdefault((i, j), []).append(f[i][j])
        if self.forgive:
            self.contradicted.clear()
            self.agreed.clear()
        for i in self.raters:
            for k in self.raters:
                for j in self.providers:
                    if (i, j) in self.given and (k, j) in self.given:
                        far = abs(self.mean(i, j) - self.mean(k, j)) > self.limit
                        (self.contradicted if far else self.agreed).add((i, k))
        return Published.by(
            [[self.trust(i, j) for j in self.providers] for i in self.raters],
            [[float(self.listens(i, k)) for k in self.raters] for i in self.raters],
        )


RULES: list[tuple[str, dict[str, Any]]] = [
    ("block", {}),
    ("block-forgiving", {"forgive": True}),
    ("agreed-once", {"strangers": False, "initial": 0.7}),
]


@pytest.mark.parametrize("limit", [0.3, 0.15])
@pytest.mark.parametrize(("name", "rule"), RULES)
def test_it_is_the_rule(name: str, rule: dict[str, Any], limit: float) -> None:
    model = make_trust_model(name, limit=limit)
    assert_matches(model, round_by_round(Slow, limit=limit, **rule))


@pytest.mark.parametrize(
    ("name", "trust"), [("block", 0.8), ("block-forgiving", (0.8 + 0.1 + 0.8 * 9) / 11)]
)
def test_only_who_forgives_listens_to_a_liar_again(name: str, trust: float) -> None:
    """A liar says 0.1 once, and the truth nine times: its mean, 0.73, is near enough again."""
    rounds = [[[0.8], [0.1]], *[[[None], [0.8]]] * 9]
    state = play(make_trust_model(name), *rounds)
    assert state.trust[0, 0] == pytest.approx(trust)


def test_by_its_own_rule_it_goes_to_providers_that_nobody_knows_first() -> None:
    model = make_trust_model("block")
    state = play(model, [[0.9, None, None], [0.1, 0.5, None]])
    wanted = model.preference(state, np.array([[0.3, 0.2, 0.1]] * 2))
    assert wanted[0] == pytest.approx([0.9, 1.2, 1.1])  # the only adviser has contradicted it
    assert wanted[1] == pytest.approx([0.1, 0.5, 1.1])


def test_an_adviser_counts_once_it_has_agreed() -> None:
    model = make_trust_model("agreed-once", initial=0.6)
    unknown = [[0.9, None], [None, 0.2]]
    assert play(model, unknown).trust[0, 1] == pytest.approx(0.6)
    assert play(model, unknown, [[None, None], [0.8, None]]).trust[0, 1] == pytest.approx(0.2)
    wanted = model.preference(play(model, unknown), np.full((2, 2), 0.3))
    assert wanted[0] == pytest.approx([0.9, 1.3])
