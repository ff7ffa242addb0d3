"""Estimated cost of a run, also in scenarios without an agent of the name sr_0."""

import pytest
from small_suites import small

from roletrust_env.benchmark.cells import cells
from roletrust_env.benchmark.cost_estimate import estimate_cost
from roletrust_env.benchmark.run_cell import play_cell


@pytest.mark.parametrize("tracks", [{"honest": {}}, {"honest": {}, "raters": {"roles": ["SR"], "shares": [0.3]}}])
def test_the_estimate_is_an_upper_bound_of_the_rounds(tracks: dict) -> None:
    scenario = {"preset": "peers" if len(tracks) == 1 else "paper-3x3", "set": {"max_cycles": 5}}
    suite = small(models=["mean"], scenarios={"world": scenario}, tracks=tracks, rungs=["scripted"], games=2)
    (cost,) = estimate_cost(suite, cells(suite)).values()
    played = sum(play_cell(suite, cell).env_steps for cell in cells(suite))
    assert cost.env_steps >= played > 0
