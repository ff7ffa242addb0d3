"""The page on attackers agrees with the games of its suite."""

import csv
import gzip
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import load_suite

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "attackers.md").read_text(encoding="utf-8")
TASKS = "provider", "rater"


def before() -> set[str]:
    suite = load_suite("standard")
    assert isinstance(suite, Suite)
    return {"CMA-ES", *suite.attacks}


class Found(NamedTuple):
    rung: str
    attack: str
    chosen: float
    measured: float


def mean(cell: str) -> float:
    values = [float(value) for value in cell.split()]
    return sum(values) / len(values)


def worst(found: list[Found]) -> float:
    return min(found, key=lambda one: one.chosen).measured


@pytest.fixture(scope="module")
def conditions() -> dict[str, list[list[Found]]]:
    found: dict[tuple[str, ...], list[Found]] = defaultdict(list)
    with gzip.open(DOCS / "attackers" / "games.csv.gz", "rt", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["model"] != "constant" and row["track"] not in ("honest", "perturbed"):
                key = tuple(row[name] for name in ("track", "scenario", "share", "model"))
                one = Found(row["rung"], row["attack"], mean(row["chosen_utility"]), mean(row["utility"]))
                found[key].append(one)
    tracks: dict[str, list[list[Found]]] = defaultdict(list)
    for key, attacks in found.items():
        tracks[key[0]].append(attacks)
    return tracks


def test_the_table_is_that_of_the_games(conditions: dict[str, list[list[Found]]]) -> None:
    old_attacks, lines = before(), []
    for track, cells in conditions.items():
        now = [worst(cell) for cell in cells]
        old = [worst([one for one in cell if one.attack in old_attacks]) for cell in cells]
        scripts = [worst([one for one in cell if one.rung == "scripted"]) for cell in cells]
        lower = sum(low < high for low, high in zip(now, old, strict=True))
        clearly = sum(low < high - 0.01 for low, high in zip(now, old, strict=True))
        above = [high - low for high, low in zip(now, scripts, strict=True) if high > low]
        most = f"{max(above):.3f}" if above else ""
        lines.append(f"| {track} | {len(cells)} | {lower} | {clearly} | {len(above)} | {most} |")
    table = PAGE.partition("| track |")[2].partition("\n\n")[0].splitlines()[2:]
    assert sorted(table) == sorted(lines)


@pytest.mark.parametrize(
    ("way", "model"), [("evolution", "subjective-logic"), ("evolution strategy", "wary-role-trust")]
)
def test_the_gain_of_the_last_doubling_is_that_of_the_table(way: str, model: str) -> None:
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    with (DOCS / "attackers" / "budget.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["way"] == way and row["utility"]:
                found[row["model"], row["budget"]].append(float(row["utility"]))
    names = {name for name, _ in found}
    gains = {name: np.mean(found[name, "1000000"]) - np.mean(found[name, "2000000"]) for name in names}
    exception = f"{gains.pop(model):.3f}".lstrip("0")
    most = f"{max(gains.values()):.3f}".lstrip("0")
    assert f"at most {most} by `{way}`, except against `{model}` ({exception})" in " ".join(PAGE.split())


def test_the_shares_of_the_optimum_are_those_of_the_runs() -> None:
    shares: dict[tuple[str, str], tuple[float, ...]] = {}
    with (DOCS / "attackers" / "optimum.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            assert (row["budget"], row["runs"]) in {("100000", "5"), ("100000", "10")}  # a task, or both
            interval = tuple(float(row[name]) for name in ("share", "share_low_95", "share_high_95"))
            shares[row["learner"], row["task"]] = interval
    table = (DOCS / "attackers" / "optimum.md").read_text(encoding="utf-8")
    learners = {learner for learner, _ in shares}
    assert table.count("| 100,000 |") == len(learners) == 4
    for learner in learners:
        cells = " | ".join("{:.2f} [{:.2f}, {:.2f}]".format(*shares[learner, task]) for task in ("all tasks", *TASKS))
        assert f"| 100,000 | `{learner}` | {cells} |" in table
    provider, rater = ("{:.3f} [{:.3f}, {:.3f}]".format(*shares["PPO", task]) for task in TASKS)
    told = f"keeps {provider} of the optimum of a provider and {rater} of the bound"
    assert told in " ".join(PAGE.split())
    assert min(shares["PPO", task][0] for task in TASKS) >= 0.97
    for task in TASKS:  # evolution a little behind, scripts further
        assert shares["PPO", task][0] > max(
            found[0] for (name, of), found in shares.items() if of == task and "ev" in name
        )
        assert shares["CMA-ES", task][0] == min(found[0] for (_, of), found in shares.items() if of == task)
