"""The study of the worlds that decide: its page on games that take seconds, its words, and what is
published."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from csv_files import csv_rows

from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.suite_files import load_suite, suites
from roletrust_env.metrics.confidence import Estimate
from studies import SUITES
from studies.study import run
from studies.worlds import World, sentence

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
CENTRE = World(16, 50, 0.1, 0.05, 0.2)
SMALL = """\
models = ["mean", "constant"]
attacks = ["bad-mouthing", "milking-ring"]
methods = ["scripted"]
games = 4
score = "skill"
tracks = { raters = { roles = ["SR"], shares = [0.3] }, coalition = { roles = ["SR", "SP"], shares = [0.3] } }
[scenarios]
centre = { preset = "market", set = { max_cycles = 6 }, shares = { raters = [0.1, 0.3], coalition = [0.1, 0.3] } }
long = { preset = "market", set = { max_cycles = 9 } }
"""  # noqa: E501


def boards(**tiers):
    """Return leaderboards of the centre and of longer games, from the tier and the skill of each
    model."""
    found = {}
    for k in range(2):
        rows = [
            SimpleNamespace(model=name, tier=one[k][0], worst=Estimate(one[k][1], 0.1))
            for name, one in tiers.items()
        ]
        found[CENTRE._replace(rounds=50 + k)] = sorted(rows, key=lambda row: -row.worst.mean)
    return found


def test_the_numbers_of_a_world_are_those_of_its_own_benchmark(tmp_path):
    (tmp_path / "small.toml").write_text(SMALL)
    run(
        "studies.worlds",
        ["--suite", str(tmp_path / "small.toml"), "--workers", "1", "--out", str(tmp_path)],
    )
    found = csv_rows(tmp_path / "worlds.csv")
    assert len(found) == 3 * 2
    suite = load_suite(tmp_path / "small.toml")
    alone = suite.model_copy(update={"scenarios": {"long": suite.scenarios["long"]}})
    by_hand = {row.model: row for row in benchmark(suite=alone, workers=0, progress=False).rows}
    longer = [row for row in found if row["rounds"] == "9"]
    assert [float(row["attackers"]) for row in longer] == [0.3, 0.3]
    for row in longer:
        assert float(row["skill"]) == pytest.approx(by_hand[row["model"]].worst.mean, abs=1e-6)
        assert int(row["tier"]) == by_hand[row["model"]].tier
    page = (tmp_path / "worlds.md").read_text()
    assert "| rounds 9 | " in page
    assert "| attackers 0.1 | " in page


def test_the_sentence_counts_worlds():
    holds = sentence(boards(a=[(1, 0.9), (1, 0.7)], b=[(2, 0.3), (2, 0.6)]), CENTRE)
    assert (
        "`a` has the highest mean, 0.800, and `b` the next, 0.450. It leads all others in 2 of them"
        in holds
    )
    assert holds.endswith(
        "behind in 0. The highest of a world is `a` in 2. So `a` may be named the leader of all."
    )
    open_ = sentence(boards(a=[(1, 0.9), (1, 0.7)], b=[(2, 0.3), (1, 0.6)]), CENTRE)
    assert (
        "leads all others in 1 of them, is not told apart from some in 1, and is behind in 0. "
        in open_
    )
    turns = sentence(boards(a=[(1, 0.9), (2, 0.5)], b=[(2, 0.3), (1, 0.6)]), CENTRE)
    assert (
        "behind in 1 (rounds 51: `b`). The highest of a world is `a` in 1, `b` in 1. So no model "
        "may" in turns
    )


def test_each_world_of_the_suite_differs_from_its_centre_in_one_thing_and_no_other_suite_has_its_seed():  # noqa: E501
    suite = load_suite(SUITES / "worlds.toml")
    worlds = {World.of(suite.worlds[name], share) for name, _, share in suite.conditions}
    assert len(worlds) == 13
    assert {sum(a != b for a, b in zip(one, CENTRE, strict=True)) for one in worlds - {CENTRE}} == {
        1
    }
    assert not {*suite.seeds} & {
        *range(100),
        *(s for name in suites() for s in load_suite(name).seeds),
    }


def test_the_page_has_the_numbers_of_the_table():
    page = (DOCS / "worlds.md").read_text(encoding="utf-8")
    found = csv_rows(DOCS / "worlds.csv")
    assert {row["model"] for row in found} == set(load_suite(SUITES / "worlds.toml").model_names)
    for row in found:
        assert f"{float(row['skill']):.3f} ± {float(row['skill_half']):.3f}" in page
