"""The trust of a team from round to round, beside the cases of `test_manager.py`."""

import numpy as np
import pytest

from roletrust_env.live.trust_tracker import Team, TrustTracker
from roletrust_env.trust import agent_trust, make_trust_model

TEAM = Team(("sr_0", "srsp_0"), ("sp_0", "srsp_0"))


@pytest.mark.parametrize(
    ("model", "settings", "initial"),
    [("role-trust", {"initial": 0.9}, 0.9), ("role-trust", {}, 0.5), ("eigentrust", {}, 0.5)],
)
def test_an_agent_without_ratings_has_the_initial_trust_of_the_model(model, settings, initial):
    """EigenTrust has no initial trust of its own, so it is 0.5."""
    made = make_trust_model(model, **settings)
    assert hasattr(made, "initial") is (model == "role-trust")
    tracker = TrustTracker(made, TEAM)
    assert tracker.trust.toa == (initial,)
    tracker.update({"sr_0": [1.0, None]})  # of others
    assert tracker.trust.toa == (initial,)


def test_the_trust_of_an_agent_is_weighted_by_the_services_that_it_rated_and_provided():
    tracker = TrustTracker(make_trust_model("role-trust"), TEAM)
    rounds = [{"srsp_0": [0.2, None]}, {"srsp_0": [0.4, None]}, {"sr_0": [0.3, 0.7], "srsp_0": [0.9, None]}]
    for ratings in rounds:
        tracker.update(ratings)
    tor, top, (toa,) = tracker.trust
    wanted = agent_trust(np.array(tor[1]), np.array(top[1]), rated=np.array(3.0), provided=np.array(1.0), initial=0.5)
    assert toa == wanted != (tor[1] + top[1]) / 2
    assert len({tor[1], top[1], toa}) == 3


def test_a_team_with_newcomers_keeps_its_order():
    team = TEAM.with_newcomers(["sr_1", "sr_0"], ["sp_1"])
    assert team == Team(("sr_0", "srsp_0", "sr_1"), ("sp_0", "srsp_0", "sp_1"))
    assert team.dual_role == ("srsp_0",)
