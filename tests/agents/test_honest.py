"""Honest play."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_agents import Honest
from roletrust_env.game.policy import Policy
from roletrust_env.game.views import ProviderView, RaterView


@pytest.mark.parametrize(
    "policy", [Policy(), Honest(), Honest(best=0.3)], ids=["policy", "honest", "less"]
)
@pytest.mark.parametrize("batch", [(), (4,), (2, 3)])
def test_honest_play_serves_its_best_and_reports_what_it_perceived(
    policy: Policy, batch: tuple[int, ...]
) -> None:
    service = np.random.default_rng(0).random((5, *batch))
    one = np.zeros(batch)
    provider = ProviderView(
        one, one + 0.2, one, one, np.zeros((3, *batch)), np.zeros((3, *batch), bool)
    )
    rater = RaterView(one, one, service, service, service > 0.3, service, service > 0)
    quality, memory = policy.quality(provider, None, None)
    assert quality.shape == batch
    assert np.all(quality == getattr(policy, "best", 1.0))
    ratings, memory = policy.ratings(rater, memory, None)
    assert np.array_equal(ratings, service)
    assert not policy.attacks


@pytest.mark.parametrize("best", [-0.1, 1.1, float("nan")])
def test_a_quality_out_of_range_is_refused(best: float) -> None:
    with refuses(ValueError, "best", "[0, 1]", best):
        Honest(best=best)
