"""Published trust of a central model, blended with own experience."""

from typing import Any

import numpy as np
import pytest
from judged import DELIVERED, RECEIVED, Matrix, Published, judge_trust, play, round_by_round
from model_cases import assert_matches
from refusals import refuses

from roletrust_env import Game, JointPolicy, Scenario, record
from roletrust_env.trust import Ratings, Traits, make_trust_model, trust_models
from roletrust_env.trust.model import start_model

CENTRAL = [name for name in trust_models() if Traits.of(make_trust_model(name)).family == "central"]


class Slow:
    """Judge by judge, from the lists of all ratings; the central model is the beta rule."""

    def __init__(self, raters: int, providers: int, initial: float = 0.5, prior: float = 2.0):
        self.raters, self.providers = range(raters), range(providers)
        self.initial, self.prior = initial, prior
        self.given: dict[tuple[int, int], list[float]] = {}
        self.heard = [(0.0, 0.0) for _ in self.providers]

    def top(self, j: int) -> float:
        counts, sums = self.heard[j]
        return (sums + 2 * self.initial) / (counts + 2)

    def trust(self, i: int, j: int) -> float:
        own = self.given.get((i, j), [])
        weight = len(own) / (len(own) + self.prior)
        mean = sum(own) / len(own) if own else 0.0
        return (1 - weight) * self.top(j) + weight * mean

    def round(self, f: Matrix, m: Matrix) -> Published:
        for j in self.providers:
            news = [f[i][j] for i in self.raters if m[i][j]]
            if news:
                counts, sums = self.heard[j]
                self.heard[j] = 0.9 * counts + len(news), 0.9 * sums + sum(news)
            for i in self.raters:
                if m[i][j]:
                    self.given.setdefault((i, j), []).append(f[i][j])
        trust = [[self.trust(i, j) for j in self.providers] for i in self.raters]
        return Published.by(trust, [[1.0] * len(self.raters)] * len(self.raters))


@pytest.mark.parametrize("parameters", [{}, {"initial": 0.3, "prior": 0.5}])
def test_it_is_the_formula(parameters: dict[str, Any]) -> None:
    assert_matches(make_trust_model("blended", **parameters), round_by_round(Slow, **parameters))


@pytest.mark.parametrize("name", CENTRAL)
def test_a_judge_without_services_has_the_published_trust_of_any_central_model(name: str) -> None:
    parameters = {"lam": 0.7, "initial": 0.3}
    known = {k: v for k, v in parameters.items() if hasattr(make_trust_model(name), k)}
    central, state = make_trust_model(name, **known), None
    nobody = [(np.zeros_like(f), np.zeros_like(m)) for f, m in RECEIVED]
    blended = make_trust_model("blended", model=name, **parameters)
    for played in DELIVERED:
        like = np.zeros(played.ratings.shape)
        state = (
            start_model(central, like, np.zeros(like.shape[:2], bool)) if state is None else state
        )
        state = central.update(state, Ratings(*played))
    top = central.provider_trust(state)
    trust = judge_trust(blended, DELIVERED, nobody)
    np.testing.assert_allclose(trust, np.broadcast_to(top, trust.shape), rtol=0, atol=1e-12)
    assert blended.rates_raters == central.rates_raters


def test_own_experience_does_not_reach_the_published_trust_of_the_central_model() -> None:
    """Judge 0 received better services than it rated: only its own trust rises."""
    model = make_trust_model("blended")
    f, mask = np.full((2, 1), 0.2), np.ones((2, 1), bool)
    received = np.array([[1.0], [0.2]])
    state = model.start(f, ~mask)
    state = model.update(state, Ratings(f, mask, experience=Ratings(received, mask)))
    top = (1 + 2 * 0.2) / 4
    assert state.trust[:, 0] == pytest.approx([(2 * top + 1.0) / 3, (2 * top + 0.2) / 3])


def test_a_liar_matters_less_with_every_own_service() -> None:
    model = make_trust_model("blended")
    gaps = [
        abs(play(model, *[[[0.9], [0.0], [0.0]]] * rounds).trust[0, 0] - 0.9)
        for rounds in (1, 5, 50)
    ]
    assert gaps[0] > 0.2 > gaps[1] > gaps[2]
    assert gaps[2] < 0.03


def test_it_plays_for_agents_with_both_roles() -> None:
    scenario = Scenario(agents=[{"role": "SR+SP", "count": 4}], max_cycles=6, lam=0.7)
    for name in ("eigentrust", "sybil-rank"):
        game = Game(scenario, {"name": "blended", "model": name})
        assert np.isfinite(record(JointPolicy(game, {}), game.random(0)).top).all()


def test_only_central_models_are_blended() -> None:
    for name in ("first-hand", "blended"):
        with refuses(ValueError, "central", name):
            make_trust_model("blended", model=name)
    with refuses(ValueError, "betta", "beta"):
        make_trust_model("blended", model="betta")
    for prior in (0.0, -1.0, float("nan")):
        with refuses(ValueError, "prior", prior):
            make_trust_model("blended", prior=prior)
