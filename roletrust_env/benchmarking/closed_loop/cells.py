"""How a cell is played: its attacks, scripted or replayed, and their scores in each world.

The result depends only on the suite and the cell, not on the machine or the order.
"""

from collections.abc import Iterator, Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.closed_loop.suite import Cell, ClosedLoopSuite
from roletrust_env.benchmarking.closed_loop.worlds import Use
from roletrust_env.benchmarking.schema import AttackResult, CellResult, plain_numbers, reason
from roletrust_env.evaluation.agreed import AgreedScripts, seat, with_missing_roles
from roletrust_env.evaluation.attackers import AttackedPlayers, Attacker, read_record
from roletrust_env.evaluation.isolated import IsolatedModel
from roletrust_env.evaluation.measurement import exact_task
from roletrust_env.evaluation.received import RANGES, measure_world
from roletrust_env.evaluation.search import UnsuitableError
from roletrust_env.evaluation.specs import is_own_model, parse_trust_model
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.policy import registry as attackers
from roletrust_env.game.rollout import Players
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.trust.model_checks import needs_watching
from roletrust_env.trust.random_order import RandomOrder

_PAIRS = 200_000
"""Number of pairs of agents in all games that play at once, at most."""

_SEEDS: dict[Use, int] = {"selection": 0, "measured": 1}

Floats = npt.NDArray[np.float64]


class FoundAttack(NamedTuple):
    """An attack of a cell.

    Attributes:
        name: Name in results.
        attack: The attack, for any world.
        words: Short description.
    """

    name: str
    attack: Attacker
    words: str


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

    def __init__(self, suite: ClosedLoopSuite, cell: Cell, *, isolated: bool = False) -> None:
        self.suite, self.cell, self.steps = suite, cell, 0
        self._isolated = isolated
        self._tasks: dict[tuple[Use, int], AttackTask] = {}
        self._models: list[IsolatedModel] = []

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

    def measure(self, use: Use, attacks: Sequence[Attacker]) -> tuple[dict[str, Floats], Floats]:
        """Return the scores of K attacks in all worlds of a use, shape (W, K) each, and the mean
        regret in each round, shape (T, K), over the worlds that last so long.

        Raises:
            ValueError: An attack or a trust model fails.
        """
        number = getattr(self.suite.worlds, use)
        scores = {name: np.full((number, len(attacks)), np.nan) for name in RANGES}
        longest = max(world.max_cycles for world in self.suite.worlds.worlds(use))
        regret = np.full((number, longest, len(attacks)), np.nan)
        for world in range(number):
            for places, players, identities in self._seated(use, world, attacks):
                batch, scenario = (len(places), self.suite.games), players.game.scenario
                seed = self.suite.worlds.seed, _SEEDS[use], world
                silent = self.suite.silent(self.cell, scenario)
                played = measure_world(players, identities, seed, batch, silent)
                for name, values in played.scores.items():
                    scores[name][world, places] = values
                regret[world, : scenario.max_cycles, places] = played.regret_by_round.T
                self.steps += batch[0] * batch[1] * scenario.max_cycles
        return scores, mean_or_nan(regret, axis=0)

    def check_isolation(self) -> None:
        """Check that trust in a game does not depend on other games, see `IsolatedModel`.

        Raises:
            ValueError: It does.
        """
        for model in self._models:
            model.check_alone()

    def _seated(
        self, use: Use, number: int, attacks: Sequence[Attacker]
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
        pairs = task.game.roster.n_raters * task.game.roster.n_providers * self.suite.games
        for places, attacker in seat(task, attacks, max(1, _PAIRS // pairs)):
            yield places, AttackedPlayers(task, attacker), task.identities

    def _model(self, scenario: Any) -> Any:
        if self._isolated and not is_own_model(self.cell.model):
            self._models.append(IsolatedModel(self.cell.model, scenario))
            model: Any = self._models[-1]
        else:
            model = parse_trust_model(self.cell.model, scenario)
        return RandomOrder(model) if needs_watching(model) else model


def play_cell(suite: ClosedLoopSuite, cell: Cell, *, isolated: bool = False) -> CellResult:
    """Play a cell.

    Args:
        suite: Suite of the cell.
        cell: Cell to play.
        isolated: Give a trust model of another package a process of its own, see `IsolatedModel`.

    Raises:
        ValueError: A name in the suite is unknown, the record is not valid, or a trust model or an
            attacker of a plug-in fails.
    """
    began, play = perf_counter(), CellPlay(suite, cell, isolated=isolated)
    try:
        found = list(find_attacks(play))
    except UnsuitableError as error:
        return CellResult((), perf_counter() - began, unsuitable=str(error))
    rows, failed = _measured(play, found)
    play.check_isolation()
    seconds, errors = perf_counter() - began, "; ".join(failed)
    return CellResult(tuple(rows), seconds, failed=errors, env_steps=play.steps)


def find_attacks(play: CellPlay) -> Iterator[FoundAttack]:
    """Yield the attacks of a cell.

    Raises:
        UnsuitableError: The way to attack does not apply to the cell.
        ValueError: A name is unknown, or a record is not valid.
    """
    suite, cell = play.suite, play.cell
    if cell.method == "honest":
        yield FoundAttack("honest", AgreedScripts(), "all agents play honestly")
    elif cell.method == "scripts":
        task = play.task("selection", 0)
        for name in playable(suite, cell, task):
            attack = AgreedScripts(with_missing_roles(task, name, suite.usual))
            yield FoundAttack(name, attack, attack.describe(task))
    else:
        if not (known := suite.replayed_in(cell.setting)):
            raise UnsuitableError("there is no replayed attack for this setting")
        for found in known:
            words = f"replayed attack, found by {found.finder}" if found.finder else "replayed"
            yield FoundAttack(found.name, read_record(found.record), words)


def playable(suite: ClosedLoopSuite, cell: Cell, task: AttackTask) -> list[str]:
    """Return the scripted attacks that the compromised agents of a cell can play.

    In a setting with identities in reserve they are those that use them, in any other one those
    that do not.
    """
    identities, names = suite.settings[cell.setting].reserve > 0, []
    for name in suite.attacks:
        try:
            policies = AgreedScripts((name,)).policies(task).values()
        except ValueError:  # wrong role, or no ring of agents
            continue
        if any(policy.reserve for policy in policies) == identities:
            names.append(name)
    return names


def _measured(play: CellPlay, found: Sequence[FoundAttack]) -> tuple[list[AttackResult], list[str]]:
    """Return the results of attacks, and the error messages of those that failed.

    An attack that fails does not affect the others: each of them is then measured by itself.

    Raises:
        Exception: All attacks fail.
    """
    try:
        return _results(play, found), []
    except Exception as error:  # plug-in code may raise anything
        if not found[1:]:
            raise
        rows, failed = list[AttackResult](), list[str]()
        for attack in found:
            try:
                rows += _results(play, [attack])
            except Exception as own_error:
                failed.append(f"attack {attack.name}: {reason(own_error)}")
        if not rows:
            raise error
        return rows, failed


def _results(play: CellPlay, found: Sequence[FoundAttack]) -> list[AttackResult]:
    attacks = [attack.attack for attack in found]
    chosen = play.measure("selection", attacks)[0]["skill"]
    measured, regret = play.measure("measured", attacks)
    return [
        AttackResult(
            attack.name,
            attack.words,
            0,
            {"skill": plain_numbers(chosen[:, k])},
            {name: plain_numbers(values[:, k]) for name, values in measured.items()},
            [None if x is None else round(x, 4) for x in plain_numbers(regret[:, k])],
        )
        for k, attack in enumerate(found)
    ]
