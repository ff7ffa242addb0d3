"""Which model suits a log: the best forecast among those that keep about the most under attack."""

from roletrust_baselines.logs.advice import FORECAST, Measures, advise
from roletrust_env.metrics.confidence import Interval


def measured(r: float, sunk: float | None = None, lifted: float = 0.5) -> Measures:
    measures = {FORECAST: Interval(r, r - 0.1, r + 0.1)}
    if sunk is not None:
        measures |= {
            ("attack", what): Interval(value, value, value)
            for what, value in (
                ("sink, honest", 0.0),
                ("sink, 3 new", 0.9),
                ("sink, 10 new", sunk),
                ("lift, 3 new", lifted),
            )
        }
    return measures


def test_what_is_kept_decides_among_forecasts_like_the_best() -> None:
    models = {
        "best": measured(0.5, 0.1),
        "firm": measured(0.45, 0.5),
        "near": measured(0.44, 0.55),
        "blind": measured(0.1, 1.0),
    }
    advice = advise(models)
    assert advice is not None
    assert (advice.model, advice.best, round(advice.kept, 3), round(advice.most, 3)) == (
        "firm",
        "best",
        0.5,
        0.525,
    )
    assert "r 0.45) lies in the interval of the best, best, and it keeps 0.50 of 1" in advice.words


def test_without_attacks_the_forecast_decides_and_without_forecasts_nothing() -> None:
    advice = advise({"best": measured(0.5), "other": measured(0.45)})
    assert advice is not None
    assert advice.words == "Recommended: best. Its forecast (r 0.50) is the best."
    assert advise({"one": {}, "constant": measured(float("nan"))}) is None
