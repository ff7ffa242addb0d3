"""The effect of movement: each rater sees only some providers."""

from roletrust_baselines import BadMouthing
from roletrust_env import Scenario, make_scenario, metrics
from roletrust_env.metrics.confidence import Estimate, Floats, estimate
from roletrust_experiments.plots.charts import Panel
from studies.questions.answers import Effort, Finding, honest, last, lines, listed, lost, play

QUESTION = "What does movement do, where each rater sees only the providers near it?"
_ARENA = 10.0
_RADII = 2.0, 3.0, 4.0, 6.0, 8.0
_EVERYONE = 15.0
"""Radius that reaches from corner to corner of the arena."""
_NEAR, _USUAL = 2.0, 4.0
"""Radii of the answer; the larger one is that of the preset `robots-that-move`."""
_SPEEDS = {"robots move": 0.3, "robots stand still": 0.0}
_LIARS = 3

HARM, UTILITY = "harm", "utility"
EVERYONE, STILL = "than everyone", "than still"


def answer(effort: Effort) -> Finding:
    """Play a crowd of robots with several radii, moving and standing still, with three liars and
    with none.
    """
    radii = sorted({*effort.values_to_try(_RADII), _NEAR, _USUAL, _EVERYONE})
    liars = dict.fromkeys(last(_robots(effort, _USUAL, 0.0), "SR", _LIARS), BadMouthing())
    measures: dict[tuple[str, str, float], Floats] = {}
    for label, speed in _SPEEDS.items():
        for radius in radii:
            scenario = _robots(effort, radius, speed)
            calm, struck = play(effort, scenario), play(effort, scenario, liars)
            measures[HARM, label, radius] = lost(struck, calm, honest(scenario, liars))
            measures[UTILITY, label, radius] = metrics.share_of_best(
                calm.bought.got, calm.bought.best
            ).value
    moving, still = _SPEEDS
    differences = {
        f"{what}, {radius:g} m, {name}": estimate(
            measures[what, moving, radius] - measures[what, *other]
        )
        for what in (HARM, UTILITY)
        for radius in (_USUAL, _NEAR)
        for name, other in ((EVERYONE, (moving, _EVERYONE)), (STILL, (still, radius)))
    }
    panels = [
        Panel(
            title,
            f"radius in metres, in an arena of {_ARENA:g} m",
            along,
            lines(measures, what, _SPEEDS, radii),
        )
        for what, title, along in (
            (HARM, f"what {_LIARS} liars of ten raters take", "trust that the honest lose"),
            (UTILITY, "what trust is worth with nobody lying", "utility of going by trust"),
        )
    ]
    return Finding(QUESTION, sentence(differences), panels, effort.games)


def sentence(differences: dict[str, Estimate]) -> str:
    """Return the answer from the differences of moving robots to robots that see everybody or stand
    still.
    """

    def parts(what: str, other: str) -> str:
        radii = (_USUAL, _NEAR)
        return listed(
            {
                f"within {radius:g} m": differences[f"{what}, {radius:g} m, {other}"]
                for radius in radii
            }
        )

    return (
        f"Where robots move and see only those near them, liars take from the trust of the honest "
        f"{parts(HARM, EVERYONE)} than where all see everybody, and with nobody lying the utility "
        "of going by trust is "
        f"{parts(UTILITY, EVERYONE)}; moving rather than standing still, they take "
        f"{parts(HARM, STILL)}, and that "
        f"utility is {parts(UTILITY, STILL)}."
    )


def _robots(effort: Effort, radius: float, speed: float) -> Scenario:
    crowd = make_scenario("crowd-10x10")
    agents = [
        group.model_dump() | ({"ability": (0.3, 1.0)} if group.role == "SP" else {})
        for group in crowd.agents
    ]
    access = {"kind": "in-range", "radius": radius, "arena": _ARENA, "speed": speed}
    return crowd.change(agents=agents, access=access, max_cycles=effort.rounds(150))
