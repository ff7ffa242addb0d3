"""An attack of a benchmark, played again in one of its worlds: what consumers receive, and which
agents have their trust.
"""

from collections.abc import Iterator
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.play import CellPlay, game_seed
from roletrust_env.benchmarking.suite import Cell, Suite
from roletrust_env.evaluation.agreed import AgreedScripts, seat
from roletrust_env.evaluation.attackers import AttackedPlayers, Attacker
from roletrust_env.evaluation.received import world_rounds
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.consumer import receive
from roletrust_env.game.rollout import Round
from roletrust_env.game.state import State, one_game
from roletrust_env.metrics.score import mean_or_nan, ratio
from roletrust_env.world.scenario import Choice

Floats = npt.NDArray[np.float64]


class Side(NamedTuple):
    """Trust in agents with the same role on one side, the mean over those that are present.

    Attributes:
        label: Label, such as `honest raters`.
        attacks: Whether the agents are compromised.
        rates: Whether it is trust in raters, otherwise in providers.
        trust: Trust in each round and game, shape (T, G); NaN where no agent is present.
    """

    label: str
    attacks: bool
    rates: bool
    trust: Floats


class Course(NamedTuple):
    """The course of G games of a world.

    Attributes:
        skill: Skill score over all games, see `roletrust_env.evaluation.received.SCORES`.
        received: Mean quality that honest consumers receive in each round, shape (T, G).
        from_attacker: Share of their services that come from compromised providers, shape (T, G).
        sides: Trust in each side: trust in raters is published, trust in providers is that of the
            honest consumers.
    """

    skill: float
    received: Floats
    from_attacker: Floats
    sides: tuple[Side, ...]


class Replay(NamedTuple):
    """The games that measured an attack in a world, and the same games without an attack.

    Attributes:
        task: Attack task of the world.
        attacker: The attacker.
        seed: Random seed of the games.
        games: Number of games.
        attacked: Course under the attack.
        honest: Course while all agents are honest.
    """

    task: AttackTask
    attacker: Attacker
    seed: tuple[int, ...]
    games: int
    attacked: Course
    honest: Course

    @classmethod
    def of(cls, suite: Suite, cell: Cell, attack: Attacker, world: int) -> Self:
        """Play the games in which `CellPlay.measure` measures an attack.

        Args:
            suite: Suite of the run.
            cell: Cell with the trust model, the choice rule and the setting.
            attack: Attack.
            world: Number of the measured world.

        Raises:
            ValueError: The trust model or the attack fails.
        """
        task = CellPlay(suite, cell).task("measured", world)
        seed, games = game_seed(suite, "measured", world), suite.games
        courses = []
        for each in (attack, AgreedScripts()):
            ((_, attacker),) = seat(task, [each], 1)
            courses.append(_course(task, _rounds(task, attacker, seed, games)))
        ((_, attacker),) = seat(task, [attack], 1)
        return cls(task, attacker, seed, games, *courses)

    def states(self, game: int) -> Iterator[State]:
        """Play one of the games again, and yield its states."""
        for played in _rounds(self.task, self.attacker, self.seed, self.games):
            yield one_game(played.state, (0, game))


def _rounds(
    task: AttackTask, attacker: Attacker, seed: tuple[int, ...], games: int
) -> Iterator[Round]:
    """Play games with the random numbers of `measure_world`."""
    return world_rounds(AttackedPlayers(task, attacker), seed, (1, games))


def _course(task: AttackTask, rounds: Iterator[Round]) -> Course:
    game, identities, access = task.game, task.identities, task.game.scenario.access
    assert isinstance(access, Choice)
    names, raters, providers = (
        game.roster.names,
        game.roster.rater_names,
        game.roster.provider_names,
    )
    consumers = [i for i, name in enumerate(raters) if name not in identities]
    honest = [j for j, name in enumerate(providers) if name not in identities]
    bad = [j for j, name in enumerate(providers) if name in identities]
    received, from_bad, trust_in, gained, possible = [], [], [], 0.0, 0.0
    for before, actions, state, _, weight in rounds:
        offered, able = game.offered(before, actions, state), before.properties.ability
        ability = np.ones(state.quality.shape) if able is None else able
        part = receive(state.awaiting, offered, ability, consumers, honest, access.providers)
        gained += weight * float((part.got - part.blind).sum())
        possible += weight * float((part.best - part.blind).sum())
        received.append(part.got[0])
        mine = state.awaiting[consumers]
        from_bad.append(ratio(mine[:, bad].sum(axis=(0, 1)), mine.sum(axis=(0, 1)))[0])
        trust, present = np.array(game.agent_trust(state)), game.present(state)
        known = mean_or_nan(game.known_trust(state)[consumers], axis=0)
        trust[[names.index(name) for name in providers]] = known
        trust_in.append((trust if present is None else np.where(present, trust, np.nan))[:, 0])
    sides = []
    for rates, role, members in ((True, "raters", raters), (False, "providers", providers)):
        for attacks in (False, True):
            indices = [
                k
                for k, name in enumerate(names)
                if name in members and (name in identities) == attacks
            ]
            if indices and (game.model.rates_raters or not rates):
                trust = mean_or_nan(np.stack(trust_in)[:, indices], axis=1)
                label = f"{'compromised' if attacks else 'honest'} {role}"
                sides.append(Side(label, attacks, rates, trust))
    skill = gained / possible if possible else np.nan
    return Course(skill, np.stack(received), np.stack(from_bad), tuple(sides))
