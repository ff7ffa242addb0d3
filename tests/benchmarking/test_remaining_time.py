"""The remaining time of a run whose cells differ in cost, against simulated runs."""

import numpy as np
import pytest
from benchmark_cases import Hanging
from small_suites import small

from roletrust_env.benchmarking.cost import RemainingTime
from roletrust_env.benchmarking.learners.suite import LearnersSuite
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.trust import register_trust_model


@pytest.mark.parametrize("seed", range(3))
def test_after_the_first_tenth_the_estimate_is_right_within_a_factor_of_two(seed: int) -> None:
    """Models and methods differ in cost by a factor of a hundred, and trials err by up to a third for each model."""
    random = np.random.default_rng(seed)
    models, methods = np.exp(random.uniform(0, np.log(30), 22)), np.array([0.1, 0.3, 1.0, 20.0])
    errors = random.uniform(2 / 3, 3 / 2, 22) * 7  # of each model, and of the machine
    true = {f"{m}|{c}|{r}": models[m] * methods[r] for m in range(22) for c in range(12) for r in range(4)}
    found = RemainingTime({key: cost * errors[int(key.partition("|")[0])] for key, cost in true.items()})
    passed, whole, checked = 0.0, sum(true.values()), 0
    for key, cost in true.items():
        passed += cost
        found.finish(key)
        left = found.seconds(passed)
        if 0.1 * whole < passed < 0.95 * whole:
            assert left is not None
            assert 0.5 < left / (whole - passed) < 2
            checked += 1
    assert checked > 100
    assert found.share == pytest.approx(1)


def test_before_the_first_cell_nothing_is_known() -> None:
    assert RemainingTime({}).seconds(5.0) is None
    found = RemainingTime({"a": 1.0, "b": 1.0})
    assert found.seconds(5.0) is None
    found.finish("unknown")
    assert found.seconds(5.0) is None
    found.finish("a")
    found.finish("a")
    assert found.seconds(5.0) == pytest.approx(5)


def test_a_model_of_another_package_is_not_tried_outside_a_process_of_its_own() -> None:
    register_trust_model("hanging", Hanging)
    suite = small(models=["mean", "hanging"])
    found = RemainingTime.of(suite, suite.cells())
    for cell in suite.cells():
        found.finish(cell.key)
    assert found.share == 1


def test_trials_of_learners_count_alike() -> None:
    suite = load_suite("learners-quick")
    assert isinstance(suite, LearnersSuite)
    every = suite.cells()
    found = RemainingTime.of(suite, every)
    found.finish(every[0].key)
    assert found.share == pytest.approx(1 / len(every))
