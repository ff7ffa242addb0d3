"""The cost of the cells of a run, by which its progress is shown."""

from benchmark_cases import Hanging
from small_suites import small

from roletrust_env.benchmarking.cost import cell_costs
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.trust import register_trust_model


def test_a_model_of_another_package_is_not_tried_outside_a_process_of_its_own() -> None:
    register_trust_model("hanging", Hanging)
    suite = small(models=["mean", "hanging"])
    costs = cell_costs(suite, suite.cells())
    assert list(costs) == [cell.key for cell in suite.cells()]
    assert min(costs.values()) > 0


def test_trials_of_learners_count_alike_and_so_do_cells_of_which_none_can_be_tried() -> None:
    every = load_suite("learners-quick").cells()
    assert set(cell_costs(load_suite("learners-quick"), every).values()) == {1.0}
    broken = small(models=["mean"], methods=["scripted", "no-such-search"])
    assert set(cell_costs(broken, broken.cells()).values()) == {1.0}
