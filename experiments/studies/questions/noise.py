"""The cost of noise with all agents honest."""

from math import sqrt

import numpy as np

from roletrust_baselines import BadMouthing
from roletrust_env import Scenario, make_scenario
from roletrust_env.metrics.confidence import Estimate, Floats, estimate
from roletrust_env.world.roster import Roster
from roletrust_experiments.plots.charts import Panel, Series
from studies.questions.answers import (
    Effort,
    Finding,
    amount,
    exact,
    honest,
    in_words,
    last,
    lines,
    lost,
    play,
)

QUESTION = "What does noise alone cost, with everybody honest?"
_NOISES = 0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2
_SMALL, _LARGE = 0.005, 0.05
_QUALITIES = {"good services (1)": 1.0, "mediocre services (0.7)": 0.7}
_ROOT_MOMENT = 0.822179
"""E sqrt(|x|) of a standard normal x: 2 ** (1/4) Gamma(3/4) / sqrt(pi)."""

RATERS, PROVIDERS, LIAR, SHARE = "ToR", "ToP", "than a liar", "than its share"


def answer(effort: Effort) -> Finding:
    """Play ten raters and ten providers with growing noise, and once with a liar and no noise."""
    noises = sorted({*effort.values_to_try(_NOISES), _SMALL, _LARGE})
    loss: dict[tuple[str, str, float], Floats] = {}
    calm = _crowd(1.0, 0.0, effort)
    roster = Roster.of(calm)
    raters, providers = range(roster.n_raters), range(roster.n_raters, roster.n_agents)
    for label, quality in _QUALITIES.items():
        twin = play(effort, _crowd(quality, 0.0, effort))
        for noise in noises:
            seen = play(effort, _crowd(quality, noise, effort))
            loss[RATERS, label, noise] = lost(seen, twin, raters)
            loss[PROVIDERS, label, noise] = lost(seen, twin, providers)
    liar = dict.fromkeys(last(calm, "SR", 1), BadMouthing())
    by_liar = lost(play(effort, calm, liar), play(effort, calm), honest(calm, liar))
    good = next(iter(_QUALITIES))
    both = {
        noise: (loss[RATERS, good, noise] + loss[PROVIDERS, good, noise]) / 2
        for noise in (_SMALL, _LARGE)
    }
    differences = {
        RATERS: estimate(loss[RATERS, good, _LARGE]),
        PROVIDERS: estimate(loss[PROVIDERS, good, _LARGE]),
        LIAR: estimate(both[_LARGE] - by_liar),
        SHARE: estimate(both[_SMALL] - both[_LARGE] * _SMALL / _LARGE),
    }
    panels = [
        Panel(
            title,
            "standard deviation of perceived quality",
            "trust lost",
            lines(loss, trust, _QUALITIES, noises)
            + ([_root(noises, len(raters))] if trust == RATERS else []),
            "symlog",
        )
        for trust, title in ((RATERS, "honest raters, ToR"), (PROVIDERS, "honest providers, ToP"))
    ]
    return Finding(QUESTION, sentence(differences), panels, effort.games)


def sentence(differences: dict[str, Estimate]) -> str:
    """Return the answer from the cost of noise and the costs that it is compared with."""
    return (
        f"A noise of {_LARGE:g} where all services are good costs honest raters "
        f"{amount(differences[RATERS])} of their "
        f"ToR and providers {amount(differences[PROVIDERS])} of their ToP; that is, of both, "
        f"{in_words(differences[LIAR])} than one liar among ten raters costs the honest, and a "
        "tenth of the noise "
        f"costs {in_words(differences[SHARE])} than a tenth of it."
    )


def closed_form(noise: float, raters: int) -> float:
    """Return the loss of ToR by Algorithm 1, if raters differ by noise only and no rating is
    clipped.

    A rating differs from the mean of all ratings by N(0, s) with s = noise * sqrt(1 - 1 / raters).
    The mean of the square root of the absolute difference is 0.822 sqrt(s).
    """
    return _ROOT_MOMENT * sqrt(noise * sqrt(1 - 1 / raters))


def _crowd(quality: float, noise: float, effort: Effort) -> Scenario:
    crowd = make_scenario("crowd-10x10").change(noise=noise, max_cycles=effort.rounds(60))
    agents = [
        group.model_dump() | ({"ability": quality} if group.role == "SP" else {})
        for group in crowd.agents
    ]
    return crowd.change(agents=agents)


def _root(noises: list[float], raters: int) -> Series:
    finely = np.concatenate([[0.0], np.geomspace(noises[1], noises[-1], 40)])
    values = [exact(closed_form(float(noise), raters)) for noise in finely]
    return Series("closed form, no note clipped", [float(x) for x in finely], values, known=True)
