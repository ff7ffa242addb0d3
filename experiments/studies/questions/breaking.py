"""The share of liars that breaks each trust model."""

from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from roletrust_env.benchmarking import Suite, benchmark
from roletrust_env.benchmarking.suite import Stage, Track
from roletrust_env.benchmarking.worst_case import WorstCase, worst_cases
from roletrust_env.metrics.confidence import Estimate, Interval, estimate
from roletrust_experiments.plots.charts import Panel, Series
from studies.condition import suite_of
from studies.questions.answers import PATIENCE_S, Effort, Finding, sign

QUESTION = "Which share of liars breaks each trust model?"
_SHARES = 0.1, 0.2, 0.3, 0.4, 0.5, 0.6
_ROUNDS = 30
_FEWER = 4
"""Divisor of the number of games, because all models and all scripts are played and some are
slow."""

_LEAST = 6
"""Minimum number of games; with fewer, the intervals are too wide to show anything."""

_LEFT = 0.5
"""A model is broken where less than this part of the benefit of trust without liars is left."""


BOUND = 0.5
"""Share from which on ratings alone cannot tell an honest world from its mirror image, see
`mirrored`."""


class Break(NamedTuple):
    """Share of liars that breaks a model.

    Attributes:
        share: Estimated share, interpolated between two measured ones; 1 if the model never breaks.
        whole: Largest share up to which the model is shown to hold.
        broken: Smallest share at which the model is shown to be broken; 1 if there is none.
    """

    share: float
    whole: float
    broken: float


def answer(effort: Effort) -> Finding:
    """Play all models against all scripts, with a growing share of liars, in the benchmark's small
    market.
    """
    suite = _suite(effort)
    played = benchmark(suite=suite, progress=False)
    cases = worst_cases(played.attacks)
    left: dict[str, dict[float, Estimate]] = {}
    for model in suite.model_names:
        by_share = {where.share: case for (name, where), case in cases.items() if name == model}
        if set(by_share) == {0.0, *suite.tracks["liars"].shares}:
            left[model] = {
                share: _over_half(case, by_share[0.0]) for share, case in sorted(by_share.items())
            }
    failed = {cell.model: done.failed for cell, done in played.cells if done.failed}
    breaks = {model: breaking(values) for model, values in left.items() if sign(values[0.0]) > 0}
    order = sorted(breaks, key=lambda model: (-breaks[model].share, -breaks[model].whole, model))
    panel = Panel(
        f"less than {_LEFT:g} of what going by published trust is worth is left under the worst "
        "script",
        "",
        "share of the raters that lie",
        [Series("breaks", order, [Interval(*breaks[model]) for model in order])],
        bound=BOUND,
    )
    words = sentence(breaks, set(left) - set(breaks), failed)
    return Finding(QUESTION, words, [panel], suite.games)


def breaking(over: Mapping[float, Estimate]) -> Break:
    """Return the share of liars that breaks a model.

    Args:
        over: Benefit that is left minus the limit for a broken model, by share of liars, from 0 on.
    """
    shares = list(over)
    signs = [sign(over[share]) for share in shares]
    whole = shares[next((k for k, way in enumerate(signs) if way <= 0), len(shares)) - 1]
    broken = next((share for share, way in zip(shares, signs, strict=True) if way < 0), 1.0)
    for low, high in pairwise(shares):
        above, below = over[low].mean, over[high].mean
        if below < 0 <= above:
            crossing = low + (high - low) * above / (above - below)
            return Break(min(max(crossing, whole), broken), whole, broken)
    return Break(1.0, whole, broken)


def sentence(breaks: Mapping[str, Break], worthless: set[str], failed: Mapping[str, str]) -> str:
    """Return the answer from the share that breaks each model; name models without benefit and
    failed ones.
    """
    groups: dict[tuple[float, float], list[str]] = {}
    for model in sorted(
        breaks, key=lambda model: (breaks[model].whole, breaks[model].broken, model)
    ):
        groups.setdefault(breaks[model][1:], []).append(model)
    parts = "; ".join(
        f"{_between(*ends)} lie with {', '.join(names)}" for ends, names in groups.items()
    )
    text = (
        "It depends on the model: under the worst script the worth of going by published trust "
        "falls to half where, "
        f"of the raters, {parts or 'nobody lies'}"
    )
    if worthless:
        text += f"; nothing to lose without liars: {', '.join(sorted(worthless))}"
    if failed:
        text += f"; not measured: {'; '.join(f'{model} ({why})' for model, why in sorted(failed.items()))}"  # noqa: E501
    return text + "."


def _between(whole: float, broken: float) -> str:
    return f"over {whole:.0%} (if at all)" if broken == 1 else f"{whole:.0%} to {broken:.0%}"


def _over_half(case: WorstCase, calm: WorstCase) -> Estimate:
    """Return the benefit of trust over a blind choice in utility, minus half of that benefit
    without liars.
    """
    mine, full = (
        case_measures.measured["utility"] - case_measures.measured["blind"]
        for case_measures in (case, calm)
    )
    return estimate(np.ravel(mine - _LEFT * full))  # of a single seed


def _suite(effort: Effort) -> Suite:
    market = suite_of("quick").scenarios["market"]
    rounds = effort.rounds(_ROUNDS)
    suite = Suite(
        name="liars",
        scenarios={"market": Stage(preset=market.preset, set=market.set | {"max_cycles": rounds})},
        tracks={
            "honest": Track(),
            "liars": Track(roles=("SR",), shares=effort.values_to_try(_SHARES)),
        },
        methods=("scripted",),
        attacks=suite_of("attackers").attacks,
        games=max(_LEAST, effort.games // _FEWER),
        seeds=(effort.seed,),
        limit_s=PATIENCE_S,
    )
    return suite.model_copy(update={"models": effort.values_to_try(suite.model_names)})
