"""Trust as a forecast, on logs whose answer is known."""

import numpy as np
import pytest
from refusals import refuses
from small_logs import small_log, synthetic_log

from roletrust_env.logs.forecasts import forecast_measures, forecasts
from roletrust_env.logs.log import Log
from roletrust_env.logs.log_rounds import log_rounds
from roletrust_env.logs.models import make_log_model
from roletrust_env.trust import make_trust_model

MONTH = 2_592_000


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return synthetic_log(tmp_path_factory.mktemp("log"))


def test_forecasts_see_no_future() -> None:
    """Ratings of a later round change nothing that was forecast before, and first ratings of an
    agent are no forecasts."""
    edges = [(0, 5, 1.0, 0), (1, 5, 0.0, 12), (2, 5, 0.5, 13), (1, 6, 1.0, 25)]
    model = make_trust_model("role-trust")
    whole = forecasts(model, small_log(edges), 10)
    assert whole.ratings.tolist() == [1, 2]
    assert whole.trust.tolist() == [0.75 * 0.5 + 0.25] * 2  # half of 0.5, and half of 0.75 * 1
    changed = forecasts(model, small_log([*edges[:3], (1, 5, 0.0, 25)]), 10)
    assert changed.ratings.tolist() == [1, 2, 3]
    assert changed.trust[:2].tolist() == whole.trust.tolist()
    with refuses(ValueError, "100"):
        forecasts(model, small_log(edges), 100)


def test_the_mean_of_the_past_is_that_of_a_loop(log: Log) -> None:
    found = forecasts(make_log_model("all-time-mean"), log, MONTH)
    numbers = log_rounds(log, MONTH)
    expected = {}
    for at in range(len(numbers)):
        before = (log.ratees == log.ratees[at]) & (numbers < numbers[at])
        pairs = dict[tuple[int, int], list[float]]()  # several ratings in a round are one
        for place in np.flatnonzero(before):
            pairs.setdefault((log.raters[place], numbers[place]), []).append(log.values[place])
        if pairs:
            expected[at] = np.mean([np.mean(values) for values in pairs.values()])
    assert found.ratings.tolist() == list(expected)
    np.testing.assert_allclose(found.trust, list(expected.values()))
    measures, values = forecast_measures(found, log), log.values[found.ratings]
    assert measures["r"].value == pytest.approx(np.corrcoef(found.trust, values)[0, 1])


def test_a_mean_of_the_past_forecasts_cheats(log: Log) -> None:
    good, blind = (
        forecast_measures(forecasts(make_trust_model(name), log, MONTH), log)
        for name in ("mean", "constant")
    )
    assert good["auc"].low > 0.6 > blind["auc"].value == 0.5
    assert np.isnan(blind["r"].value)
