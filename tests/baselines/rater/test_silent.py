"""Silence, and what trust models make of it."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_baselines import OnOff, Silent
from roletrust_env import Game, JointPolicy, Scenario, make_attacker, record, trust_models
from roletrust_env.game.rollout import History
from roletrust_env.trust import Traits
from roletrust_env.trust.model import registry

ROUNDS = 15
RELATIVE = {
    "eigentrust",
    "merit-rank",
    "personalized-pagerank",
    "power-trust",
    "sybil-rank",
}  # shares of the largest
CENTRAL = [
    name
    for name in trust_models()
    if Traits.of(registry.factory(name)).family == "central"
    and name != "power-trust"  # its walk has one more agent
]


def played(model: str, silent: Silent | None, raters: int = 4) -> History:
    """The last rater is the silent one; nothing is left to chance."""
    scenario = Scenario(
        agents=[{"role": "SR", "count": raters}, {"role": "SP", "count": 3}], max_cycles=ROUNDS
    )
    game = Game(scenario, model)
    policies = {"sp_0": OnOff(period=6, bad=0.3)} | ({f"sr_{raters - 1}": silent} if silent else {})
    return record(JointPolicy(game, policies), game.random(0))


@pytest.mark.parametrize("model", sorted({*trust_models()} - RELATIVE))
def test_trust_in_who_never_rated_stays_where_it_was(model: str) -> None:
    history = played(model, Silent())
    assert np.all(history.tor[:, 3] == history.tor[0, 3])


@pytest.mark.parametrize("model", sorted(RELATIVE))
def test_a_share_of_all_trust_falls_as_others_rise(model: str) -> None:
    """It is nobody's peer, so that nothing but the others' trust moves it."""
    history = played(model, Silent())
    assert np.all(history.tor[1:, 3] < history.tor[0, 3])


@pytest.mark.parametrize("model", CENTRAL)
def test_providers_are_trusted_as_if_it_were_not_there(model: str) -> None:
    """By who sees all; where every rater is a judge of its own, a silent one has its own view,
    which is published."""
    with_it, without = played(model, Silent()), played(model, None, raters=3)
    np.testing.assert_allclose(with_it.top, without.top, atol=1e-9)


def test_by_name() -> None:
    assert make_attacker("silent", targets=(1,), start=3) == Silent(targets=(1,), start=3)


def test_a_place_that_is_no_providers_is_refused() -> None:
    with refuses(ValueError, "targets", "(3,)", "provider", "2"):
        played("mean", Silent(targets=(3,)))
