"""The page on longer searches agrees with its tables, and its suite is what it says."""

import csv
from collections import Counter
from pathlib import Path

from roletrust_env.benchmarking.known_attacks import read_known_attacks
from roletrust_env.benchmarking.suite import Suite, with_known
from roletrust_env.benchmarking.suite_files import load_suite
from studies import SUITES

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "leaderboards" / "longer.md").read_text(encoding="utf-8")
WORDS = " ".join(PAGE.split())


def rows(name: str) -> list[dict[str, str]]:
    with (ROOT / "docs" / "leaderboards" / "longer" / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


WORST = [row for row in rows("worst_cases.csv") if float(row["share"])]


def test_the_table_is_the_leaderboard() -> None:
    own = Counter(row["model"] for row in WORST if row["method"] == "evolution strategy")
    assert PAGE.partition("| own |\n")[2].partition("\n\n")[0].splitlines()[1:] == [
        f"| {row['tier']} | `{row['model']}` | "
        + " | ".join(f"{float(row[name]):.3f} ± {float(row[name + '_half_95']):.3f}" for name in ("clean", "worst"))
        + f" | {own[row['model']]} |"
        for row in rows("leaderboard.csv")
    ]
    assert f"In {own.total()} of the {len(WORST)} conditions of all models" in WORDS


def test_the_sentences_on_models_are_true() -> None:
    assert [row["model"] for row in rows("leaderboard.csv") if row["tier"] == "1"] == ["first-hand", "own-experience"]
    place = {"model": "leave-one-out", "scenario": "market", "track": "identities"}
    (lowest,) = (row for row in WORST if row.items() >= place.items())
    assert f"its skill is {float(lowest['score']):.3f}" in WORDS
    older = csv.DictReader((ROOT / "docs" / "first-hand" / "worst_cases.csv").open(encoding="utf-8"))
    (before,) = (row for row in older if row.items() >= place.items())
    assert f"left {float(before['score']):.3f} in other games" in WORDS


def test_the_second_search_finds_hardly_more() -> None:
    first, second = (
        {(row["model"], row["scenario"], row["track"], row["share"]): float(row["score"]) for row in table}
        for table in (WORST, [row for row in rows("again.csv") if float(row["share"])])
    )
    expected = []
    for model in dict.fromkeys(model for model, *_ in second):
        keys = [key for key in second if key[0] == model]
        before, after = (sum(scores[key] for key in keys) / len(keys) for scores in (first, second))
        lower, higher = (sum(sign * (second[key] - first[key]) > 0.02 for key in keys) for sign in (-1, 1))
        expected.append(f"| `{model}` | {before:.3f} | {after:.3f} | {lower} | {higher} |")
        assert len(keys) == 9
        assert (abs(after - before) < 0.004) == (model != "iterative-filtering")
    assert PAGE.partition("| first search | second search |")[2].partition("\n\n")[0].splitlines()[2:] == expected


def test_the_suite_plays_in_conditions_of_the_leaderboard_from_its_known_attacks() -> None:
    longer, suite = load_suite(SUITES / "known-attacks.toml"), load_suite("standard-4")
    assert isinstance(longer, Suite)
    assert isinstance(suite, Suite)
    assert set(longer.conditions) < set(suite.conditions)
    assert len(longer.conditions) * len(longer.models) == len(WORST)
    for name, stage in longer.scenarios.items():
        assert stage.scenario() == suite.scenarios[name].scenario()
    folder = ROOT / "roletrust_env" / "benchmarking" / "suites"
    known = with_known(longer, read_known_attacks(folder / "standard-4-known.json"))
    assert set(known.known) == {one for one in suite.known if one.condition in longer.conditions}
    found = read_known_attacks(folder / "standard-5-known.json")
    assert {one.condition for one in found} == set(longer.conditions)
    following = load_suite("standard-5")
    assert isinstance(following, Suite)
    assert following.known == with_known(suite, found).known
    assert following.conditions == suite.conditions
    assert {longer.budget_of("evolution strategy", name) for name in ("crowd", "market")} == {1_200_000}
