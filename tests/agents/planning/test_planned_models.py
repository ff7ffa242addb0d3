"""The planner works on every trust model that is smooth, and says of the others why it does not."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_agents.planning.planner import Planner
from roletrust_env import make_trust_model, trust_models
from roletrust_env.evaluation.search import UnsuitableError, find
from roletrust_env.trust import Traits

RATER = {
    "scenario": "paper-3x3",
    "max_cycles": 8,
    "perturbations": (),
    "noise": 0.0,
    "compromised": ("sr_2",),
}


def found(name: str, budget: int, starts: int) -> float:
    arguments = {**RATER, "objective": "damage", "trust_model": name}
    planner = Planner(starts=starts, samples=1)
    return float(np.mean(find(planner, arguments, budget=budget, seed=0, games=2).scores))


@pytest.mark.parametrize("name", trust_models())
def test_it_plans_or_says_why_not(name: str) -> None:
    if Traits.of(make_trust_model(name)).differentiable:
        assert np.isfinite(found(name, 200, starts=2))
    else:
        with refuses(UnsuitableError, type(make_trust_model(name)).__name__):
            found(name, 200, starts=2)


def test_it_finds_the_mean_wide_open() -> None:
    assert found("mean", 1_000, starts=8) > 0.05
