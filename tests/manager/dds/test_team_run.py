"""The run of a team; `test_manager.py` has further cases."""

from typing import NamedTuple

import numpy as np
import pytest

from roletrust_env.trust import agent_trust, grid_run, make_trust_model
from roletrust_env.trust.grid_run import GridRun
from roletrust_env.trust.model_checks import watched_update
from roletrust_env.trust.ratings import Ratings
from roletrust_manager.dds.team_run import TeamRun
from roletrust_manager.team import Team

TEAM = Team(("sr_0", "srsp_0"), ("sp_0", "srsp_0"))


@pytest.mark.parametrize(
    ("model", "settings", "initial"),
    [("role-trust", {"initial": 0.9}, 0.9), ("role-trust", {}, 0.5), ("eigentrust", {}, 0.5)],
)
def test_an_agent_without_ratings_has_the_initial_trust_of_the_model(model, settings, initial):
    """EigenTrust has no initial trust, so 0.5 is used."""
    made = make_trust_model(model, **settings)
    assert hasattr(made, "initial") is (model == "role-trust")
    team_run = TeamRun(made, TEAM)
    assert team_run.trust.toa == (initial,)
    team_run.play_named({"sr_0": [1.0, None]})  # a rating of other agents
    assert team_run.trust.toa == (initial,)


def test_the_trust_of_an_agent_is_weighted_by_the_services_that_it_rated_and_provided():
    team_run = TeamRun(make_trust_model("role-trust"), TEAM)
    rounds = [
        {"srsp_0": [0.2, None]},
        {"srsp_0": [0.4, None]},
        {"sr_0": [0.3, 0.7], "srsp_0": [0.9, None]},
    ]
    for ratings in rounds:
        team_run.play_named(ratings)
    tor, top, (toa,) = team_run.trust
    wanted = agent_trust(
        np.array(tor[1]), np.array(top[1]), rated=np.array(3.0), provided=np.array(1.0), initial=0.5
    )
    assert toa == wanted != (tor[1] + top[1]) / 2
    assert len({tor[1], top[1], toa}) == 3


def test_the_model_is_updated_with_zeros_where_there_is_no_rating_and_with_the_number_of_the_round(
    monkeypatch,
):
    updates = []

    def update(model, state, ratings, round):
        updates.append((ratings.values.tolist(), ratings.mask.tolist(), int(round)))
        return watched_update(model, state, ratings, round)

    monkeypatch.setattr(grid_run, "watched_update", update)
    team_run = TeamRun(
        make_trust_model("mean"), TEAM, [{"sr_0": [0.5]}]
    )  # before the second provider came
    team_run.play_named({"srsp_0": [None, 0.25]})
    assert updates == [
        ([[0.5, 0.0], [0.0, 0.0]], [[True, False], [False, False]], 0),
        ([[0.0, 0.0], [0.0, 0.25]], [[False, False], [False, True]], 1),
    ]


def test_a_team_with_newcomers_keeps_its_order():
    team = TEAM.with_newcomers(["sr_1", "sr_0"], ["sp_1"])
    assert team == Team(("sr_0", "srsp_0", "sr_1"), ("sp_0", "srsp_0", "sp_1"))
    assert team.dual_role == ("srsp_0",)


class Counting(NamedTuple):
    """A state with a flag and a number of Python beside its arrays."""

    top: np.ndarray
    begun: bool
    rounds: int
    nothing: None


class Counts:
    """A model that trusts providers less from round to round."""

    rates_raters = False

    def start(self, like):
        return Counting(0 * like[0] + 1, False, 0, None)

    def update(self, state, ratings):
        return Counting(state.top / (1 + state.begun + state.rounds), True, state.rounds + 1, None)

    def rater_trust(self, state):
        return np.ones(2)

    def provider_trust(self, state):
        return state.top


def test_a_saved_run_has_the_flags_and_numbers_of_python_too():
    first = GridRun(Counts(), np.zeros((2, 2)), np.zeros((2, 2), bool))
    for _ in range(3):
        first.update(Ratings(np.zeros((2, 2))))
    again = GridRun(Counts(), np.zeros((2, 2)), np.zeros((2, 2), bool))
    again.load(first.save())
    assert (again.rounds, again.state.begun, again.state.rounds, again.state.nothing) == (
        3,
        True,
        3,
        None,
    )
    assert type(again.state.begun) is bool
    assert type(again.state.rounds) is int
    for one in (first, again):
        one.update(Ratings(np.zeros((2, 2))))
    np.testing.assert_array_equal(again.provider_trust, first.provider_trust)
