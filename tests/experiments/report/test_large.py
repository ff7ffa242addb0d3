"""A report on a run with some thirty attacks and 12 conditions, and on learners."""

import re
from pathlib import Path
from typing import Any

import large_run
import numpy as np
import pytest

from roletrust_env.benchmarking.worst_case import attack_scores
from roletrust_experiments.report.content import Content, Learners
from roletrust_experiments.report.page import page
from roletrust_experiments.report.robustness import Robustness

MEGABYTE = 1_000_000
MODELS = ["role-trust", "mean", "median", "beta", "trimmed-mean:share=0.3"]
SOFTWARE: dict[str, Any] = {
    "package": {"name": "it", "version": "0"},
    "python": "3",
    "packages": {},
}


@pytest.fixture(scope="module")
def content() -> Content:
    suite, learners = large_run.large(models=MODELS), large_run.learners()
    path = Path("results.sqlite")
    return Content(
        Robustness.of(suite, large_run.stored_cells(suite), SOFTWARE, path),
        Learners.of(learners, large_run.stored_trials(learners), SOFTWARE, path),
    )


def test_the_page_of_a_large_run_is_light_and_has_every_worst_case(content: Content) -> None:
    html = page(content, dict.fromkeys(content.tables, b""), "roletrust report")
    assert len(html) < MEGABYTE
    found = re.search(r'<details class="numbers">(.*?)</details>', html, re.DOTALL)
    assert found is not None
    assert found[1].count('<th scope="row">') == len(content.tables["worst_cases"].rows)


def test_each_model_and_condition_has_one_worst_case(content: Content) -> None:
    columns = content.tables["heatmap"].columns()
    cases = [
        (model, where)
        for model, where, worst in zip(
            columns["model"], columns["condition"], columns["worst"], strict=True
        )
        if worst
    ]
    assert len(cases) == len(set(cases)) == len(MODELS) * 8
    assert content.robustness is not None
    assert [row.condition for row in content.robustness.conditions] == list(
        dict.fromkeys(columns["condition"])
    )
    assert content.robustness.conditions[0].condition == "market, raters 10%"


def test_a_long_game_is_told_in_few_points_that_keep_its_mean(content: Content) -> None:
    """Points of the two rounds that each stands for; of the last one, alone, if it is."""
    suite = large_run.large(models=["role-trust"])
    one = attack_scores(suite, large_run.stored_cells(suite)[:1])[0]
    told = content.tables["curves"].columns()
    place = next(
        k
        for k, model in enumerate(told["model"])
        if model == one.model and told["attack"][k] == one.attack
    )
    assert told["rounds"][place] == [2.5 + 2 * k for k in range(29)] + [60.0]
    expected = [np.mean(one.by_round[k : k + 2]) for k in range(0, 59, 2)]
    np.testing.assert_allclose(told["utility"][place], expected, atol=1e-12)
