"""What is measured on logs of ratings: each measure against a slow count, and on logs whose answer
is known."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_env.logs import write_log
from roletrust_env.logs.forecasts import (
    earlier,
    forecasts,
    next_rating,
    past_mean,
    rated_before,
    rater_forward,
)
from roletrust_env.logs.log import Log, read
from roletrust_env.logs.replay import Attack, Replay, Shift, replay_attacks
from roletrust_env.metrics.resampling import auc, correlation, interval, mean, ranks
from roletrust_env.trust import make_trust_model

MONTH = 2_592_000


def small_log(edges: list[tuple[int, int, float, float]]) -> Log:
    raters, ratees, values, times = (np.array(column) for column in zip(*edges, strict=True))
    names = [str(n) for n in range(int(max(raters.max(), ratees.max())) + 1)]
    return Log(raters, ratees, values.astype(float), times.astype(int) * 10**9, names, names)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    path = tmp_path_factory.mktemp("log") / "ratings.csv.gz"
    write_log(path)
    return read(path, scale=(-10, 10), same_agents=True)


# --- measures
# -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_auc_counts_pairs_within_strata(seed: int) -> None:
    rng = np.random.default_rng(seed)
    score, bad, strata = (
        rng.integers(0, 5, 40) / 4,
        rng.integers(0, 2, 40) * 1.0,
        rng.integers(0, 3, 40),
    )
    weights = rng.integers(0, 3, 40) * 1.0
    won = pairs = 0.0
    for i in range(40):
        for j in range(40):
            if bad[i] and not bad[j] and strata[i] == strata[j]:
                pairs += weights[i] * weights[j]
                won += (
                    weights[i]
                    * weights[j]
                    * (float(score[i] < score[j]) + float(score[i] == score[j]) / 2)
                )
    assert auc(score, bad, strata)(weights) == pytest.approx(won / pairs)
    assert np.isnan(auc(score, 0 * bad, strata)(weights))


def test_an_interval_of_whole_groups_is_wider() -> None:
    rng = np.random.default_rng(0)
    groups = np.repeat(np.arange(20), 30)
    values = rng.normal(0, 1, 20)[groups] + rng.normal(0, 0.1, 600)
    whole, single = interval(mean(values), groups), interval(mean(values), np.arange(600))
    assert whole.value == single.value == pytest.approx(values.mean())
    assert whole.low < single.low < values.mean() < single.high < whole.high
    assert whole.high - whole.low == pytest.approx(2 * 1.96 * values.std() / np.sqrt(20), rel=0.3)
    assert np.isnan(interval(mean(values), 0 * groups).low)


def test_correlations_and_ranks() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.random(30), rng.random(30)
    twice = rng.integers(0, 3, 30)
    expected = np.corrcoef(np.repeat(x, twice), np.repeat(y, twice))[0, 1]
    assert correlation(x, y)(twice.astype(float)) == pytest.approx(expected)
    assert np.isnan(correlation(x, 0 * y)(np.ones(30)))
    assert ranks(np.array([0.3, 0.1, 0.3, 0.9])).tolist() == [0.5, 0.125, 0.5, 0.875]


# --- forecasts
# ----------------------------------------------------------------------------------------


def test_forecasts_see_no_future() -> None:
    """Ratings of a later round change nothing that was forecast before."""
    edges = [(0, 5, 1.0, 0), (1, 5, 0.0, 12), (2, 5, 0.5, 13), (1, 6, 1.0, 25)]
    model = make_trust_model("role-trust")
    whole = forecasts(model, small_log(edges), 10, same_agents=True)
    assert whole.number.tolist() == [1, 1, 2]
    assert whole.top.tolist()[:2] == [
        0.75 * 0.5 + 0.25,
        0.75 * 0.5 + 0.25,
    ]  # half of 0.5, and half of 0.75 * 1
    changed = forecasts(model, small_log([*edges[:3], (1, 5, 0.0, 25)]), 10, same_agents=True)
    assert np.array_equal(whole.top[:2], changed.top[:2])
    with refuses(ValueError, "100"):
        forecasts(model, small_log(edges), 100, same_agents=True)


def test_only_earlier_rounds_count() -> None:
    log = small_log(
        [(0, 1, 1, 0), (0, 2, 1, 1), (0, 1, 1, 12), (0, 2, 1, 13), (0, 1, 1, 25), (1, 0, 1, 26)]
    )
    found = forecasts(make_trust_model("mean"), log, 10, same_agents=True)
    raters, weights = log.raters[found.since :], np.array([1.0, 1.0, 0.5, 0.5, 0.0, 0.0])
    assert earlier(found, raters, log.raters, weights).tolist() == [2, 2, 3, 0]
    assert earlier(found, raters, log.ratees, weights).tolist() == [0, 0, 0, 1.5]


def test_the_mean_of_the_past_is_that_of_a_loop(log: Log) -> None:
    found = forecasts(make_trust_model("mean"), log, MONTH, same_agents=True)
    numbers = np.concatenate([np.zeros(found.since, int), found.number])
    expected = [
        np.mean(before)
        if (before := log.values[(log.ratees == log.ratees[at]) & (numbers < numbers[at])]).size
        else np.nan
        for at in range(found.since, len(numbers))
    ]
    np.testing.assert_allclose(past_mean(found, log), expected)
    known, values = ~np.isnan(expected), log.values[found.since :]
    measures = rated_before(found, log, (-10, 10))
    assert measures["r, past mean"].value == pytest.approx(
        np.corrcoef(np.array(expected)[known], values[known])[0, 1]
    )
    assert measures["r"].value == pytest.approx(np.corrcoef(found.top[known], values[known])[0, 1])
    assert measures["rmse"].value == pytest.approx(
        20 * rated_before(found, log, (0, 1))["rmse"].value
    )
    assert measures["rmse"].value < 20 * values[known].std()


def test_a_mean_of_the_past_forecasts_cheats(log: Log) -> None:
    good = next_rating(forecasts(make_trust_model("mean"), log, MONTH, same_agents=True), log)
    blind = next_rating(forecasts(make_trust_model("constant"), log, MONTH, same_agents=True), log)
    assert good["auc"].low > 0.6 > blind["auc"].value == 0.5
    assert good["rmse"].high < blind["rmse"].value
    assert np.isnan(blind["r"].value)


def test_contrary_raters_are_found_by_agreement(log: Log) -> None:
    before = forecasts(make_trust_model("deviation-weighted"), log, MONTH, same_agents=True)
    found = rater_forward(before, log)
    assert list(found) == ["ratings", "kindness", "trust", "ToA"]
    assert found["trust"].value > found["ratings"].value
    assert (
        found["trust"] == rater_forward(before._replace(own=before.tor), log)["ToA"]
    )  # two equal trusts
    for model, same in (("mean", True), ("deviation-weighted", False)):
        assert "ToA" not in rater_forward(
            forecasts(make_trust_model(model), log, MONTH, same_agents=same), log
        )


# --- attacks
# ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("same_agents", [True, False])
def test_hostile_accounts_move_their_targets(log: Log, same_agents: bool) -> None:
    attacks = [Attack("sink", 3, "new"), Attack("sink", 10, "hijacked"), Attack("lift", 3, "new")]

    def play(name: str) -> dict[Attack, Shift]:
        return replay_attacks(
            Replay(make_trust_model(name), log, MONTH, same_agents=same_agents), attacks
        )

    moved = play("mean")
    assert moved[attacks[0]].before.value > 0.7 > 0.3 > moved[attacks[0]].after.value
    assert moved[attacks[2]].after.value > moved[attacks[2]].before.value
    still = play("constant")
    assert all(found.before == found.after for found in still.values())


def test_a_log_without_enough_rounds_or_agents_is_refused(log: Log) -> None:
    model = make_trust_model("mean")
    with refuses(ValueError, "4", "6"):
        Replay(model, log, 6 * MONTH, same_agents=True)
    few = small_log([(n % 3, 3, 1.0, n * 10) for n in range(20)])
    with refuses(ValueError, "20", "10", "5"):
        Replay(model, few, 10, same_agents=True)
