"""The universal coalitions of the project: starts of trainings, and a search method that only tries them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture, widened
from roletrust_agents.learned.saved import load_attacker, zoo
from roletrust_agents.training.coalition_training import Floats
from roletrust_agents.training.settings import Start
from roletrust_env.evaluation.attackers import read_record
from roletrust_env.evaluation.measurement import SEARCHED, TaskArguments, mean_rewards
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.make_task import make_task
from roletrust_env.parameters import refuse_unknown

_GAMES = 16
_PLACE = 0  # of the games in which ready coalitions are tried


@cache
def universal_coalitions() -> dict[str, DeepSet]:
    """Return the universal coalitions that come with the project, by name."""
    names = [name for name in zoo() if name.startswith("universal-")]
    networks = {name: load_attacker(name).network for name in names}
    usual = DeepSetArchitecture()
    return {
        name: network
        for name, network in networks.items()
        if isinstance(network, DeepSet) and network.architecture == usual
    }


def known_starts(start: Start, records: Sequence[str] = (), *, wide: bool = False) -> list[Floats]:
    """Return the weights of the known networks from which a training may start, shape (n,) each.

    Args:
        start: `"universal"` allows the universal coalitions and those of records, `"random"` allows none.
        records: Records of attackers, see `read_record`. Those that are no coalitions are left out.
        wide: Whether the training is of a wide network. A network that is not wide then becomes several, one for each
            of `widened`.

    Raises:
        ValueError: A record is not valid.
    """
    if start == "random":
        return []
    recorded = [attacker.network for attacker in map(read_record, records) if isinstance(attacker, CoalitionAttacker)]
    known = [*universal_coalitions().values(), *recorded]
    if wide:
        known = [one for network in known for one in widened(network)]
    return [network.flatten().astype(np.float64) for network in known if network.architecture.wide == wide]


@refuse_unknown
@dataclass(frozen=True)
class Universal:
    """The best of the universal coalitions that come with the project, without training on the task.

    Each was trained in turn against several trust models. The few games that choose one of them are counted.

    Attributes:
        name: Name in tables.
    """

    name: str = "universal"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `roletrust_env.evaluation.search.SearchMethod`."""
        task = make_task(**arguments)
        rounds = choice_rounds(task)
        if budget.left < rounds:
            raise UnsuitableError(f"the budget of {budget.rounds} rounds is too small; give {rounds} or more")
        best = best_universal(task, budget, seed)
        attacker = CoalitionAttacker(universal_coalitions()[best])
        return SearchResult(attacker, budget.spent, f"{best}, not trained further")


def choice_rounds(task: AttackTask) -> int:
    """Return the number of rounds that `best_universal` plays."""
    return len(universal_coalitions()) * _GAMES * task.game.scenario.max_cycles


def best_universal(task: AttackTask, budget: Budget, seed: int) -> str:
    """Return the name of the universal coalition that is the best in a few games.

    Args:
        task: Task that the coalitions play.
        budget: Budget, which pays for the games.
        seed: Random seed.

    Raises:
        UnsuitableError: No universal coalition is installed.
    """
    ready = universal_coalitions()
    if not ready:
        raise UnsuitableError("no universal coalition is installed")
    weights = np.stack([network.flatten() for network in ready.values()])
    attacker = CoalitionAttacker(DeepSet.unflatten(DeepSetArchitecture(), weights))
    scores = mean_rewards(task, attacker, (seed, _PLACE), (len(ready), _GAMES), SEARCHED)[0].mean(axis=1)
    budget.spend(choice_rounds(task))
    return list(ready)[int(np.argmax(scores))]
