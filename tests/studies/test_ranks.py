"""The study of what the ranks of the leaderboard depend on: a small run of it."""

from pathlib import Path

import pytest
from csv_files import csv_rows

from roletrust_env.metrics.confidence import Estimate
from studies import ranks
from studies.study import run


def test_ranks_are_in_the_order_of_the_skill() -> None:
    skills = {name: Estimate(mean, 0.1) for name, mean in (("a", 0.2), ("b", 0.5), ("c", -0.1))}
    assert ranks.ranking(skills) == {"b": 1, "a": 2, "c": 3}


@pytest.mark.slow
def test_a_small_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    every = ranks.published_cases()
    settings, models = ("raters", "raters-open"), ("block", "mean", "own-experience")
    wanted = {key: every[key] for key in every if key[0] in models and key[1] in settings}
    monkeypatch.setattr(ranks, "published_cases", lambda: wanted)
    monkeypatch.setattr(ranks, "INITIAL", (0.0, 0.7))
    run("studies.ranks", ["--measured", "3", "--games", "2", "--out", str(tmp_path)])
    skill = {
        (row["variant"], row["model"]): float(row["skill"])
        for row in csv_rows(tmp_path / "ranks.csv")
    }
    assert len(skill) == len(models) * (3 + len(ranks.CHOICES))
    for model in ("block", "own-experience"):
        assert skill["exploration 2%", model] > skill["exploration 20%", model]
    tuned = [float(row["skill"]) for row in csv_rows(tmp_path / "initial_trust.csv")]
    # Without trust in the unknown, consumers stay with the first provider.
    assert tuned[0] < tuned[1] - 0.1
