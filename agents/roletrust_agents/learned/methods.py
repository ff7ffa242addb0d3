"""Saved attackers as search methods that search nothing."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roletrust_agents.learned.network_attacker import NetworkAttacker, with_knowledge
from roletrust_env.envs.attack_env import task_spaces
from roletrust_env.evaluation.attacked_games import TaskArguments, exact_task
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.attack_task import AttackTask

_OF_A_RUN: Any = {
    **dict.fromkeys(("observation", "score", "weights_sha256"), True),
    "training": {"seed", "seconds", "rounds"},
}
"""In what the cards of two runs of one training may differ."""


@dataclass(frozen=True)
class Learned:
    """A saved attacker, as `roletrust train` leaves it. Its rounds and seconds are those of its training.

    Attributes:
        path: of its folder, or of one of its two files.
        name: in tables.
    """

    path: Path
    name: str = "learned"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        from roletrust_agents.learned.saved import load_attacker

        saved = load_attacker(self.path)
        card, task = saved.card, exact_task(arguments)
        attacker = NetworkAttacker(saved.network, card.task.knowledge)
        seen, needed = _observation_size(with_knowledge(task, card.task.knowledge)), card.architecture.inputs
        if (seen, task.action_size) != (needed, card.architecture.outputs):
            raise UnsuitableError(
                f"{self.path} learned with {needed} observations and {card.architecture.outputs} actions; "
                f"this task has {seen} and {task.action_size}"
            )
        words = f"{card.training.algorithm} on {card.task.id}, {card.task.knowledge}"
        return SearchResult(attacker, card.training.rounds or card.training.steps, words, card.training.seconds)


def learned_rungs(folder: Path, seeds: Sequence[int], name: str) -> list[Learned]:
    """The runs of one training, one for each seed, as rungs.

    Args:
        folder: of one run, whose seed may then be any, or with a folder for each run, see `roletrust train --runs`.
        seeds: that the runs must have.
        name: in tables.

    Raises:
        ValueError: a file is refused, the runs do not have these seeds, or they differ in more than their seed.
    """
    from roletrust_agents.learned.saved import load_attacker

    if len(seeds) == 1:
        load_attacker(folder)
        return [Learned(folder, name)]
    found, trainings = {}, set()
    for path in sorted(file.parent for file in folder.glob("*/attacker.json")):
        card = load_attacker(path).card
        found[card.training.seed] = path
        trainings.add(card.model_dump_json(exclude=_OF_A_RUN))
    if sorted(found) != list(seeds):
        told = ", ".join(map(str, sorted(found))) or "none"
        raise ValueError(
            f"{folder} holds runs of the seeds {told}; this ladder has the seeds {', '.join(map(str, seeds))}"
        )
    if len(trainings) > 1:
        raise ValueError(f"the runs in {folder} differ in more than their seed; they are not one rung")
    return [Learned(found[seed], name) for seed in seeds]


def _observation_size(task: AttackTask) -> int:
    return int(task_spaces(task)[0].shape[0])
