"""Places of agents: they do not matter to models that treat all alike, and the measure sees those that do not."""

import pytest
from benchmark_cases import tiny

from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.cells import task_arguments
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.trust.random_order import RandomOrder
from studies import SUITES
from studies.reruns import place_effects

pytestmark = pytest.mark.slow

GAMING = "benchmark_cases:FirstRaters"


def played(places, consumers="public"):
    suite = tiny(
        models=["mean", "travos", GAMING],
        attacks=["complementary"],
        tracks={"honest": {}, "raters": {"roles": ["SR"], "shares": [0.5]}},
        methods=["scripted"],
        games=60,
        seeds=[4, 5],
        places=places,
        consumers=consumers,
    )
    return suite, benchmark(suite=suite, workers=0, progress=False).cells


@pytest.fixture(scope="module")
def runs():
    """The same games with liars at the last places and with all agents shuffled."""
    return played("last"), played("shuffled")


def test_places_do_not_matter_to_models_that_treat_all_alike(runs):
    raters = played("random", "raters"), played("shuffled", "raters")
    for one, other in runs, raters:
        mean, travos, _ = place_effects(one[1], *other)
        for effect in mean, travos:
            assert effect.clean_change.mean == pytest.approx(0, abs=1e-9)
            assert effect.worst_change.mean == pytest.approx(0, abs=1e-9)


def test_the_measure_sees_a_model_that_believes_the_first_raters(runs):
    *_, gaming = place_effects(runs[0][1], *runs[1])
    assert gaming.worst_change.interval.high < -0.02


@pytest.mark.parametrize(("places", "seated"), [("last", [0, 0]), ("random", [0, 1]), ("shuffled", [1, 1])])
def test_models_of_the_project_see_other_places_only_in_a_shuffled_suite(places, seated):
    suite = tiny(models=["mean", GAMING], places=places)
    firsts = [next(cell for cell in suite.cells() if cell.model == model) for model in suite.models]
    assert [isinstance(task_arguments(suite, cell)["trust_model"], RandomOrder) for cell in firsts] == seated


def test_the_suite_is_a_part_of_the_suite_of_reruns():
    whole, shuffled = load_suite(SUITES / "reruns.toml"), load_suite(SUITES / "reruns-shuffled.toml")
    assert set(shuffled.seeds) < set(whole.seeds)
    names = {"name", "description", "seeds", "places"}
    assert shuffled.model_dump(exclude=names) == whole.model_dump(exclude=names)
    assert (whole.places, shuffled.places) == ("random", "shuffled")
