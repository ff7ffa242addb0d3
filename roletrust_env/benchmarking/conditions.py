"""Conditions of a run: how well each tells models apart, and whether the searches in it
converged.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from roletrust_env.benchmarking.verdict import told_apart
from roletrust_env.benchmarking.worst_case import AttackScores, Condition, WorstCase
from roletrust_env.metrics.score import mean_or_nan

FLAT = 0.01
"""Limit of a gain, in the mean reward per round, and of a difference between starts, in the score
of the suite."""


class Convergence(NamedTuple):
    """Shares of the searches that tell their course, each with all its seeds; NaN where none can
    say.

    Attributes:
        flat: Share in which the last doubling of rounds gained `FLAT` at most.
        repeated: Share in which starts with other seeds differ by `FLAT` at most, in the same
            games.
        converged: Share in which both hold.
    """

    flat: float
    repeated: float
    converged: float

    @classmethod
    def of(cls, attacks: Iterable[AttackScores]) -> "Convergence":
        """Return the shares among attacks; those without a course say nothing."""
        pairs = np.array(
            [(attack.gain, attack.difference) for attack in attacks if not np.isnan(attack.gain)]
        ).reshape(-1, 2)
        within = np.column_stack([pairs, pairs.max(axis=1)])
        return cls(
            *mean_or_nan(np.where(np.isnan(within), np.nan, within <= FLAT), axis=0).tolist()
        )


class ConditionRow(NamedTuple):
    """A condition with attackers.

    Attributes:
        condition: Description.
        mean: Mean score of the worst cases over the models.
        least: Least of these scores.
        most: Greatest of these scores.
        spread: Standard deviation of these scores.
        told_apart: Share of the pairs of models that differ by a paired test at 5%.
        attack: Attack that is the worst case of most models.
        flat: Share of searches that are flat, see `Convergence`.
        repeated: Share of searches whose starts agree.
        converged: Share of searches that are both.
    """

    condition: str
    mean: float
    least: float
    most: float
    spread: float
    told_apart: float
    attack: str
    flat: float
    repeated: float
    converged: float


def condition_rows(
    cases: Mapping[tuple[str, Condition], WorstCase],
    struck: Sequence[AttackScores],
    conditions: Sequence[tuple[str, str, float]],
) -> list[ConditionRow]:
    """Return the conditions in which models were attacked, in the order of the suite."""
    rows = []
    for place in (Condition(*fields) for fields in conditions):
        condition_cases = [case for (_, where), case in cases.items() if where == place]
        if condition_cases:
            scores, attacks = (
                np.array([case.mean for case in condition_cases]),
                [case.attack for case in condition_cases],
            )
            spread = float(scores.std(ddof=1)) if len(condition_cases) > 1 else np.nan
            apart = told_apart(np.stack([case.score for case in condition_cases]))
            ends = float(scores.mean()), float(scores.min()), float(scores.max())
            usual = max(attacks, key=attacks.count)
            course = Convergence.of(attack for attack in struck if attack.condition == place)
            rows.append(ConditionRow(place.description, *ends, spread, apart, usual, *course))
    return rows
