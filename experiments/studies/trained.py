"""Saved attackers as rungs of the ladder. They do not search; they load an attacker."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roletrust_agents.learned.coalition_attacker import attacker_for
from roletrust_agents.learned.network import Network
from roletrust_agents.learned.saved import load_attacker
from roletrust_env.envs.task_batch import task_spaces
from roletrust_env.evaluation.measurement import TaskArguments, exact_task
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.parameters import refuse_unknown_parameters

_RUN_FIELDS: Any = {
    **dict.fromkeys(("observation", "score", "weights_sha256"), True),
    "training": {"seed", "seconds", "rounds"},
}
"""Fields of the card that can differ between the runs of one training."""


@refuse_unknown_parameters
@dataclass(frozen=True)
class Learned:
    """Search method that loads a saved attacker of `roletrust train`. Its rounds and seconds are
    those of the training.

    Attributes:
        path: Path of its folder, or of one of its two files.
        name: Name in tables.
    """

    path: Path
    name: str = "learned"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        saved = load_attacker(self.path)
        card, task = saved.card, exact_task(arguments)
        if isinstance(saved.network, Network):
            architecture = saved.network.architecture
            seen, needed = (
                _observation_size(task.changed(knowledge=card.task.knowledge)),
                architecture.inputs,
            )
            if (seen, task.action_size) != (needed, architecture.outputs):
                raise UnsuitableError(
                    f"{self.path} learned with {needed} observations and {architecture.outputs} "
                    "actions; "
                    f"this task has {seen} and {task.action_size}"
                )
        attacker = attacker_for(saved.network, card.task.knowledge)
        words = f"{card.training.algorithm} on {card.task.id}, {card.task.knowledge}"
        return SearchResult(
            attacker, card.training.rounds or card.training.steps, words, card.training.seconds
        )


def learned_methods(folder: Path, seeds: Sequence[int], name: str) -> list[Learned]:
    """Return the runs of one training as search methods, one for each seed.

    Args:
        folder: Folder of a single run, which can have any seed, or folder with a subfolder for each
            run.
        seeds: Seeds that the runs must have.
        name: Name in tables.

    Raises:
        ValueError: A file is not valid, the runs do not have these seeds, or they differ in more
            than their seed.
    """
    if len(seeds) == 1:
        load_attacker(folder)
        return [Learned(folder, name)]
    runs, trainings = {}, set()
    for path in sorted(file.parent for file in folder.glob("*/attacker.json")):
        card = load_attacker(path).card
        runs[card.training.seed] = path
        trainings.add(card.model_dump_json(exclude=_RUN_FIELDS))
    if sorted(runs) != list(seeds):
        available = ", ".join(map(str, sorted(runs))) or "none"
        raise ValueError(
            f"{folder} holds runs of the seeds {available}; this ladder has the seeds "
            f"{', '.join(map(str, seeds))}"
        )
    if len(trainings) > 1:
        raise ValueError(
            f"the runs in {folder} differ in more than their seed; they are not one search method"
        )
    return [Learned(runs[seed], name) for seed in seeds]


def _observation_size(task: AttackTask) -> int:
    return int(task_spaces(task)[0].shape[0])
