"""Coalitions as search methods with a budget of rounds: by evolution, and ready ones that are only tried."""

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import UNITS, DeepSet
from roletrust_agents.learned.saved import load_attacker, zoo
from roletrust_agents.training.evolution import Evolution, Floats
from roletrust_agents.training.settings import EvolutionSettings
from roletrust_env.evaluation.attacked_games import SEARCHED, TaskArguments, is_certain, mean_rewards
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.make_task import make_task
from roletrust_env.parameters import refuse_unknown

_GENERATIONS = 2  # fewer are no evolution
_LOOK = 2  # games that show whether anything is left to chance

_GAMES = 16
_PLACE = 0  # of the games in which ready coalitions are tried


@cache
def universal_coalitions() -> dict[str, DeepSet]:
    """Return the universal coalitions that come with the project, by name."""
    names = [name for name in zoo() if name.startswith("universal-")]
    networks = {name: load_attacker(name).network for name in names}
    return {name: network for name, network in networks.items() if isinstance(network, DeepSet)}


def known_starts(settings: EvolutionSettings) -> list[Floats]:
    """Return the weights of the networks from which an evolution with these settings may start, shape (n,) each."""
    if settings.start == "random":
        return []
    return [network.flatten().astype(np.float64) for network in universal_coalitions().values()]


@refuse_unknown
@dataclass(frozen=True)
class Evolve:
    """Evolution of a coalition for one task, see `Evolution`. Where nothing is left to chance, a game each is enough.

    Attributes:
        start: `"universal"` begins with the best of the universal coalitions and of random networks, `"random"` with
            the best of random networks.
        population: Number of candidates in a generation.
        games: Number of games in which each candidate plays.
        spread: Standard deviation of the first generation.
        name: Name in tables.
    """

    start: Literal["universal", "random"] = "universal"
    population: int = 32
    games: int = 8
    spread: float = 0.3
    name: str = "evolution"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `roletrust_env.evaluation.search.SearchMethod`."""
        settings = EvolutionSettings(start=self.start, population=self.population, games=self.games, spread=self.spread)
        task = make_task(**arguments)
        length = task.game.scenario.max_cycles
        if is_certain(arguments):  # then all games are alike
            settings = settings.model_copy(update={"games": 1, "validation": 1})
        each = settings.population * settings.games + settings.validation
        needed = (2 * _GENERATIONS * each + _LOOK) * length
        if budget.left < needed:
            raise UnsuitableError(
                f"the budget of {budget.rounds} rounds is too small for evolution; give {needed} or more"
            )
        evolution = Evolution([task], settings, seed, budget.left, known_starts(settings))
        budget.spend(_LOOK * length)
        limit, spent = budget.left, 0
        while evolution.rounds + evolution.most_rounds <= limit:
            evolution.generation()
            if evolution.due() or evolution.rounds + evolution.most_rounds > limit:
                evolution.validate()
            budget.spend(evolution.rounds - spent)
            spent = evolution.rounds
        words = f"coalition, evolution in {len(evolution.scores)} generations of {self.population}"
        return SearchResult(CoalitionAttacker(evolution.network), budget.spent, words)


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
        ready = universal_coalitions()
        task = make_task(**arguments)
        names = [name for name, network in ready.items() if network.architecture.units == UNITS]
        if not names:
            raise UnsuitableError("no universal coalition is installed")
        rounds = len(names) * _GAMES * task.game.scenario.max_cycles
        if budget.left < rounds:
            raise UnsuitableError(f"the budget of {budget.rounds} rounds is too small; give {rounds} or more")
        architecture = ready[names[0]].architecture
        side_by_side = DeepSet.unflatten(architecture, np.stack([ready[name].flatten() for name in names]))
        attacker, batch = CoalitionAttacker(side_by_side), (len(names), _GAMES)
        scores = mean_rewards(task, attacker, (seed, _PLACE), batch, SEARCHED)[0].mean(axis=1)
        budget.spend(rounds)
        best = names[int(np.argmax(scores))]
        return SearchResult(CoalitionAttacker(ready[best]), budget.spent, f"{best}, not trained further")
