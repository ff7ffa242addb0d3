"""Growth of the state of a trust model, compared with a replay in which the newcomers were
silent."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roletrust_env.trust import make_trust_model, trust_models
from roletrust_env.trust.grid_run import GridRun
from roletrust_env.trust.models import Mean
from roletrust_manager.dds.team_run import TeamRun, grows
from roletrust_manager.team import Team

BY_REPLAY = {"fire", "qor", "regression-aligned", "yu-singh", "zhang-cohen"}
"""Models in which the memory of silent agents changes, too."""


def names(kind, count):
    return tuple(f"{kind}_{k}" for k in range(count))


def play(team_run, ratings, mask):
    """Update a team_run with some rounds; a smaller team has the first rows and columns."""
    for row, there in zip(ratings, mask, strict=True):
        values = np.where(there, row, np.nan)
        team_run.play_named(
            {
                name: [
                    None if np.isnan(value) else value
                    for value in values[i, : len(team_run.team.providers)]
                ]
                for i, name in enumerate(team_run.team.raters)
            }
        )


def close(one, other):
    """Check that two trusts are equal up to the rounding of sums over more agents."""
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12)


@settings(max_examples=4)
@given(data=st.data())
@pytest.mark.parametrize("name", sorted(set(trust_models()) - BY_REPLAY))
def test_a_grown_state_gives_the_trust_of_a_replay(name, data):
    model, random = make_trust_model(name), np.random.default_rng(data.draw(st.integers(0, 2**32)))
    sizes = [(data.draw(st.integers(1, 9)), data.draw(st.integers(1, 9)))]
    for _ in range(data.draw(st.integers(1, 3))):
        sizes.append(
            (
                sizes[-1][0] + data.draw(st.integers(0, 2)),
                sizes[-1][1] + data.draw(st.integers(0, 2)),
            )
        )
    both = data.draw(st.booleans())
    providers = ("sr_0",) * both + names("sp", sizes[-1][1])[both:]
    teams = [Team(names("sr", few), providers[:some]) for few, some in sizes]
    grown, whole = TeamRun(model, teams[0]), TeamRun(model, teams[-1])
    for team in teams:
        if team is not teams[0]:
            grown.grow(team)
        rounds = data.draw(st.integers(1, 12))
        ratings = random.random((rounds, *teams[-1].peers.shape))
        mask = (
            random.random(ratings.shape) < data.draw(st.sampled_from([0.3, 0.8, 1.0]))
        ) & ~teams[-1].peers
        mask[:, len(team.raters) :] = mask[:, :, len(team.providers) :] = False
        for team_run in (grown, whole):
            play(team_run, ratings, mask)
    close(grown.trust, whole.trust)


@pytest.mark.parametrize("name", trust_models())
def test_it_is_known_which_models_grow(name):
    assert grows(make_trust_model(name)) is (name not in BY_REPLAY)


class CountState(NamedTuple):
    """Number of raters, and the trust of the providers."""

    raters: int
    top: np.ndarray


class Crowd(Mean):
    """A model whose state has the size of its first team."""

    def start(self, like):
        return CountState(len(like), like[0] * 0 + 0.5)

    def update(self, state, ratings):
        return state._replace(top=(state.top * 0 + state.raters / (1 + state.raters)))

    def rater_trust(self, state):
        return np.ones(state.raters)

    def provider_trust(self, state):
        return state.top


class Listed(Crowd):
    """A model whose state is a list."""

    def start(self, like):
        return [super().start(like)]


@pytest.mark.parametrize("model", [Crowd(), Listed()])
def test_a_model_of_another_kind_does_not_grow(model):
    assert not grows(model)


def test_the_state_of_a_newcomer_is_that_of_the_start():
    run = GridRun(
        make_trust_model("role-trust", initial=0.7), np.zeros((2, 2)), np.zeros((2, 2), bool)
    )
    run.rounds, run.state = 1, run.state._replace(tor=np.array([0.1, 0.2]))
    before = type(run.state)
    run.join(3, 4)
    assert run.state.tor.tolist() == [0.1, 0.2, 0.7]
    assert run.state.last.shape == (3, 4)
    assert type(run.state) is before
