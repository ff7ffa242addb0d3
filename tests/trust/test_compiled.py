"""What a compiler is given in place of calls and look-ups."""

import numpy as np
import pytest
import torch

from roletrust_env import make_scenario
from roletrust_env.trust import algorithms
from roletrust_env.world import perturbation


def test_the_polynomial_is_sinc_to_the_rounding_of_float32() -> None:
    x = torch.linspace(0, 1, 100_001)
    found = algorithms._sinc_polynomial(x)
    np.testing.assert_allclose(
        found.numpy(), np.sinc(x.numpy().astype(np.float64)), rtol=0, atol=1.2e-7
    )
    assert found[0] == 1
    assert found[-1] == 0
    assert bool((found.diff() <= 0).all())


def test_perturbations_compared_with_the_round_are_those_of_the_table(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    blows = [(3, 9, 0.5), (5, 7, 1.0), (6, 12, 0.25), (15, 40, 0.75)]
    rules = make_scenario("paper-3x3").change(
        max_cycles=20, perturbations=[{"start": a, "stop": b, "strength": s} for a, b, s in blows]
    )
    rounds = torch.arange(20)
    perturbations = perturbation.Perturbations(rules, torch.zeros(()))
    looked_up = perturbations.strength(rounds)
    monkeypatch.setattr(perturbation, "is_compiling", lambda array: True)
    assert torch.equal(perturbations.strength(rounds), looked_up)
    assert looked_up[[2, 3, 5, 6, 8, 9, 12, 15]].tolist() == [0, 0.5, 1, 1, 0.5, 0.25, 0, 0.75]
