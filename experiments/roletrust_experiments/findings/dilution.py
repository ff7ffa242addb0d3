"""Whether larger systems dilute liars."""

from collections.abc import Callable
from math import sqrt

import numpy as np
from roletrust_baselines import BadMouthing

from roletrust_env import Scenario, make_scenario
from roletrust_env.metrics.confidence import Estimate, Floats, estimate
from roletrust_experiments.findings.finding import Finding, amount, exact, interval, told
from roletrust_experiments.findings.games import Asked, as_settings, honest, last, lost, play
from roletrust_experiments.plots.findings import Panel, Series

QUESTION = "Do larger systems dilute liars?"
_SIZES = 3, 9, 27, 81
_LIES = {"rate 0.5 as in the paper": 0.5, "rate 0": 0.0}
_MANY: dict[str, Callable[[int], int]] = {"one liar": lambda size: 1, "a third lies": lambda size: size // 3}

FALLS, FROM = "fall", "from"


def answer(asked: Asked) -> Finding:
    """Play crowds of several sizes with one liar, and with as many as a third."""
    sizes = asked.some(_SIZES)
    taken: dict[tuple[str, str, int], Floats] = {}
    for size in asked.progress.track(sizes, description="larger systems"):
        scenario = _crowd(size, asked)
        twin = play(asked, scenario)
        for lie, level in _LIES.items():
            for who, many in _MANY.items():
                liars = dict.fromkeys(last(scenario, "SR", many(size)), BadMouthing(level=level))
                seen = play(asked, scenario, liars)
                taken[lie, who, size] = lost(seen, twin, honest(scenario, liars))
    differences = {
        f"{what}, {who}, {lie}": estimate(taken[lie, who, sizes[0]] - rest)
        for who in _MANY
        for lie in _LIES
        for what, rest in ((FALLS, taken[lie, who, sizes[-1]]), (FROM, 0.0))
    }
    panels = tuple(
        Panel(
            f"liars {lie}",
            "raters, and as many providers",
            "trust that the honest lose",
            [Series(who, sizes, [interval(estimate(taken[lie, who, size])) for size in sizes]) for who in _MANY]
            + [_without_noise(lie, level, who, sizes) for who in _MANY],
            "log",
        )
        for lie, level in _LIES.items()
    )
    settings = as_settings(_crowd(sizes[-1], asked)) | {"sizes": list(sizes), "lies": _LIES}
    return Finding(QUESTION, sentence(differences, sizes[0], sizes[-1]), panels, differences, asked.games, settings)


def sentence(differences: dict[str, Estimate], small: int, large: int) -> str:
    """The answer, of the damage in the smallest system, and of that less the damage in the largest."""

    def part(who: str, lie: str) -> str:
        fall, all_of_it = (differences[f"{what}, {who}, {lie}"] for what in (FALLS, FROM))
        return f"{told(fall, 'less', 'more')} (of {amount(all_of_it)}) if liars {lie}"

    fixed_number, fixed_share = (" and ".join(part(who, lie) for lie in _LIES) for who in _MANY)
    return (
        f"From {small} raters and as many providers to {large}, a fixed number of liars, one, takes from the trust of "
        f"the honest {fixed_number}; a fixed share, a third, {fixed_share}."
    )


def closed_form(share: float, level: float) -> tuple[float, float]:
    """What honest raters and providers lose without noise, where a share of the raters rates all good services `level`.

    With d = 1 - level the consensus is 1 - share * d, so that (Algorithms 1 and 2 of Su and Saint-Jore, 2023)
    QoR = 1 - sqrt(share * d) of the honest and 1 - sqrt((1 - share) * d) of a liar, and QoP is the mean of
    rho * QoR * f over the raters, with rho = sinc(1 - f). Size has no part in it.

    Returns:
        The loss of ToR by the honest raters, and of ToP.
    """
    distance = 1 - level
    truthful, lying = 1 - sqrt(share * distance), 1 - sqrt((1 - share) * distance)
    return 1 - truthful, 1 - (1 - share) * truthful - share * lying * level * float(np.sinc(distance))


def _crowd(size: int, asked: Asked) -> Scenario:
    crowd = make_scenario("crowd-10x10")
    agents = [{**group.model_dump(), "count": size} for group in crowd.agents]
    return crowd.change(name=f"crowd-{size}x{size}", agents=agents, max_cycles=asked.rounds(40))


def _without_noise(lie: str, level: float, who: str, sizes: tuple[int, ...]) -> Series:
    """The closed form, the mean over the honest."""
    values = []
    for size in sizes:
        liars = _MANY[who](size)
        of_raters, of_providers = closed_form(liars / size, level)
        values.append(exact(((size - liars) * of_raters + size * of_providers) / (2 * size - liars)))
    return Series("closed form, without noise", sizes, values, known=True)
