"""Conditions of a suite: how hard each one is, and how well it tells trust models apart."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from roletrust_env.benchmarking.verdict import told_apart
from roletrust_env.benchmarking.worst_case import Condition, WorstCase


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
    """

    condition: str
    mean: float
    least: float
    most: float
    spread: float
    told_apart: float
    attack: str


def condition_rows(
    cases: Mapping[tuple[str, Condition], WorstCase], conditions: Sequence[tuple[str, str, float]]
) -> list[ConditionRow]:
    """Return the conditions in which models were attacked, in the order of the suite.

    Args:
        cases: Worst cases by model and condition.
        conditions: Conditions of the suite.
    """
    rows = []
    for place in (Condition(*one) for one in conditions):
        found = [case for (_, where), case in cases.items() if where == place]
        if found:
            scores, attacks = np.array([case.mean for case in found]), [case.attack for case in found]
            spread = float(scores.std(ddof=1)) if len(found) > 1 else np.nan
            apart = told_apart(np.stack([case.score for case in found]))
            ends = float(scores.mean()), float(scores.min()), float(scores.max())
            rows.append(ConditionRow(place.description, *ends, spread, apart, max(attacks, key=attacks.count)))
    return rows
