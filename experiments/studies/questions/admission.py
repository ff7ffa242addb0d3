"""The effect of admission control."""

from collections.abc import Mapping

import numpy as np

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Policy, Scenario, make_scenario
from roletrust_env.evaluation.measurement import GameRecord
from roletrust_env.metrics.confidence import Estimate, Floats, estimate
from roletrust_env.world.roster import Roster
from roletrust_experiments.plots.charts import Panel
from studies.questions.answers import Effort, Finding, amount, last, lines, listed, play, verdict

QUESTION = "What does admission control buy?"
_THRESHOLDS = 0.1, 0.15, 0.2, 0.25, 0.3, 0.4
_USUAL, _STRICT = 0.25, 0.4
"""Thresholds of the answer; the first is that of the preset `open-system`."""
_ROUNDS = 10
_BAD_RATERS, _BAD_PROVIDERS = 6, 4

CALM = "nobody attacks"
GAIN, BLIND, CUT, CAUGHT = "by trust", "blindly", "honest cut off", "attackers cut off"
STRICT = "strictly, by trust"


def answer(effort: Effort) -> Finding:
    """Play the market with and without admission control, at several thresholds."""
    open_to_all = make_scenario("market").change(max_cycles=effort.rounds(150))
    attacks = _attacks(open_to_all)
    thresholds = sorted({*effort.values_to_try(_THRESHOLDS), _USUAL, _STRICT})
    measures: dict[tuple[str, str, float], Floats] = {}
    for name, attackers in attacks.items():
        free = play(effort, open_to_all, attackers)
        for threshold in thresholds:
            guarded = open_to_all.change(admission={"threshold": threshold, "rounds": _ROUNDS})
            seen = play(effort, guarded, attackers)
            measures[GAIN, name, threshold] = (seen.bought.got - free.bought.got).mean(axis=0)
            measures[BLIND, name, threshold] = (seen.bought.blind - free.bought.blind).mean(axis=0)
            measures[CUT, name, threshold], measures[CAUGHT, name, threshold] = _cut_off(
                open_to_all, attackers, seen
            )
    differences = {
        f"{words}, {name}": estimate(measures[what, name, threshold])
        for words, what, threshold in (
            (GAIN, GAIN, _USUAL),
            (BLIND, BLIND, _USUAL),
            (STRICT, GAIN, _STRICT),
            (CUT, CUT, _USUAL),
        )
        for name in attacks
    }
    panels = [
        Panel(
            title,
            "threshold of trust",
            along,
            lines(
                measures,
                what,
                [name for name in attacks if attacks[name] or what != CAUGHT],
                thresholds,
            ),
        )
        for what, title, along in (
            (GAIN, "what consumers gain who go by trust", "quality, more than without"),
            (BLIND, "what consumers gain who go blindly", "quality, more than without"),
            (CUT, "honest agents cut off", "share of the honest, at the end"),
            (CAUGHT, "attackers cut off", "share of the attackers, at the end"),
        )
    ]
    return Finding(QUESTION, sentence(differences), panels, effort.games)


def sentence(differences: dict[str, Estimate]) -> str:
    """Return the answer from the gain in quality for consumers and the share of honest agents that
    are cut off.
    """

    def part(what: str) -> dict[str, Estimate]:
        start = f"{what}, "
        return {
            f"where {name.removeprefix(start)}": differences[name]
            for name in differences
            if name.startswith(start)
        }

    gains = part(GAIN), part(BLIND), part(STRICT)
    cut = ", ".join(f"{amount(gap)} {where}" for where, gap in part(CUT).items())
    return (
        f"Better service? {verdict(gap for gain in gains for gap in gain.values())}: a threshold "
        f"of {_USUAL:g} for "
        f"{_ROUNDS} rounds brings consumers who go by trust quality of {listed(gains[0])}, and "
        "those who go blindly of "
        f"{listed(gains[1])}; a threshold of {_STRICT:g} brings who goes by trust "
        f"{listed(gains[2])}; and already the "
        f"first cuts off, of the honest and for good, a share of {cut}."
    )


def _attacks(scenario: Scenario) -> dict[str, dict[str, Policy]]:
    return {
        CALM: {},
        "providers are on-off": dict.fromkeys(
            last(scenario, "SP", _BAD_PROVIDERS), OnOff(period=10)
        ),
        "raters lie": dict.fromkeys(last(scenario, "SR", _BAD_RATERS), BadMouthing(level=0.0)),
    }


def _cut_off(
    scenario: Scenario, attackers: Mapping[str, Policy], seen: GameRecord
) -> tuple[Floats, Floats]:
    """Return the shares of honest agents and of attackers that are absent at the end, (G,); NaN
    without agents.
    """
    gone = np.isnan(seen.trust[-1])
    bad = np.array([name in attackers for name in Roster.of(scenario).names])
    nobody = np.full(gone.shape[-1], np.nan)
    return gone[~bad].mean(axis=0), gone[bad].mean(axis=0) if bad.any() else nobody
