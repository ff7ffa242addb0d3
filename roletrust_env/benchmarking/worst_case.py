"""The worst case of each trust model in each condition, chosen in some games and measured in
others.

A condition is a scenario, a track and a share. Its worst case is the attack that leaves the least
score in the games for choosing. Methods with more knowledge than a real attacker are excluded. The
result is the score in the games for measuring, on the scale of the suite, see `Suite.score`. Each
seed searches, chooses and measures as in a run of its own, and the scores of a run are means over
its seeds.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.schema import AttackResult
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Scale, Suite
from roletrust_env.evaluation.search import late_gain
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
    """Scores of one attack on one model in one condition, in G games of each of S seeds.

    Searches with other seeds find other attacks, which have the same name here. Seeds are in
    ascending order. Where a seed has no such attack, its scores are NaN.

    Attributes:
        model: Name of the model.
        condition: Condition of the attack.
        attack: Name of the attack.
        method: Method of the suite that found the attack.
        white_box: Whether the method uses knowledge that a real attacker does not have.
        words: Short description of the attack.
        chosen: Score in the games for choosing, on the scale of the suite, shape (S, G).
        measured: Scores in the games for measuring, by the names of `MEASURED`, shape (S, G) each.
        score: Score in the games for measuring, on the scale of the suite, shape (S, G).
        published: Same score if the consumers went by published trust.
        by_round: Mean utility over the games for measuring in each round from the second on, shape
            (T - 1,).
        treats: Whether a provider served some honest rater better than another, with any seed.
        gain: What the last doubling of the rounds of the search gained, the most of its seeds; NaN
            without a course.
        difference: Difference of the score between the starts of a search with two seeds, in the
            same games; of several the greatest, NaN for a single start.
    """

    model: str
    condition: Condition
    attack: str
    method: str
    white_box: bool
    words: str
    chosen: Floats
    measured: Mapping[str, Floats]
    score: Floats
    published: Floats
    by_round: Floats
    treats: bool = False
    gain: float = np.nan
    difference: float = np.nan


class WorstCase(NamedTuple):
    """Worst case of a model in a condition. Each of S seeds chooses its own attack.

    Attributes:
        model: Name of the model.
        condition: Condition of the worst case.
        choices: Attack of each seed.
        measured: Scores of these attacks in the games for measuring, by the names of `MEASURED`,
            shape (S, G) each.
        score: Score of these attacks in the games for measuring, on the scale of the suite, shape
            (S, G).
        published: Same score if the consumers went by published trust.
    """

    model: str
    condition: Condition
    choices: tuple[AttackScores, ...]
    measured: Mapping[str, Floats]
    score: Floats
    published: Floats

    @property
    def common(self) -> AttackScores:
        """Attack that most seeds choose, the first one of several."""
        names = [(choice.method, choice.attack) for choice in self.choices]
        return self.choices[names.index(max(names, key=names.count))]

    @property
    def attack(self) -> str:
        """Name of the attack that most seeds choose."""
        return self.common.attack

    @property
    def mean(self) -> float:
        """Mean score; infinite where it is undefined, so that any other is worse."""
        return least_mean(self.score)


def attack_scores(suite: Suite, stored: Iterable[StoredCell]) -> list[AttackScores]:
    """Return the scores of all attacks of a run.

    Args:
        suite: Suite of the run, with its scale and its methods that do not count.
        stored: Cells of the run with their results.
    """
    groups: dict[tuple[str, Condition, str, str], dict[int, AttackResult]] = {}
    for cell, result in stored:
        for row in result.rows:
            condition = Condition(cell.scenario, cell.track, cell.share)
            groups.setdefault((cell.model, condition, row.attack, cell.method), {})[cell.seed] = row
    seeds = sorted({seed for rows in groups.values() for seed in rows})

    def table(rows: Mapping[int, AttackResult], part: str, name: str) -> Floats:
        """Return a score of an attack, (S, G)."""
        lengths = (
            len(scored) for row in rows.values() for half in row[3:5] for scored in half.values()
        )
        values = np.full((len(seeds), max(lengths)), np.nan)
        for k, seed in enumerate(seeds):
            if seed in rows:
                own = as_array(getattr(rows[seed], part)[name])
                values[k, : len(own)] = own
        return values

    scored = []
    for (model, condition, attack, method), rows in groups.items():
        first, words = (
            next(iter(rows.values())),
            "; ".join(dict.fromkeys(row.words for row in rows.values())),
        )
        chosen, measured = (
            {name: table(rows, part, name) for name in getattr(first, part)}
            for part in ("chosen", "measured")
        )
        by_round = mean_or_nan(np.stack([as_array(row.by_round) for row in rows.values()]), axis=0)
        by_published = measured | {"utility": measured["published"]}
        counted = _to_count(measured, suite.score), _to_count(by_published, suite.score)
        by_skill = suite.score == "skill"
        to_choose = (
            skill_by_seed(chosen["utility"], chosen["blind"]) if by_skill else chosen["utility"]
        )
        scores = to_choose, measured, *counted
        white_box, treats = suite.is_white_box(method), any(row.treats for row in rows.values())
        gain = max(
            (late_gain(row.progress) for row in rows.values() if row.progress), default=np.nan
        )
        course = treats, gain, _difference(rows.values(), suite.score)
        scored.append(
            AttackScores(
                model, condition, attack, method, white_box, words, *scores, by_round, *course
            )
        )
    return scored


def _difference(rows: Iterable[AttackResult], scale: Scale) -> float:
    """Return the difference of the score between the starts of a search, the greatest one; NaN for
    a single start.
    """
    played = [np.array(row.common, float)[:, None] for row in rows if row.common]
    scores = [
        least_mean(_to_count({"utility": own, "blind": blind}, scale)) for own, blind in played
    ]
    return max(scores) - min(scores) if scores[1:] else np.nan


def worst_cases(
    attacks: Iterable[AttackScores], *, white_box: bool = False, alike: bool = False
) -> dict[tuple[str, Condition], WorstCase]:
    """Return the worst case of each model and condition, for each seed the attack with the least
    score when it chooses.

    Args:
        attacks: Scores of all attacks.
        white_box: Whether methods with more knowledge than a real attacker count, too.
        alike: Whether only attacks count whose providers serve all raters alike.
    """
    groups: dict[tuple[str, Condition], list[AttackScores]] = {}
    for attack in attacks:
        if (white_box or not attack.white_box) and not (alike and attack.treats):
            groups.setdefault((attack.model, attack.condition), []).append(attack)
    return {key: _worst_case(group) for key, group in groups.items()}


def _worst_case(attacks: Sequence[AttackScores]) -> WorstCase:
    means = [[least_mean(games) for games in attack.chosen] for attack in attacks]
    choices = tuple(attacks[k] for k in np.argmin(means, axis=0))
    measured = {
        name: _by_seed([choice.measured[name] for choice in choices])
        for name in choices[0].measured
    }
    scores = (
        _by_seed([getattr(choice, name) for choice in choices]) for name in ("score", "published")
    )
    return WorstCase(attacks[0].model, attacks[0].condition, choices, measured, *scores)


def _by_seed(scores: Sequence[Floats]) -> Floats:
    """Return the games of the s-th seed under the s-th attack for all s, shape (S, G)."""
    padded = np.full(
        (len(scores), max(games.shape[1] for games in scores)), np.nan
    )  # only the worst has further games
    for seed, games in enumerate(scores):
        padded[seed, : games.shape[1]] = games[seed]
    return padded


def least_mean(score: Floats) -> float:
    """Return the mean score by which a worst case is chosen; infinite where it is undefined, so any
    other is worse.
    """
    mean = float(mean_or_nan(score.ravel(), axis=0))
    return np.inf if np.isnan(mean) else mean


def _to_count(measured: Mapping[str, Floats], scale: Scale) -> Floats:
    """Return the score that counts. On the scale of utility, no seed has less than a blind choice
    in its games.
    """
    by_trust, blind = measured["utility"], measured["blind"]
    if scale == "skill":
        return skill_by_seed(by_trust, blind)
    below = mean_or_nan(by_trust, axis=1) < mean_or_nan(blind, axis=1)
    return np.where(below[:, None], blind, by_trust)


def skill_by_seed(by_trust: Floats, blind: Floats) -> Floats:
    """Return the skill of each seed for itself, shape (S, G)."""
    return np.stack([skill(*games) for games in zip(by_trust, blind, strict=True)])


def as_array(values: Sequence[float | None]) -> Floats:
    """Return stored numbers as an array. None becomes NaN."""
    return np.array(values, np.float64)
