"""The worst case of each trust model in each condition, chosen in some games and measured in others.

A condition is a scenario, a track and a share. Its worst case is the attack that leaves the least score in the games
for choosing. Rungs with more knowledge than a real attacker are excluded. The result is the score in the games for
measuring, on the scale of the suite, see `Suite.score`.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmark.schema import AttackResult
from roletrust_env.benchmark.store import StoredCell
from roletrust_env.benchmark.suite import WHITE_BOX_RUNGS, Scale
from roletrust_env.metrics.consumers import skill
from roletrust_env.metrics.score import mean_or_nan

Floats = npt.NDArray[np.float64]


class Condition(NamedTuple):
    """Combination of scenario, track and share in which models are attacked.

    Attributes:
        scenario: Name of the scenario in the suite.
        track: Name of the track in the suite.
        share: Share of compromised agents.
    """

    scenario: str
    track: str
    share: float

    @property
    def description(self) -> str:
        """Short text for tables, such as `market, raters 30%`."""
        share = f" {self.share:.0%}" if self.share else ""
        return f"{self.scenario}, {self.track}{share}"


class AttackScores(NamedTuple):
    """Scores of one attack on one model in one condition.

    Attributes:
        model: Name of the model.
        condition: Condition of the attack.
        attack: Name of the attack.
        rung: Name of the rung that found the attack.
        words: Short description of the attack.
        chosen: Score in the games for choosing, on the scale of the suite, all seeds concatenated, (G,).
        measured: Scores in the games for measuring, by the names of `MEASURED`, (G,) each.
        score: Score in the games for measuring, on the scale of the suite, (G,).
        by_round: Mean utility over the games for measuring in each round from the second on, (T - 1,).
    """

    model: str
    condition: Condition
    attack: str
    rung: str
    words: str
    chosen: Floats
    measured: Mapping[str, Floats]
    score: Floats
    by_round: Floats


def attack_scores(stored: Iterable[StoredCell], scale: Scale = "utility") -> list[AttackScores]:
    """Return the scores of all attacks of a run. The games of several seeds are concatenated.

    Args:
        stored: Cells of the run with their results.
        scale: Scale of the suite.
    """
    groups: dict[tuple[str, Condition, str, str], list[AttackResult]] = {}
    for cell, result in stored:
        for row in result.rows:
            condition = Condition(cell.scenario, cell.track, cell.share)
            groups.setdefault((cell.model, condition, row.attack, cell.rung), []).append(row)
    found = []
    for (model, condition, attack, rung), rows in groups.items():
        words = "; ".join(dict.fromkeys(row.words for row in rows))
        chosen, measured = _joined([row.chosen for row in rows]), _joined([row.measured for row in rows])
        by_round = mean_or_nan(np.stack([as_array(row.by_round) for row in rows]), axis=0)
        scores = _to_choose(chosen, scale), measured, _to_count(measured, scale)
        found.append(AttackScores(model, condition, attack, rung, words, *scores, by_round))
    return found


def worst_cases(
    attacks: Iterable[AttackScores], included: frozenset[str] = frozenset()
) -> dict[tuple[str, Condition], AttackScores]:
    """Return the worst case of each model and condition, the attack with the least score in the games for choosing.

    Args:
        attacks: Scores of all attacks.
        included: Rungs of `WHITE_BOX_RUNGS` that count.
    """
    cases: dict[tuple[str, Condition], AttackScores] = {}
    for one in attacks:
        if one.rung in WHITE_BOX_RUNGS - included:
            continue
        key = one.model, one.condition
        if key not in cases or least_mean(one.chosen) < least_mean(cases[key].chosen):
            cases[key] = one
    return cases


def least_mean(score: Floats) -> float:
    """Return the mean score by which the worst case is chosen; where it is undefined, any other is worse."""
    mean = float(mean_or_nan(score, axis=0))
    return np.inf if np.isnan(mean) else mean


def _joined(games: Sequence[Mapping[str, Sequence[float | None]]]) -> dict[str, Floats]:
    """Return the scores by name, those of several seeds one after the other."""
    return {name: np.concatenate([as_array(one[name]) for one in games]) for name in games[0]}


def _to_choose(chosen: Mapping[str, Floats], scale: Scale) -> Floats:
    return skill(chosen["utility"], chosen["blind"]) if scale == "skill" else chosen["utility"]


def _to_count(measured: Mapping[str, Floats], scale: Scale) -> Floats:
    by_trust, blind = measured["utility"], measured["blind"]
    if scale == "skill":
        return skill(by_trust, blind)
    return by_trust if np.nanmean(by_trust) >= np.nanmean(blind) else blind


def as_array(values: Sequence[float | None]) -> Floats:
    """Return stored numbers as an array. None becomes NaN."""
    return np.array([np.nan if x is None else x for x in values], np.float64)
