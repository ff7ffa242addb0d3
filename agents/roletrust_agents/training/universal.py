"""The universal coalitions of the project: starts of trainings, and a search method that only tries
them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

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
from roletrust_env.parameters import refuse_unknown_parameters

_GAMES = 16
_PLACE = 0  # of the games in which ready coalitions are tried


@cache
def universal_coalitions(*, wide: bool = True) -> dict[str, DeepSet]:
    """Return the universal coalitions that come with the project, by name.

    Args:
        wide: Whether those that treat each rater differently are among them.
    """
    names = [name for name in zoo() if name.startswith("universal-")]
    networks = {name: load_attacker(name).network for name in names}
    usual = [DeepSetArchitecture.of(wide=kind) for kind in (False, wide)]
    return {
        name: network
        for name, network in networks.items()
        if isinstance(network, DeepSet) and network.architecture in usual
    }


def starts_of(
    named: Mapping[str, DeepSet], *, wide: bool, ways: int | None = None
) -> dict[str, DeepSet]:
    """Return the networks from which a training may start, by name.

    Args:
        named: Known networks by name.
        wide: Whether the training is of a wide network. A network that is not wide can then begin
            in several ways, see `widened`; otherwise wide ones are left out.
        ways: Number of these ways, the first of which serves all raters alike; None takes all.
    """
    if not wide:
        return {name: network for name, network in named.items() if not network.architecture.wide}
    return {
        f"{name}, start {k}": start
        for name, network in named.items()
        for k, start in enumerate(widened(network)[:ways])
    }


def known_starts(start: Start, records: Sequence[str] = (), *, wide: bool = True) -> list[Floats]:
    """Return the weights of the known networks from which a training may start, shape (n,) each.

    Args:
        start: `"universal"` allows the universal coalitions and those of records, `"alike"` leaves
            out universal ones that treat raters differently, and `"random"` allows none.
        records: Records of attackers, see `read_record`. Those that are no coalitions are left out.
        wide: Whether the training is of a wide network.

    Raises:
        ValueError: A record is not valid.
    """
    if start == "random":
        return []
    attackers = enumerate(map(read_record, records))
    recorded = {
        f"record {k}": attacker.network
        for k, attacker in attackers
        if isinstance(attacker, CoalitionAttacker)
    }
    ready = universal_coalitions(wide=start == "universal")
    ways = (
        1 if any(attacker.architecture.wide for attacker in recorded.values()) else None
    )  # the better ways are known
    starts = starts_of(ready | recorded, wide=wide, ways=ways).values()
    return [network.flatten().astype(np.float64) for network in starts]


@refuse_unknown_parameters
@dataclass(frozen=True)
class Universal:
    """The best of the universal coalitions that come with the project, without training on the
    task.

    Each was trained in turn against several trust models. The few games that choose one of them are
    counted.

    Attributes:
        wide: Whether those that treat each rater differently play, too.
        name: Name in tables.
    """

    wide: bool = True
    name: str = "universal"
    known_start: ClassVar = True

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `roletrust_env.evaluation.search.SearchMethod`."""
        ready = universal_coalitions(wide=self.wide)
        best, network = best_universal(make_task(**arguments), ready, budget, seed)
        return SearchResult(
            CoalitionAttacker(network), budget.spent, f"{best}, not trained further"
        )


def mean_scores(
    task: AttackTask,
    architecture: DeepSetArchitecture,
    networks: Sequence[Floats],
    games: int,
    seed: tuple[int, int],
) -> Floats:
    """Return the mean score of networks that play the same games, shape (n,).

    Args:
        task: Task that the coalitions play.
        architecture: Architecture of all networks.
        networks: Weights of each.
        games: Number of games of each.
        seed: Random seed of the games, and their place beside other games.
    """
    attacker = CoalitionAttacker(
        DeepSet.unflatten(architecture, np.stack(networks).astype(np.float32))
    )
    scores: Floats = mean_rewards(task, attacker, seed, (len(networks), games), SEARCHED)[0].mean(
        axis=1
    )
    return scores


def choice_rounds(task: AttackTask, ready: Mapping[str, DeepSet]) -> int:
    """Return the number of rounds that `best_universal` plays."""
    return len(ready) * _GAMES * task.game.scenario.max_cycles


def best_universal(
    task: AttackTask, ready: Mapping[str, DeepSet], budget: Budget, seed: int
) -> tuple[str, DeepSet]:
    """Return the network that is the best in a few games, and its name.

    Args:
        task: Task that the coalitions play.
        ready: Networks by name.
        budget: Budget, which pays for the games.
        seed: Random seed.

    Raises:
        UnsuitableError: There is no network, or the budget is too small.
    """
    if not ready:
        raise UnsuitableError("no universal coalition is installed")
    rounds = choice_rounds(task, ready)
    if budget.left < rounds:
        raise UnsuitableError(
            f"the budget of {budget.rounds} rounds is too small; give {rounds} or more"
        )
    scores = dict[str, float]()
    for architecture in dict.fromkeys(network.architecture for network in ready.values()):
        names = [name for name, network in ready.items() if network.architecture == architecture]
        played = mean_scores(
            task, architecture, [ready[start].flatten() for start in names], _GAMES, (seed, _PLACE)
        )
        scores |= dict(zip(names, played.tolist(), strict=True))
    budget.spend(rounds)
    best = max(ready, key=lambda name: scores[name])
    return best, ready[best]
