"""Answers: games that are measured, and the rules that turn their numbers into words.

The words cannot contradict the numbers. A difference of two means is shown if its 95% interval does
not contain 0. Differences are paired: both sides play the same games with the same random numbers.
Intervals are not corrected for multiple comparisons.
"""

from collections.abc import Iterable, Mapping, Sequence
from math import ceil
from typing import NamedTuple, TypeVar

from roletrust_env import Policy, Scenario, metrics
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import Floats, GameRecord, exact_task, watch
from roletrust_env.game.consumer import Bought
from roletrust_env.metrics.confidence import Estimate, Interval, estimate
from roletrust_env.world.group import Role
from roletrust_env.world.roster import Roster
from roletrust_experiments.plots.charts import Panel, Series

T = TypeVar("T")
At = TypeVar("At", float, str)

SETTLED = 10
"""Rounds after which the initial trust counts for 2 ** -10 at most, where lam is 0.5."""

_QUICK_ROUNDS, _QUICK_VALUES = 14, 2


class Effort(NamedTuple):
    """Effort for a question.

    Attributes:
        games: Number of games of each mean.
        seed: Random seed.
        quick: True for short games and the first values only, to check that everything works.
    """

    games: int
    seed: int
    quick: bool

    def values_to_try(self, values: Iterable[T]) -> tuple[T, ...]:
        """Return the values to try."""
        return tuple(values)[:_QUICK_VALUES] if self.quick else tuple(values)

    def rounds(self, many: int) -> int:
        """Return the length of a game in rounds."""
        return min(many, _QUICK_ROUNDS) if self.quick else many


def play(
    effort: Effort, scenario: Scenario, attackers: Mapping[str, Policy] | None = None
) -> GameRecord:
    """Play a scenario under the paper's model, with the same random numbers for all attacks.

    Returns:
        Trust of shape (T, N, G), and purchases of shape (T - 1, G).
    """
    arguments = {
        "scenario": scenario,
        "trust_model": "role-trust",
        "compromised": tuple(
            attackers or Roster.of(scenario).owner_names[:1]
        ),  # who is named and has no policy is honest
        "objective": "mislead",
    }
    seen = watch(exact_task(arguments), Scripted(attackers or {}), effort.seed, (1, effort.games))
    own, public = (
        Bought(*(part[:, 0] for part in bought)) for bought in (seen.bought, seen.published)
    )
    return GameRecord(seen.trust[:, :, 0], own, public)


def lost(seen: GameRecord, twin: GameRecord, agents: Iterable[int]) -> Floats:
    """Return the trust that agents lost against other games with the same random numbers, once it
    has settled, (G,).
    """
    return metrics.damage(seen.trust[SETTLED:], twin.trust[SETTLED:], list(agents)).value


def last(scenario: Scenario, role: Role, many: int) -> tuple[str, ...]:
    """Return the names of the last agents of a role, such as `SR`."""
    roster = Roster.of(scenario)
    return tuple(name for name in roster.owner_names if roster.role(name) == role)[-many:]


def honest(scenario: Scenario, attackers: Mapping[str, Policy]) -> list[int]:
    """Return the indices of all agents that do not attack."""
    return [place for place, name in enumerate(Roster.of(scenario).names) if name not in attackers]


_SAME = 1e-9
"""Largest difference that is due to rounding."""

_DIGITS = range(3, 10)
"""Numbers of decimals; a number gets as few as possible without hiding a difference that is
shown."""


class Finding(NamedTuple):
    """An answer to a question.

    Attributes:
        question: Question in words.
        sentence: Answer in words.
        panels: Panels of the figure.
        games: Number of games of each mean.
    """

    question: str
    sentence: str
    panels: Sequence[Panel]
    games: int


