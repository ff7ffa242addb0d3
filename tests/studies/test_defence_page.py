"""The page on learned defence says what its tables say, and `make study NAME=defend` makes them."""

import re
from pathlib import Path

import pytest
from csv_files import csv_rows

pytestmark = pytest.mark.slow

HOUSE = Path(__file__).parents[2]
FOLDER = HOUSE / "docs" / "defence"
PAGE = (HOUSE / "docs" / "defence.md").read_text(encoding="utf-8")
TABLES = (FOLDER / "defence.md").read_text(encoding="utf-8")
COLUMNS = ("clean", "worst", "strangers", "worlds")
CENTRAL = ("leave-one-out", "iterative-filtering", "wary-role-trust", "role-trust")
JUDGES = ("travos", "own-experience", "first-hand")


def rows(name):
    return csv_rows(FOLDER / name)


MODELS = {re.sub(r", trained.*", ", trained", row["model"]): row for row in rows("comparison.csv")}
LEADS = {(row["model"].partition(",")[0], row["beside"]): row for row in rows("leads.csv")}
ITERATIONS = rows("iterations.csv")
LEARNERS = ("leave-one-out", "first-hand", "network")


def shown(row, column):
    """A mean and half of its interval, as the tables have it."""
    value, low, high = (float(row[f"{column}{end}"]) for end in ("", "_low", "_high"))
    return f"{value + 0.0:.3f} ± {(high - low) / 2:.3f}"


def sign(row, column):
    """1 if a lead is above 0 by more than its interval, -1 if it is below, 0 if neither is
    shown."""
    return (float(row[f"{column}_low"]) > 0) - (float(row[f"{column}_high"]) < 0)


def test_the_tables_are_those_of_the_numbers():
    for row in MODELS.values():
        assert (
            f"| `{row['model']}` | {' | '.join(shown(row, column) for column in COLUMNS)} |"
            in TABLES
        )
    for row in rows("leads.csv"):
        cells = " | ".join(shown(row, column) for column in COLUMNS)
        assert f"| `{row['model']}` | `{row['beside']}` | {cells} |" in TABLES
    assert set(MODELS) == {*(f"{name}, trained" for name in LEARNERS), *CENTRAL, *JUDGES}
    assert set(LEADS) == {(ours, other) for ours in LEARNERS for other in (*CENTRAL, *JUDGES)}


def test_a_lead_is_the_difference_of_two_means():
    for (ours, other), row in LEADS.items():
        for column in COLUMNS:
            apart = float(MODELS[f"{ours}, trained"][column]) - float(MODELS[other][column])
            assert float(row[column]) == pytest.approx(apart, abs=2e-5)


def on_logs(model):
    """What a model does on logs, by the columns of the page."""
    columns = (("next rating", "r"), ("next rating", "rmse"), ("attack", "sink, 3 hijacked"))
    found = {
        (row["protocol"], row["measure"]): row for row in rows("logs.csv") if row["model"] == model
    }
    return [found[column] for column in columns]


LEARNED_SPECS = {
    "`leave-one-out`, trained": (FOLDER / "leave-one-out.txt").read_text(encoding="utf-8").strip(),
    "network, trained": "roletrust_agents.learned.saved_defence:SavedTrust:path=docs/defence/network",  # noqa: E501
}


def test_the_table_of_the_logs_is_that_of_the_numbers():
    table = PAGE.partition("## On real ratings")[2].partition("## What it does not say")[0]
    names = re.findall(r"^\| ([^|]+?) \| +\d", table, re.MULTILINE)
    assert len(names) == 6
    for name in names:
        cells = [
            f"{float(row['value']):.3f}"
            for row in on_logs(LEARNED_SPECS.get(name, name.strip("`")))
        ]
        assert f"| {name} | {' | '.join(cells)} |" in table


def test_learned_models_forecast_as_well_and_are_lower_under_hijacked_accounts():
    by_hand = on_logs("leave-one-out")
    for spec in LEARNED_SPECS.values():
        forecast, *_, attacked = on_logs(spec)
        assert abs(float(forecast["value"]) - float(by_hand[0]["value"])) < 0.01
        assert float(attacked["value"]) < float(by_hand[-1]["value"])
        assert float(attacked["high"]) > float(by_hand[-1]["low"])


ATTACKED = ("worst", "strangers", "worlds")


def test_trained_first_hand_beats_every_fixed_model_but_the_one_that_it_begins_from():
    others = {
        sign(LEADS["first-hand", other], column)
        for other in (*CENTRAL, *JUDGES[:2])
        for column in ATTACKED
    }
    assert others == {1}
    assert [sign(LEADS["first-hand", "first-hand"], column) for column in COLUMNS] == [-1, 0, 0, 0]
    for column in ("worst", "strangers"):
        assert max(MODELS, key=lambda name: float(MODELS[name][column])) == "first-hand, trained"


@pytest.mark.parametrize("learner", ["leave-one-out", "network"])
def test_training_without_experience_helps_and_does_not_replace_experience(learner):
    assert [sign(LEADS[learner, "leave-one-out"], column) for column in ATTACKED] == [1, 1, 1]
    assert [sign(LEADS[learner, "first-hand"], column) for column in ATTACKED] == [-1, -1, 0]
    for judge in ("own-experience", "travos"):
        signs = [sign(LEADS[learner, judge], column) for column in ATTACKED]
        assert max(signs[:2]) <= 0
        assert signs[2] == 1


def test_little_is_left_to_win_after_two_iterations():
    for row in ITERATIONS[1:]:
        assert float(row["nash_conv_low"]) <= 0 <= float(row["nash_conv_high"])
