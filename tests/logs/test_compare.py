"""Which model suits a log: by paired differences of forecasts, and of what is kept under attack."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_env.logs import Log, read
from roletrust_env.logs.compare import Evaluated, compare, decide
from roletrust_env.logs.forecasts import Forecasts
from roletrust_env.trust.key_index import Floats

SIZE, PEOPLE = 2000, 60


@pytest.fixture(scope="module")
def log() -> Log:
    random = np.random.default_rng(0)
    people = random.integers(0, PEOPLE, (2, SIZE))
    quality = random.random(PEOPLE)
    values = np.clip(quality[people[1]] + random.normal(0, 0.2, SIZE), 0, 1)
    return read({"rater": people[0], "ratee": people[1], "rating": values})


def model(log: Log, noise: float, kept: float | None = None, seed: int = 1) -> Evaluated:
    """A model whose trust is the rating with noise, and that keeps so much of 20 targets."""
    random = np.random.default_rng(seed)
    trust = log.values + random.normal(0, noise, SIZE)
    targets = None if kept is None else kept + random.normal(0, 0.02, (2, 20))
    return Evaluated(Forecasts(np.arange(SIZE), trust), targets)


def forecast(trust: Floats) -> Evaluated:
    """A model with this trust, on which no attack was played."""
    return Evaluated(Forecasts(np.arange(SIZE), trust))


def test_decide_recommends_a_significantly_better_forecast(log: Log) -> None:
    standings, recommended, _ = decide(log, {"poor": model(log, 1.0), "good": model(log, 0.1)})
    assert recommended == "good"
    good, poor = standings
    assert (good.name, good.behind) == ("good", (0, 0, 0))
    trust = model(log, 1.0).forecasts.trust
    assert poor.forecast.value == pytest.approx(np.corrcoef(trust, log.values)[0, 1])
    assert poor.behind.low <= poor.behind.value <= poor.behind.high < 0
    assert np.isnan(good.kept.value)


def test_decide_recommends_nothing_without_a_significant_difference(log: Log) -> None:
    for kept in (None, 0.7):
        models = {f"m{seed}": model(log, 0.3, kept, seed) for seed in (1, 2)}
        assert decide(log, models)[1] == ""


def test_decide_prefers_what_keeps_significantly_more(log: Log) -> None:
    models = {"firm": model(log, 0.3, 0.9, 1), "soft": model(log, 0.3, 0.4, 2)}
    standings, recommended, _ = decide(log, {**models, "blind": model(log, 5.0, 1.0, 3)})
    assert recommended == "firm"
    kept = {standing.name: standing.kept.value for standing in standings}
    assert kept["soft"] == pytest.approx(0.4, abs=0.02)


def test_decide_needs_forecasts_of_two_models(log: Log) -> None:
    constant = forecast(np.full(SIZE, 0.5))
    same = log._replace(values=np.full(SIZE, 0.5))
    two = {"one": model(log, 0.1), "other": model(log, 0.2)}
    for one, models in ((log, {"constant": constant}), (log, {}), (same, two)):
        assert decide(one, models)[:2] == ([], "")
    standings, recommended, _ = decide(log, {"alone": model(log, 0.1)})
    assert (len(standings), recommended) == (1, "")


def test_a_comparison_has_frames_and_says_what_is_left_out(
    log: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("roletrust_env.trust.grid_run.MEMORY", 1000.0)
    log = log._replace(times=np.arange(SIZE) * 10**9)
    kept = list[int]()
    found = compare(
        log, ["mean", "travos", "beta"], every=300.0, keep=lambda rows: kept.append(len(rows))
    )
    assert len(found.left_out) == 1
    assert found.left_out[0].startswith("travos")
    table = found.measures
    assert set(table.model) == {"mean", "beta"}
    assert kept == [len(table) // 2, len(table), len(table)]
    known = table[table.low.notna()]
    assert ((known.low <= known.value) & (known.value <= known.high)).all()
    assert [standing.name for standing in found.standings] in (["mean", "beta"], ["beta", "mean"])
    assert found.standings[0].behind == (0, 0, 0)
    with refuses(ValueError, "times"):
        compare(log._replace(times=None), ["mean"])
    with refuses(ValueError, "maen", "mean"):
        compare(log, ["maen"])


def test_equal_forecasts_are_no_difference_and_chance_is_no_forecast(log: Log) -> None:
    trust = model(log, 0.3).forecasts.trust
    assert decide(log, {"one": forecast(trust), "other": forecast(trust * (1 + 1e-12))})[1] == ""
    assert decide(log, {"one": forecast(-trust), "worse": forecast(-log.values)})[1] == ""
    with refuses(TypeError, "dict"):
        compare({}, ["mean"])  # type: ignore[arg-type]
