"""What the page on strategic agents says is what its table says."""

from pathlib import Path

import pytest
from csv_files import csv_rows

from studies.strategic import STARTS, Options

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
MODELS, SCENARIOS, COSTS = Options()[:3]
UNPAID = {"beta", "own-experience"}
CHEAP, DEAR = COSTS

TABLE = csv_rows(DOCS / "strategic" / "strategic.csv")
ROWS = {(row["scenario"], row["model"], float(row["cost"]), row["start"]): row for row in TABLE}


def value(*where, of):
    return float(ROWS[where][of])


def shown_above(low, high):
    """Return whether one welfare is above another one by more than both intervals."""
    (a, ha), (b, hb) = ((float(r["welfare"]), float(r["welfare_half_95"])) for r in (low, high))
    return b - hb > a + ha


def test_the_whole_table_is_there():
    assert set(ROWS) == {
        (s, m, c, b) for s in SCENARIOS for m in MODELS for c in COSTS for b in STARTS
    }


@pytest.mark.parametrize("model", sorted(set(MODELS) - UNPAID))
def test_a_reward_for_agreement_costs_honest_ratings(model):
    for scenario in SCENARIOS:
        for cost in COSTS:
            assert value(scenario, model, cost, "honest", of="honest_raters") < 0.05
            assert value(scenario, model, cost, "nobody learns", of="rater_gain") < 0.05
    assert value("crowd", model, CHEAP, "nobody learns", of="rater_gain") > 0
    assert (
        "following 0 " not in ROWS["crowd", model, CHEAP, "nobody learns"]["rater_deviation"] + " "
    )
    for cost in COSTS:
        learned, drifted = (
            ROWS["crowd", model, cost, start] for start in ("honest", "honest, shuffled")
        )
        assert shown_above(learned, drifted) == (model != "role-trust"), cost


def test_leave_one_out_pays_the_most_for_following_and_nothing_is_left_at_the_higher_cost():
    for scenario in SCENARIOS:
        gains = {m: value(scenario, m, CHEAP, "nobody learns", of="rater_gain") for m in MODELS}
        assert max(gains, key=gains.get) == "leave-one-out"
        assert abs(value(scenario, "leave-one-out", DEAR, "honest", of="welfare")) < 0.01


@pytest.mark.parametrize("model", sorted(UNPAID))
def test_where_raters_have_nothing_to_gain_honesty_lasts(model):
    for where in (("crowd", model, CHEAP), ("crowd", model, DEAR), ("market", model, CHEAP)):
        row = ROWS[(*where, "honest")]
        assert float(row["honest_raters"]) == 1
        assert float(row["honest_providers"]) > 0.8
        assert float(row["anarchy"]) == pytest.approx(1, abs=0.03)
        assert float(ROWS[(*where, "random")]["honest_raters"]) < 0.2
    assert value("crowd", model, CHEAP, "random", of="quality") > 0.9
    assert value("market", model, CHEAP, "random", of="welfare") < 0.5 * value(
        "market", model, CHEAP, "honest", of="welfare"
    )


def test_dear_services_are_cheated_on_in_the_market():
    for model in MODELS:
        row = ROWS["market", model, DEAR, "nobody learns"]
        gains = float(row["provider_gain"]) - float(row["provider_gain_half_95"]) > 0
        assert gains == (model != "qor"), model
        assert value("market", model, DEAR, "honest", of="welfare") < 0.2 * float(row["welfare"])


@pytest.mark.parametrize("model", ["role-trust", "median"])
def test_some_keep_their_welfare_in_the_market_at_the_lower_cost(model):
    where = "market", model, CHEAP
    assert value(*where, "honest", of="welfare") > 0.9 * value(
        *where, "nobody learns", of="welfare"
    )
    low = value(*where, "nobody learns", of="rater_gain") - value(
        *where, "nobody learns", of="rater_gain_half_95"
    )
    assert low < 0.002
