"""A trust model of another package that goes wrong in the middle of a game is named, with the round."""

from typing import Any, NamedTuple

import numpy as np
import pytest
import torch

import roletrust_env
from roletrust_env import Cast, Game, make_scenario, record
from roletrust_env.trust.guard import needs_watching


class Trusts(NamedTuple):
    tor: Any
    top: Any
    rounds: int


class Turncoat:
    """Sound for two rounds, and then something else."""

    rates_raters = True

    def __init__(self, what: Any) -> None:
        self.what = what

    def __repr__(self) -> str:
        return "Turncoat()"

    def start(self, like: Any) -> Trusts:
        return Trusts(0 * like[:, 0] + 0.5, 0 * like[0] + 0.5, 0)

    def update(self, state: Trusts, ratings: Any, mask: Any) -> Trusts:
        return state._replace(rounds=state.rounds + 1)

    def rater_trust(self, state: Trusts) -> Any:
        return state.tor

    def provider_trust(self, state: Trusts) -> Any:
        return self.what(state.top) if state.rounds > 2 else state.top


class Broken(Turncoat):
    """Forgets to return its state."""

    def update(self, state: Trusts, ratings: Any, mask: Any) -> Any:
        return None


def fail(top: Any) -> Any:
    raise KeyError("lost")


WRONG = pytest.mark.parametrize(
    ("what", "complaint"),
    [
        (lambda top: top * np.nan, "provider_trust holds nan"),
        (lambda top: top + 1, r"provider_trust holds 1\.5; a trust must lie in \[0, 1\]"),
        (lambda top: top[:1], r"provider_trust has shape \(1,.*\); it must be \(3,"),
        (lambda top: 0.5, r"provider_trust has shape \(\)"),
        (fail, "KeyError: 'lost'"),
    ],
    ids=["nan", "out of range", "shape", "no array", "raises"],
)


@WRONG
@pytest.mark.parametrize("like", [np.zeros(()), torch.zeros(())], ids=["numpy", "torch"])
def test_it_is_named_with_the_round(what: Any, complaint: str, like: Any) -> None:
    game = Game(make_scenario("paper-3x3"), Turncoat(what), like)
    with pytest.raises(ValueError, match=rf"trust model Turncoat\(\), round 2: {complaint}"):
        record(Cast(game, {}), game.random(0), (4,))


@WRONG
def test_an_environment_stays_as_it_was(what: Any, complaint: str) -> None:
    env = roletrust_env.parallel_env("paper-3x3", Turncoat(what))
    env.reset(seed=0)
    actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    env.step(actions)
    env.step(actions)
    before = env.state()
    with pytest.raises(ValueError, match=complaint):
        env.step(actions)
    assert np.array_equal(env.state(), before)


def test_a_model_that_cannot_play_at_all_is_refused_at_once() -> None:
    with pytest.raises(ValueError, match="cannot play one round: AttributeError: 'NoneType'"):
        Game(make_scenario("paper-3x3"), Broken(None))


def test_models_of_the_package_are_not_watched() -> None:
    assert needs_watching(Turncoat(fail))
    assert not any(needs_watching(roletrust_env.make_trust_model(name)) for name in ("role-trust", "mean"))
