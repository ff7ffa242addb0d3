"""The known attacks of the suite `standard`: what longer searches find on each trust model, and
what is kept of it.

Searches start from the attacks that the suite knows, so a second run goes on where the first ended.
All attacks that are known or found in a condition play against all models. A greedy choice keeps
those that together leave the models the least, the first half among attacks that serve all raters
alike. In scenarios without searches the first attacks of each condition with the same roles are
candidates, too. Three to four hours on two cores.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.known_attacks import KnownAttack, KnownAttacks, merge_attacks
from roletrust_env.benchmarking.suite import Stage, Suite
from roletrust_env.benchmarking.worst_case import AttackScores
from studies.condition import suite_of
from studies.study import Recipe, Study


class Options(NamedTuple):
    """Searches and the choice.

    Attributes:
        suite: Suite that gets the attacks.
        searches: Suite that searches them, with another seed.
        many: Largest number of attacks that are kept in a condition.
        few: The same in a scenario without searches.
        games: Number of games that choose, and as many again.
    """

    suite: str = "standard"
    searches: str = "known-attacks"
    many: int = 14
    few: int = 8
    games: int = 16


RECIPES = {"known": Recipe(Options())}
_LEAST = 0.0005  # of the mean skill over models, by which a further attack must lower it
_SEED = 5  # of the games that choose; no suite has it


def main(study: Study[Options]) -> None:
    """Search, compare, choose, and write the file."""
    asked, workers = study.options, study.workers if study.workers > 1 else 0
    suite, searches = suite_of(asked.suite), suite_of(asked.searches)

    def chosen_attacks(
        candidates: Sequence[KnownAttack], name: str, many: int
    ) -> Iterator[KnownAttack]:
        matrix = _matrix(suite, searches, candidates, asked.games)
        board = benchmark(None, matrix, workers=workers, out=study.out / name, force=study.again)
        for condition in dict.fromkeys(attack.condition for attack in candidates):
            names = choice(
                [attack for attack in board.attacks if tuple(attack.condition) == condition], many
            )
            yield from (
                attack
                for attack in candidates
                if attack.condition == condition and attack.name in names
            )

    known = tuple(attack for attack in suite.known if attack.condition in searches.conditions)
    searches = searches.model_copy(update={"known": known})
    played = benchmark(
        None, searches, workers=workers, out=study.out / "searches", force=study.again
    )
    new = [
        KnownAttack(
            name=f"{cell.method} against {cell.model}",
            record=row.record,
            scenario=cell.scenario,
            track=cell.track,
            share=cell.share,
        )
        for cell, result, *_ in played.cells
        for row in result.rows
        if row.record
    ]
    chosen = list(chosen_attacks(merge_attacks(known, new), "matrix", asked.many))
    elsewhere = (attack for attack in suite.known if attack not in known)
    if others := merge_attacks(elsewhere, _elsewhere(suite, searches, chosen)):
        chosen += chosen_attacks(others, "elsewhere", asked.few)
    study.text("known.json", KnownAttacks(attacks=tuple(chosen)).model_dump_json(indent=1))


def choice(scores: Sequence[AttackScores], many: int) -> list[str]:
    """Return the names of the attacks that together leave the models the least.

    Args:
        scores: Scores of all attacks in a condition.
        many: Largest number of attacks. From half of it on, no attack is kept that lowers the mean
            by little.
    """
    treats: dict[str, bool] = {}
    for attack_scores in scores:
        treats[attack_scores.attack] = (
            treats.get(attack_scores.attack, False) or attack_scores.treats
        )
    names, models = list(treats), sorted({attack_scores.model for attack_scores in scores})
    left: npt.NDArray[np.float64] = np.ones((len(names), len(models)))
    for attack_scores in scores:
        left[names.index(attack_scores.attack), models.index(attack_scores.model)] = np.nanmean(
            [attack_scores.chosen, attack_scores.score]
        )
    worst, chosen = np.full(len(models), np.inf), list[int]()
    while len(chosen) < min(many, len(names)):
        rest = [k for k in range(len(names)) if k not in chosen]
        alike = [k for k in rest if not treats[names[k]]]
        pool = alike if alike and len(chosen) < many // 2 else rest
        best = min(pool, key=lambda k: float(np.minimum(worst, left[k]).sum()))
        if (
            len(chosen) >= many // 2
            and float((worst - np.minimum(worst, left[best])).mean()) < _LEAST
        ):
            break
        chosen.append(best)
        worst = np.minimum(worst, left[best])
    return [names[k] for k in chosen]


def _matrix(suite: Suite, searches: Suite, candidates: Sequence[KnownAttack], games: int) -> Suite:
    """Return the suite in which all candidates play against all models."""
    stages = dict[str, Stage]()
    for name in dict.fromkeys(attack.scenario for attack in candidates):
        places = dict.fromkeys(
            (attack.track, attack.share) for attack in candidates if attack.scenario == name
        )
        shares = {track: tuple(share for at, share in places if at == track) for track, _ in places}
        stages[name] = suite.scenarios[name].model_copy(update={"methods": None, "shares": shares})
    changes = {
        "name": "matrix",
        "methods": ("known",),
        "budgets": {},
        "known": tuple(candidates),
        "scenarios": stages,
        "tracks": searches.tracks,
        "games": games,
        "seeds": (_SEED,),
    }
    return suite.model_copy(update=changes)


def _elsewhere(
    suite: Suite, searches: Suite, chosen: Sequence[KnownAttack]
) -> Iterator[KnownAttack]:
    """Yield attacks for the conditions of the suite that have no searches: the first of each
    condition of the track.
    """
    for scenario, track, share in suite.conditions:
        if scenario not in searches.scenarios:
            for at in dict.fromkeys(attack.condition for attack in chosen if attack.track == track):
                for attack in [attack for attack in chosen if attack.condition == at][:6]:
                    place = {
                        "scenario": scenario,
                        "share": share,
                        "name": f"{attack.name}, of {attack.scenario}",
                    }
                    yield attack.model_copy(update=place)
