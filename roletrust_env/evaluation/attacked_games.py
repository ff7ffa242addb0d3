"""Games of an attack task, played to the end, and the reward of the attacker in them."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.evaluation.attackers import AttackedPlayers, Attacker, OpenLoop, Scripted
from roletrust_env.evaluation.resources import check_memory, pairs, some, try_out
from roletrust_env.game.attack_task import AttackTask, Outcome
from roletrust_env.game.make_task import make_task
from roletrust_env.game.rollout import Round, rollout
from roletrust_env.randomness import Random

TaskArguments = Mapping[str, Any]
"""Arguments of `roletrust_env.make_task`, all but `like`."""

SEARCHED, HELD_OUT = 0, 1
"""The two kinds of random numbers: those of the games in a search, and those of the games that measure the result."""


_ANYWHERE = 2_000_000
"""Pairs of agents in all games of a batch that fits into any memory."""


class AttackedRound(NamedTuple):
    """One round of an attacked game.

    Attributes:
        round: The round.
        outcome: Outcome for the attacker; 0 in games that are over for it.
    """

    round: Round
    outcome: Outcome


def exact_task(arguments: TaskArguments) -> AttackTask:
    """Return the task in NumPy's double precision."""
    return make_task(**arguments, like=np.zeros(()))


def random_sources(task: AttackTask, seed: int | tuple[int, ...], kind: int) -> tuple[Random, Random]:
    """Return the noise of the game and the random numbers of the policies.

    Args:
        task: Task that is played.
        seed: Random seed.
        kind: `SEARCHED` or `HELD_OUT`.
    """
    seeds = (seed,) if isinstance(seed, int) else seed
    noise, chance = np.random.SeedSequence((kind, *seeds)).generate_state(2)
    return task.game.random(int(noise)), task.game.random(int(chance))


def attacked_rollout(
    task: AttackTask, attacker: Attacker, batch: tuple[int, int], noise: Random, chance: Random
) -> Iterator[Round]:
    """Play a task to the end of its scenario.

    Args:
        task: Task that is played.
        attacker: Attacker, or K attackers side by side.
        batch: Shape (K, G): K attacks side by side, each in G games. All K meet the same noise, so they compare.
        noise: Random numbers of the game.
        chance: Random numbers of the policies. They are apart from the noise, which must not depend on the attacker.

    Yields:
        The rounds, in order.
    """
    return rollout(AttackedPlayers(task, attacker), noise, chance, batch[1:], rows=batch[0])


def judged_rollout(
    task: AttackTask, attacker: Attacker, batch: tuple[int, int], noise: Random, chance: Random
) -> Iterator[AttackedRound]:
    """Play a task to the end of its scenario and judge each round. Arguments as for `attacked_rollout`."""
    return judged(task, attacked_rollout(task, attacker, batch, noise, chance))


def judged(task: AttackTask, rounds: Iterator[Round]) -> Iterator[AttackedRound]:
    """Yield the rounds with the outcome for the attacker; a game in which it has been caught brings 0 from then on."""
    ended: Array | None = None
    for played in rounds:
        outcome = task.judge(played.before, played.actions, played.state)
        if played.state.population is not None:  # else nobody can be caught
            ended = played.state.round < 0 if ended is None else ended  # nobody yet
            reward, objective, cost = (namespace(part).where(ended, 0 * part, part) for part in outcome[:3])
            ended = ended | outcome.caught
            outcome = outcome._replace(reward=reward, objective=objective, cost=cost)
        yield AttackedRound(played, outcome)


def task_memory(task: AttackTask, attacker: Attacker) -> float:
    """Return the memory of each game that measures an attacker, in bytes."""

    def played(games: int) -> Iterator[AttackedRound]:
        return judged_rollout(task, attacker, (1, games), *random_sources(task, 0, HELD_OUT))

    return try_out(played, some(task.game)).memory


def check_batch(task: AttackTask, games: int) -> None:
    """Refuse a batch of games that does not fit into the memory. What fits anywhere is not tried out.

    Args:
        task: Task that is played, on NumPy.
        games: Number of games that are played at once.

    Raises:
        ValueError: The games do not fit. The message says what they would take, and about how many fit.
    """
    if games * pairs(task.game) > _ANYWHERE:
        check_memory("games at once:", games, task_memory(task, Scripted({})))


def mean_rewards(
    task: AttackTask, attacker: Attacker, seed: int | tuple[int, ...], batch: tuple[int, int], kind: int
) -> list[Array]:
    """Return the mean reward, objective and cost per round of the full length, each of shape (K, G).

    Args:
        task: Task that is played.
        attacker: Attacker, or K attackers side by side.
        seed: Random seed.
        batch: Shape (K, G), see `attacked_rollout`.
        kind: `SEARCHED` or `HELD_OUT`.

    Raises:
        ValueError: The games do not fit into the memory, see `check_batch`.
    """
    check_batch(task, math.prod(batch))
    total: list[Array] = [0.0, 0.0, 0.0]
    for _, outcome in judged_rollout(task, attacker, batch, *random_sources(task, seed, kind)):
        total = [whole + part for whole, part in zip(total, outcome[:3], strict=True)]
    return [part / task.game.scenario.max_cycles for part in total]


def is_certain(arguments: TaskArguments) -> bool:
    """Return whether noise has no part in a task: the same random actions bring the same reward in two games."""
    task = exact_task(arguments)
    actions = np.random.default_rng(0).random((task.game.scenario.max_cycles, task.action_size))
    rewards = mean_rewards(task, OpenLoop(actions), 0, (1, 2), SEARCHED)[0]
    return bool(np.ptp(rewards) == 0)
