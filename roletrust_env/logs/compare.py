"""Which trust model suits a log: its forecasts and what it keeps under attack, by paired
differences.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.logs.forecasts import Forecasts, forecast_measures, forecasts
from roletrust_env.logs.log import Log, TooSmallError, check_log
from roletrust_env.logs.models import LOG_MODELS, make_log_model
from roletrust_env.logs.replay import Attack, Replay, Shift, replay_attacks
from roletrust_env.metrics.confidence import Interval
from roletrust_env.metrics.resampling import RESAMPLES
from roletrust_env.randomness import generator
from roletrust_env.storage.markdown import markdown_table, plain
from roletrust_env.trust import Traits, make_trust_model, trust_models
from roletrust_env.trust.key_index import Floats

MONTH = 2_592_000.0
"""Length of a round, 30 days in seconds."""

_HALF = 0.5
"""A model that keeps less of 1 under attack does not resist."""

_TIE = 1e-9  # a smaller difference is none

_NOTHING = Interval(math.nan, math.nan, math.nan)


class Row(NamedTuple):
    """A measure of a model on a log.

    Attributes:
        protocol: How it was measured: `forecast` or `attack`.
        model: Name of the model.
        measure: What was measured, see `forecast_measures` and `replay_attacks`.
        value: Value.
        low: Lower end of its 95% interval.
        high: Upper end.
    """

    protocol: str
    model: str
    measure: str
    value: float
    low: float
    high: float


class Evaluated(NamedTuple):
    """What a model published on a log, for paired comparisons.

    Attributes:
        forecasts: Its forecasts.
        kept: What each target keeps under the worst attack of each goal, from 0 to 1, shape
            (goals, targets); None where the log is too small for attacks.
    """

    forecasts: Forecasts
    kept: Floats | None = None


class Standing(NamedTuple):
    """A model on a log.

    Attributes:
        name: Name of the model.
        forecast: Correlation r of trust with the next ratings of agents that have earlier ones.
        behind: Paired difference of r to that of the best model; 0 for the best.
        kept: Mean of what targets keep under attack.
    """

    name: str
    forecast: Interval
    behind: Interval
    kept: Interval


class Comparison(NamedTuple):
    """The models of a log, the best forecast first.

    Attributes:
        standings: The models that have forecasts.
        recommended: Name of the recommended model; empty where none is.
        reason: Why, in a sentence or two.
        rows: All measures.
        left_out: What could not be measured, and why.
    """

    standings: list[Standing]
    recommended: str
    reason: str
    rows: list[Row]
    left_out: list[str]

    @property
    def measures(self) -> Any:
        """All measures as a data frame of pandas, see `Row`."""
        import pandas as pd

        return pd.DataFrame(self.rows, columns=Row._fields)

    def _repr_markdown_(self) -> str:
        return self.markdown()

    def __repr__(self) -> str:
        """Return the text that a notebook shows."""
        return self.markdown()

    def markdown(self) -> str:
        """Return the recommendation, and a table of each protocol, as Markdown."""
        best = self.recommended or "no model"
        verdict = plain(f"{best} is recommended. {self.reason}")
        parts = ["# Trust models on real ratings", verdict]
        for protocol in dict.fromkeys(row.protocol for row in self.rows):
            rows = [row for row in self.rows if row.protocol == protocol]
            cells = {(row.model, row.measure): interval_text(Interval(*row[3:])) for row in rows}
            measures = list(dict.fromkeys(row.measure for row in rows))
            lines = [
                [plain(model), *(cells.get((model, measure), "-") for measure in measures)]
                for model in dict.fromkeys(row.model for row in rows)
            ]
            parts += [f"## {protocol}", markdown_table(["model", *measures], lines, names=1)]
        if self.left_out:
            parts.append("\n".join(f"- Left out: {plain(reason)}." for reason in self.left_out))
        return "\n\n".join(parts) + "\n"


def compare(
    log: Log,
    models: str | Sequence[str] = (),
    *,
    every: float = MONTH,
    seed: int = 0,
    keep: Callable[[list[Row]], None] = lambda rows: None,
    advance: Callable[[str, float], None] = lambda what, share: None,
) -> Comparison:
    """Return how trust models do on a log, and which suits it.

    Differences are paired: all models are compared in the same resamples, which draw raters and
    ratees both (the pigeonhole bootstrap of Owen, 2007), or targets of attacks. A model is
    recommended if its forecast is significantly better than that of all others, or if, of those
    that are not significantly worse than the best, it keeps significantly more under attack than
    all others, and at least half. Intervals are 95% for each pair, not corrected for their number.

    Args:
        log: Log with times.
        models: Name of a model, or several; all central ones and `LOG_MODELS` if there are none.
        every: Length of a round in seconds.
        seed: Random seed of resamples and draws.
        keep: Function that is called with all measures so far after each model.
        advance: Function that is called with the model that is measured, and the share that is
            done.

    Raises:
        ValueError: The log has no times, nothing could be measured, or there is no such model.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> from roletrust_env.logs import read, write_log
        >>> from roletrust_env.logs.compare import compare
        >>> path = Path(mkdtemp()) / "log.csv.gz"
        >>> write_log(path)
        >>> log = read(path, scale=(-10, 10), same_agents=True)
        >>> compare(log, ["mean", "beta"]).recommended
        'beta'
    """
    check_log(log)
    models = [models] if isinstance(models, str) else models
    if wrong := [model for model in models if not isinstance(model, str)]:
        raise ValueError(f"models has {wrong[0]!r}; it must have names, also package.module:Class")
    made = {name: make_log_model(name) for name in models or default_models()}
    rows, left_out, evaluated = list[Row](), list[str](), dict[str, Evaluated]()
    for done, (name, model) in enumerate(made.items()):
        advance(name, done / len(made))
        try:
            found, published = _measured(model, log, every, seed, left_out)
        except MemoryError as error:
            left_out.append(f"{name}: {error}")
            continue
        if published is not None:
            evaluated[name] = published
        rows += [Row(protocol, name, what, *value) for (protocol, what), value in found.items()]
        if rows:
            keep(rows)
    left_out = list(dict.fromkeys(left_out))  # some reasons are the same for all models
    if not rows:
        raise ValueError(f"nothing could be measured; {'; '.join(left_out)}")
    standings, recommended, reason = decide(log, evaluated, seed)
    paired = {("forecast", one.name, "r"): one.forecast for one in standings}
    rows = [
        Row(*row[:3], *paired[row[:3]]) if row[:3] in paired else row for row in rows
    ]  # intervals of the same resamples as the differences
    keep(rows)
    return Comparison(standings, recommended, reason, rows, left_out)


def default_models() -> list[str]:
    """Return the names of all central models, and of `LOG_MODELS`."""
    central = (
        name for name in trust_models() if Traits.of(make_trust_model(name)).family == "central"
    )
    return [*central, *LOG_MODELS]


def _measured(
    model: Any, log: Log, every: float, seed: int, left_out: list[str]
) -> tuple[dict[tuple[str, str], Interval], Evaluated | None]:
    """Return the measures of a model by protocol and name, and what it published; add what cannot
    be measured to `left_out`.
    """
    found, evaluated = dict[tuple[str, str], Interval](), None
    try:
        evaluated = Evaluated(forecasts(model, log, every))
    except TooSmallError as error:
        left_out.append(f"forecasts: {error}")
    else:
        measures = forecast_measures(evaluated.forecasts, log, seed)
        found = {("forecast", what): value for what, value in measures.items()}
    try:
        replay = Replay(model, log, every, same_agents=log.same_agents)
    except TooSmallError as error:
        left_out.append(f"attacks: {error}")
    else:
        shifts = replay_attacks(replay, seed=seed)
        for attack, shift in shifts.items():
            found["attack", f"{attack.goal}, honest"] = shift.before
            found["attack", f"{attack.goal}, {attack.accounts} {attack.origin}"] = shift.after
        if evaluated is not None:
            evaluated = evaluated._replace(kept=_worst(shifts))
    return found, evaluated


def _worst(shifts: Mapping[Attack, Shift]) -> Any:
    """Return what each target keeps under the worst attack of each goal, shape (2, targets): its
    percentile if the attack sinks it, and what it lacks of the top if the attack lifts it.
    """
    by_goal: dict[str, list[Any]] = {}
    for attack, shift in shifts.items():
        kept = shift.targets if attack.goal == "sink" else 1 - shift.targets
        by_goal.setdefault(attack.goal, []).append(kept)
    return np.stack([min(attacks, key=np.mean) for attacks in by_goal.values()])


def interval_text(value: Interval) -> str:
    """Return a value with the ends of its interval, such as `0.500 (0.400, 0.600)`; a dash if it is
    undefined.
    """
    if math.isnan(value.value):
        return "-"
    if math.isnan(value.low):  # a single user or task has no interval
        return f"{value.value:.3f}"
    return f"{value.value:.3f} ({value.low:.3f}, {value.high:.3f})"


def decide(
    log: Log, models: Mapping[str, Evaluated], seed: int = 0
) -> tuple[list[Standing], str, str]:
    """Return the standings of models on a log, the recommended one, and why, see `compare`.

    Args:
        log: Log.
        models: What each model published, by name.
        seed: Random seed of the resamples.
    """
    names, value, draws = _forecasts(log, models, seed)
    if not names:
        return [], "", "No model has a forecast."
    order = np.argsort(-value, kind="stable")
    best = int(order[0])
    kept = [_kept(models[name], seed) for name in names]
    standings = [
        Standing(
            names[k],
            _interval(float(value[k]), draws[:, k]),
            _interval(float(value[k] - value[best]), draws[:, k] - draws[:, best]),
            _NOTHING if kept[k] is None else _interval(float(kept[k][0]), kept[k][1:]),
        )
        for k in order.tolist()
    ]
    good = [
        k
        for k, standing in zip(order.tolist(), standings, strict=True)
        if k == best or standing.behind.high >= -_TIE
    ]
    if not standings[0].forecast.low > 0:
        return standings, "", "No forecast is significantly better than chance."
    if len(names) == 1:
        return standings, "", "There is one model with a forecast."
    reason = "Its forecast is significantly better than all others."
    if len(good) > 1:
        near = ", ".join(names[k] for k in good)
        reason = f"Not significantly different from the best forecast: {near}."
    found = {k: one for k in good if (one := kept[k]) is not None}
    if len(found) < len(good):
        return standings, names[best] if len(good) == 1 else "", reason
    firm = max(good, key=lambda k: float(found[k][0]))
    if found[firm][0] < _HALF:
        reason += f" None resists: at most {found[firm][0]:.2f} of 1 is kept under attack."
    if len(good) == 1 or found[firm][0] < _HALF:
        return standings, names[best] if len(good) == 1 else "", reason
    others = (found[firm][1:] - found[k][1:] for k in good if k != firm)
    if not all(_interval(0.0, other).low > 0 for other in others):
        return standings, "", reason
    reason += f" Of these, {names[firm]} keeps significantly more under attack."
    return standings, names[firm], reason


def _forecasts(
    log: Log, models: Mapping[str, Evaluated], seed: int
) -> tuple[list[str], Floats, Floats]:
    """Return the models whose trust varies, their correlations, shape (M,), and those in resamples
    of raters and ratees, shape (B, M).
    """
    names = [
        name
        for name, model in models.items()
        if np.ptp(model.forecasts.trust) > 0 and np.ptp(log.values[model.forecasts.ratings]) > 0
    ]
    if not names:
        return [], np.zeros(0), np.zeros((0, 0))
    places = models[names[0]].forecasts.ratings
    trust = np.stack([models[name].forecasts.trust for name in names])
    values, rng = log.values[places], generator(seed)
    sides = [
        np.unique(side, return_inverse=True)[1] for side in (log.raters[places], log.ratees[places])
    ]
    sizes = [int(side.max()) + 1 for side in sides]
    draws = np.empty((RESAMPLES, len(names)))
    for b in range(RESAMPLES):
        weights = np.ones(len(values))
        for side, size in zip(sides, sizes, strict=True):
            weights *= np.bincount(rng.integers(0, size, size), minlength=size)[side]
        draws[b] = _correlations(trust, values, weights)
    return names, _correlations(trust, values, np.ones(len(values))), draws


def _correlations(trust: Floats, values: Floats, weights: Floats) -> Floats:
    """Return the weighted correlation of each row with values, shape (M,)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        total = weights.sum()
        x = trust - (trust @ weights / total)[:, None]
        y = values - values @ weights / total
        spread = np.sqrt((x * x) @ weights * ((y * y) @ weights))
        found: Floats = (x * y) @ weights / spread
    return found


def _kept(model: Evaluated, seed: int) -> Floats | None:
    """Return the mean of what targets keep, and it in resamples of targets, shape (1 + B,)."""
    if model.kept is None:
        return None
    targets = model.kept.shape[1]
    draws = generator(seed).integers(0, targets, (RESAMPLES, targets))
    each = model.kept.mean(axis=0)
    return np.append(each.mean(), each[draws].mean(axis=1))


def _interval(value: float, draws: Floats) -> Interval:
    """Return a value with the 95% interval of its resamples; without one if some are undefined."""
    low, high = np.percentile(draws, [2.5, 97.5])
    return Interval(value, float(low), float(high))
