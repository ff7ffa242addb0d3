"""An attack of a benchmark, played once more: what it does to consumers, and whom trust
believes.
"""

from collections.abc import Iterator
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.cells import FoundAttack, find_attack
from roletrust_env.benchmarking.suite import Cell, Suite
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import (
    HELD_OUT,
    GameRecord,
    attacked_rollout,
    random_sources,
    watch,
)
from roletrust_env.game.consumer import Bought, buy
from roletrust_env.game.state import State, one_game
from roletrust_env.metrics import share_of_best
from roletrust_env.metrics.score import mean_or_nan, ratio

Floats = npt.NDArray[np.float64]


class Side(NamedTuple):
    """Trust of agents with the same role on one side; a number is the mean over the agents that are
    present.

    Attributes:
        label: Who they are, such as `honest raters`.
        attacks: Whether they belong to the attacker.
        rates: Whether it is trust in raters, otherwise in providers.
        trust: Trust of the side in each round and game, shape (T, G); NaN where nobody of it is
            present.
    """

    label: str
    attacks: bool
    rates: bool
    trust: Floats


class Replay(NamedTuple):
    """The games of a benchmark that measured an attack, and the same games with everybody honest.

    Attributes:
        attack_found: The attack.
        seed: Random seed of the games.
        games: Number of games that chose the worst case, and of those that measure it.
        utility: Utility of consumers in each round from the second on under the attack, shape (T -
            1, G).
        honest: The same with everybody honest.
        score: Utility in each whole game under the attack, shape (G,).
        honest_score: The same with everybody honest.
        believed: Probability that the most trusted provider belongs to the attacker, in each round,
            shape (T, G).
        sides: Trust of each side.
    """

    attack_found: FoundAttack
    seed: int
    games: int
    utility: Floats
    honest: Floats
    score: Floats
    honest_score: Floats
    believed: Floats
    sides: tuple[Side, ...]

    @classmethod
    def of(cls, suite: Suite, cell: Cell, attack: str, record: str = "") -> Self:
        """Find the attack of a cell again and play the games that measured it.

        Args:
            suite: Suite of the run.
            cell: Cell of the run.
            attack: Name of the attack in the results of the cell.
            record: Record of its attacker in these results, which is then not searched again.

        Raises:
            ValueError: See `find_attack`.
        """
        attack_found, games = find_attack(suite, cell, attack, record), suite.games
        attacked, honest = (
            _measured(watch(attack_found.task, attacker, cell.seed, (rows, 2 * games)), row, games)
            for attacker, row, rows in (
                (attack_found.batch.attacker, attack_found.row, attack_found.rows),
                (Scripted({}), 0, 1),
            )
        )
        under, calm = attacked.bought, honest.bought
        return cls(
            attack_found,
            cell.seed,
            games,
            ratio(under.got, under.best),
            ratio(calm.got, calm.best),
            share_of_best(under.got, under.best).value,
            share_of_best(calm.got, calm.best).value,
            _believed(attack_found, attacked.trust),
            tuple(_sides(attack_found, attacked.trust)),
        )

    def states(self, game: int) -> Iterator[State]:
        """Play one of the games again and yield its states.

        Args:
            game: Index among the games that measure the attack.
        """
        task, batch, row = self.attack_found
        sources = random_sources(task, self.seed, HELD_OUT)
        for played in attacked_rollout(
            task, batch.attacker, (self.attack_found.rows, 2 * self.games), *sources
        ):
            yield one_game(played.state, (row, self.games + game))


def _measured(seen: GameRecord, row: int, games: int) -> GameRecord:
    """Return the record of the games that measure the attack in a row."""
    own, public = (
        Bought(*(part[:, row, games:] for part in got)) for got in (seen.bought, seen.published)
    )
    return GameRecord(seen.trust[:, :, row, games:], own, public, seen.treats[[row]])


def _believed(attack: FoundAttack, trust: Floats) -> Floats:
    """Return the probability that the most trusted provider belongs to the attacker; ties are
    equally likely.
    """
    roster = attack.task.game.roster
    providers = [place for place, name in enumerate(roster.names) if name in roster.provider_names]
    own = np.array([roster.names[place] in attack.task.identities for place in providers])
    top = trust[:, providers]
    believed: Floats = buy(top, np.broadcast_to(own[:, None].astype(float), top.shape), axis=1).got
    return believed


def _sides(attack: FoundAttack, trust: Floats) -> Iterator[Side]:
    roster, own = attack.task.game.roster, attack.task.identities
    for names, rates, words in (
        (roster.rater_names, True, ("honest raters", "raters of the attacker")),
        (roster.provider_names, False, ("honest providers", "providers of the attacker")),
    ):
        for attacks in (False, True):
            places = [
                k
                for k, name in enumerate(roster.names)
                if name in names and (name in own) == attacks
            ]
            if places:
                yield Side(words[attacks], attacks, rates, mean_or_nan(trust[:, places], axis=1))