def lines(
    measures: Mapping[tuple[str, str, At], Floats],
    what: str,
    labels: Iterable[str],
    at: Sequence[At],
) -> list[Series]:
    """Return a line for each label: means over the games with their intervals.

    Args:
        measures: Numbers of each game, by what they are, the label and the position, shape (G,)
            each.
        what: What is drawn.
        labels: Labels of the lines.
        at: Positions.
    """
    return [
        Series(label, at, [estimate(measures[what, label, x]).interval for x in at])
        for label in labels
    ]


def sign(difference: Estimate) -> int:
    """Return 1 or -1 if a difference is shown to be above or below 0, else 0, also for a single
    game.

    Example:
        >>> sign(Estimate(0.2, 0.1)), sign(Estimate(-0.2, 0.1)), sign(Estimate(0.1, 0.2))
        (1, -1, 0)
    """
    shown = abs(difference.mean) > difference.half + _SAME
    return (1 if difference.mean > 0 else -1) if shown else 0


def verdict(differences: Iterable[Estimate]) -> str:
    """Return in words whether all differences are shown to be above 0.

    Example:
        >>> up, down, open = Estimate(0.2, 0.1), Estimate(-0.2, 0.1), Estimate(0.1, 0.2)
        >>> verdict([up, up]), verdict([down]), verdict([up, down]), verdict([up, open]), verdict([open])
        ('Yes', 'No, the other way round', 'It depends', 'It depends', 'Not shown')
    """  # noqa: E501
    signs = {sign(difference) for difference in differences}
    if len(signs) != 1:
        return "It depends"
    return {1: "Yes", -1: "No, the other way round", 0: "Not shown"}[signs.pop()]


def amount(value: Estimate) -> str:
    """Return a mean and half its interval, rounded up, with enough decimals to agree with `sign`.

    Example:
        >>> amount(Estimate(0.21342, 0.0041)), amount(Estimate(0.00044, 0.00043))
        ('0.213 ± 0.005', '0.00044 ± 0.00043')
    """
    if value.half != value.half:
        return f"{value.mean:.{_DIGITS[0]}f}, with no interval"
    for digits in _DIGITS:
        shown = Estimate(
            round(value.mean, digits) + 0.0, ceil(value.half * 10**digits - _SAME) / 10**digits
        )
        if sign(shown) == sign(value):
            break
    return f"{shown.mean:.{digits}f} ± {shown.half:.{digits}f}"


def in_words(
    difference: Estimate,
    more: str = "more",
    less: str = "less",
    neither: str = "neither more nor less",
) -> str:
    """Return a difference in words.

    Example:
        >>> in_words(Estimate(-0.25, 0.01)), in_words(Estimate(0.001, 0.01))
        ('0.250 ± 0.010 less', 'neither more nor less (0.001 ± 0.010)')
    """
    way = sign(difference)
    if not way:
        return f"{neither} ({amount(difference)})"
    size = difference._replace(mean=abs(difference.mean))
    return f"{amount(size)} {more if way > 0 else less}"


def listed(differences: Mapping[str, Estimate]) -> str:
    """Return differences in words, by place: first those that are shown, then the bounds of the
    others.

    Example:
        >>> listed({"here": Estimate(0.25, 0.01), "there": Estimate(0.001, 0.01), "yonder": Estimate(0.01, 0.01)})
        '0.250 ± 0.010 more here and neither more nor less there or yonder (within ± 0.020)'
    """  # noqa: E501
    parts = [
        f"{in_words(difference)} {where}"
        for where, difference in differences.items()
        if sign(difference)
    ]
    hidden = {
        where: difference for where, difference in differences.items() if not sign(difference)
    }
    if hidden:
        bound = max(abs(difference.mean) + difference.half for difference in hidden.values())
        words = (
            f"within ± {ceil(bound * 1000 - _SAME) / 1000:.3f}"
            if bound == bound
            else "with no interval"
        )
        parts.append(f"neither more nor less {' or '.join(hidden)} ({words})")
    return f"{', '.join(parts[:-1])} and {parts[-1]}" if len(parts) > 1 else parts[0]


def exact(value: float) -> Interval:
    """Return an exact number as an interval for a figure."""
    return Interval(value, value, value)
