"""Scores that a trained attacker is compared with: honest play, the best script, and the optimum
where it is known.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from roletrust_agents.learned.policy import play_attacker
from roletrust_agents.learned.saved import SavedAttacker, arguments_from_card
from roletrust_env.arrays import Array
from roletrust_env.evaluation.attackers import Scripted, side_by_side
from roletrust_env.evaluation.measurement import TaskArguments
from roletrust_env.evaluation.scripts import Scripts, describe_attack, with_paper
from roletrust_env.evaluation.search import UnsuitableError, bounds, find
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.policy import Policy
from roletrust_env.game.policy import registry as attackers

_FEW, _LEADING = 16, 3  # games that choose the leading scripts, which then play all games
_ROWS = 8  # scripts side by side


class Yardstick(NamedTuple):
    """A score to compare with.

    Attributes:
        name: Name of the attack, or of the bound.
        score: Mean reward per round.
        is_script: Whether it is the score of a script, which a learner should exceed.
    """

    name: str
    score: float
    is_script: bool = False


def yardsticks(attacker: SavedAttacker) -> list[Yardstick]:
    """Return the scores to compare with, in the held-out games of the attacker's own score."""
    card, score = attacker.card, attacker.card.score
    tasks = attacker.tasks()
    script = best_script(tasks, games=score.games // len(tasks), seed=score.seed)
    known = known_scores(
        arguments_from_card(card.task, card.trust_model, card.scenario), score.seed
    )
    return [Yardstick("honest play", score.honest), *([script] if script else []), *known]


def best_script(tasks: Sequence[AttackTask], *, games: int, seed: int) -> Yardstick | None:
    """Return the best of the scripts with default parameters that the compromised agents can play;
    None without any.

    Where raters and providers are compromised, the script of one role goes with the paper's attack
    of the other. The first 16 games, side by side, choose three scripts, and only these play all
    games.
    """
    attacks = []
    for name in attackers.names():
        try:
            kind = attackers.factory(name)
            attacks.append([Scripts.of(task, with_paper(task, kind)).default for task in tasks])
        except (
            ValueError
        ):  # another role, no ring, no identities in reserve, a file that is missing
            continue

    def scores(played: Sequence[Sequence[Mapping[str, Policy]]], games: int) -> Array:
        """Return the mean score of each attack over the tasks and games, shape (K,)."""
        parts = []
        for at in range(0, len(played), _ROWS):
            part = played[at : at + _ROWS]
            each = [
                play_attacker(
                    task,
                    Scripted(side_by_side([attack[k] for attack in part])),
                    games=games,
                    seed=seed,
                    rows=len(part),
                )
                for k, task in enumerate(tasks)
            ]
            parts.append(np.mean(each, axis=(0, 2)))
        return np.concatenate(parts)

    if not attacks:
        return None
    few = max(1, min(_FEW // len(tasks), games))
    leading = [attacks[k] for k in np.argsort(-scores(attacks, few), kind="stable")[:_LEADING]]
    found = scores(leading, games)
    words = describe_attack(leading[int(np.argmax(found))][0])
    return Yardstick(f"best script ({words})", float(found.max()), is_script=True)


def known_scores(arguments: TaskArguments, seed: int) -> list[Yardstick]:
    """Return the score of each bound that is known for a task, such as the exact optimum of a
    provider; most tasks have none.

    Args:
        arguments: Arguments of the task.
        seed: Random seed; without effect where an optimum is known, since nothing is random there.
    """
    known = []
    for name in bounds.names():
        with suppress(UnsuitableError):
            result = find(bounds.make(name), arguments, budget=0, seed=seed, games=1)
            known.append(Yardstick(name, float(result.scores.mean())))
    return known
