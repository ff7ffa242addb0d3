"""The worlds of a cell, ready to play."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.suite import Cell, Suite
from roletrust_env.benchmarking.worlds import Use
from roletrust_env.evaluation.agreed import seat
from roletrust_env.evaluation.attackers import AttackedPlayers, Attacker
from roletrust_env.evaluation.measurement import exact_task
from roletrust_env.evaluation.received import RANGES, measure_world
from roletrust_env.evaluation.specs import is_own_model, offered_parameters, parse_trust_model
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.policy import registry as attackers
from roletrust_env.game.rollout import Players
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.trust.model_checks import needs_watching
from roletrust_env.trust.random_order import RandomOrder
from roletrust_env.trust.remote import IsolatedModel

_PAIRS = 200_000
"""Number of pairs of agents in all games that play at once, at most."""

_SEEDS: dict[Use, int] = {"selection": 0, "measured": 1}

Floats = npt.NDArray[np.float64]


def game_seed(suite: Suite, use: Use, number: int) -> tuple[int, ...]:
    """Return the random seed of the games in a world, the same for all cells of a suite."""
    return suite.worlds.seed, _SEEDS[use], number


class Played(NamedTuple):
    """Scores of K attacks in the worlds of a use.

    Attributes:
        scores: Scores by name, shape (W, K) each.
        regret_by_round: Mean regret in each round, shape (T, K), over the worlds that last so long.
    """

    scores: dict[str, Floats]
    regret_by_round: Floats


class CellPlay:
    """The worlds of a cell, ready to play.

    Args:
        suite: Suite of the cell.
        cell: The cell.
        isolated: Give a trust model of another package a process of its own, see `IsolatedModel`.

    Attributes:
        suite: Suite of the cell.
        cell: The cell.
        steps: Number of game rounds that were measured so far, rounds x games.
    """

    def __init__(self, suite: Suite, cell: Cell, *, isolated: bool = False) -> None:
        self.suite, self.cell, self.steps = suite, cell, 0
        self._isolated = isolated
        self._tasks: dict[tuple[Use, int], AttackTask] = {}
        self._models: dict[tuple[float, ...], IsolatedModel] = {}

    def task(self, use: Use, number: int) -> AttackTask:
        """Return the attack task of a world with compromised agents, in double precision.

        Raises:
            ValueError: The trust model cannot be created, or a world has too few agents.
        """
        if (use, number) not in self._tasks:
            scenario, compromised = self.suite.world(self.cell, use, number)
            arguments = {
                "scenario": scenario,
                "trust_model": self._model(scenario),
                "compromised": compromised,
                "objective": "mislead",
                "consumers": "received",
            }
            self._tasks[use, number] = exact_task(arguments)
        return self._tasks[use, number]

    def measure(self, use: Use, attacks: Sequence[Attacker], games: int | None = None) -> Played:
        """Return the scores of K attacks in all worlds of a use.

        Args:
            use: Use of the worlds.
            attacks: The attacks.
            games: Number of games in each world. None means that of the suite for this use.

        Raises:
            ValueError: An attack or a trust model fails.
        """
        number = getattr(self.suite.worlds, use)
        usual = {"selection": self.suite.selection_games, "measured": self.suite.games}
        games = games or usual[use]
        scores = {name: np.full((number, len(attacks)), np.nan) for name in RANGES}
        longest = max(world.max_cycles for world in self.suite.worlds.worlds(use))
        regret = np.full((number, longest, len(attacks)), np.nan)
        for world in range(number):
            for places, players, identities in self._seated(use, world, attacks, games):
                batch, scenario = (len(places), games), players.game.scenario
                seed = game_seed(self.suite, use, world)
                silent = self.suite.silent(self.cell, scenario)
                played = measure_world(players, identities, seed, batch, silent)
                for name, values in played.scores.items():
                    scores[name][world, places] = values
                regret[world, : scenario.max_cycles, places] = played.regret_by_round.T
                self.steps += batch[0] * batch[1] * scenario.max_cycles
        return Played(scores, mean_or_nan(regret, axis=0))

    def _seated(
        self, use: Use, number: int, attacks: Sequence[Attacker], games: int
    ) -> Iterator[tuple[list[int], Players, tuple[str, ...]]]:
        """Yield the players of attacks that play side by side in a world, with the indices of the
        attacks and the names of the compromised agents.
        """
        if not self.suite.settings[self.cell.setting].roles:
            scenario = self.suite.world(self.cell, use, number).scenario
            silent = self.suite.silent(self.cell, scenario)
            policies = dict.fromkeys(silent, attackers.make("silent")) if silent else {}
            yield [0], JointPolicy(Game(scenario, self._model(scenario)), policies), ()
            return
        task = self.task(use, number)
        pairs = task.game.roster.n_raters * task.game.roster.n_providers * games
        for places, attacker in seat(task, attacks, max(1, _PAIRS // pairs)):
            yield places, AttackedPlayers(task, attacker), task.identities

    def _model(self, scenario: Any) -> Any:
        if self._isolated and not is_own_model(self.cell.model):
            offered = offered_parameters(scenario)
            key = tuple(offered.values())
            if key not in self._models:
                self._models[key] = IsolatedModel(self.cell.model, offered)
            model: Any = self._models[key]
        else:
            model = parse_trust_model(self.cell.model, scenario)
        return RandomOrder(model) if needs_watching(model) else model
