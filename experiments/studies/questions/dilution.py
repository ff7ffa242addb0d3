"""The effect of liars in larger systems."""

from collections.abc import Callable
from math import sqrt

import numpy as np

from roletrust_baselines import BadMouthing
from roletrust_env import Scenario, make_scenario
from roletrust_env.metrics.confidence import Estimate, Floats, estimate
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

QUESTION = "Do larger systems dilute liars?"
_SIZES = 3, 9, 27, 81
_LIES = {"rate 0.5 as in the paper": 0.5, "rate 0": 0.0}
_MANY: dict[str, Callable[[int], int]] = {
    "one liar": lambda size: 1,
    "a third lies": lambda size: size // 3,
}

FALLS, FROM = "fall", "from"


def answer(effort: Effort) -> Finding:
    """Play crowds of several sizes with one liar, and with a third of liars."""
    sizes = effort.values_to_try(_SIZES)
    taken: dict[tuple[str, str, float], Floats] = {}
    for size in sizes:
        scenario = _crowd(size, effort)
        twin = play(effort, scenario)
        for lie, level in _LIES.items():
            for who, many in _MANY.items():
                liars = dict.fromkeys(last(scenario, "SR", many(size)), BadMouthing(level=level))
                seen = play(effort, scenario, liars)
                taken[lie, who, size] = lost(seen, twin, honest(scenario, liars))
    differences = {
        f"{what}, {who}, {lie}": estimate(taken[lie, who, sizes[0]] - rest)
        for who in _MANY
        for lie in _LIES
        for what, rest in ((FALLS, taken[lie, who, sizes[-1]]), (FROM, 0.0))
    }
    panels = [
        Panel(
            f"liars {lie}",
            "raters, and as many providers",
            "trust that the honest lose",
            [
                *lines(taken, lie, _MANY, sizes),
                *(_without_noise(level, who, sizes) for who in _MANY),
            ],
            "log",
        )
        for lie, level in _LIES.items()
    ]
    return Finding(QUESTION, sentence(differences, sizes[0], sizes[-1]), panels, effort.games)


def sentence(differences: dict[str, Estimate], small: int, large: int) -> str:
    """Return the answer from the damage in the smallest system, and from its difference to the
    largest.
    """

    def part(who: str, lie: str) -> str:
        fall, all_of_it = (differences[f"{what}, {who}, {lie}"] for what in (FALLS, FROM))
        return f"{in_words(fall, 'less', 'more')} (of {amount(all_of_it)}) if liars {lie}"

    fixed_number, fixed_share = (" and ".join(part(who, lie) for lie in _LIES) for who in _MANY)
    return (
        f"From {small} raters and as many providers to {large}, a fixed number of liars, one, "
        "takes from the trust of "
        f"the honest {fixed_number}; a fixed share, a third, {fixed_share}."
    )


def closed_form(share: float, level: float) -> tuple[float, float]:
    """Return the loss of honest agents without noise, if a share of the raters rates all services
    `level`.

    With d = 1 - level, the consensus is 1 - share * d. By Algorithms 1 and 2 of Su and Saint-Jore
    (2023), QoR is 1 - sqrt(share * d) for an honest rater and 1 - sqrt((1 - share) * d) for a liar.
    QoP is the mean of rho * QoR * f over the raters, with rho = sinc(1 - f). The size of the system
    does not matter.

    Returns:
        The loss of ToR of honest raters, and the loss of ToP.
    """
    distance = 1 - level
    truthful, lying = 1 - sqrt(share * distance), 1 - sqrt((1 - share) * distance)
    return 1 - truthful, 1 - (1 - share) * truthful - share * lying * level * float(
        np.sinc(distance)
    )


def _crowd(size: int, effort: Effort) -> Scenario:
    crowd = make_scenario("crowd-10x10")
    agents = [{**group.model_dump(), "count": size} for group in crowd.agents]
    return crowd.change(name=f"crowd-{size}x{size}", agents=agents, max_cycles=effort.rounds(40))


def _without_noise(level: float, who: str, sizes: tuple[int, ...]) -> Series:
    """Return the closed form as a mean over the honest agents."""
    values = []
    for size in sizes:
        liars = _MANY[who](size)
        of_raters, of_providers = closed_form(liars / size, level)
        values.append(
            exact(((size - liars) * of_raters + size * of_providers) / (2 * size - liars))
        )
    return Series("closed form, without noise", sizes, values, known=True)
