"""Attacked games, played to the end: the reward of the attacker in them, and the scores that are
read off them.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env import metrics
from roletrust_env.arrays import Array, namespace
from roletrust_env.evaluation.attackers import AttackedPlayers, Attacker, OpenLoop, Scripted
from roletrust_env.evaluation.resources import pairs, trial_size, try_out
from roletrust_env.game.attack_task import AttackTask, Outcome
from roletrust_env.game.consumer import Bought
from roletrust_env.game.make_task import make_task
from roletrust_env.game.rollout import Round, rollout
from roletrust_env.memory import check_memory
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.parameters import whole_number
from roletrust_env.randomness import Random
from roletrust_env.trust import Traits

TaskArguments = Mapping[str, Any]
"""Arguments of `roletrust_env.make_task`, all but `like`."""

SEARCHED, HELD_OUT = 0, 1
"""The two kinds of random numbers: those of the games in a search, and those of the games that
measure the result."""


_ANYWHERE = 2_000_000
"""Pairs of agents in all games of a batch that fits into any memory."""


class AttackedRound(NamedTuple):
    """One round of an attacked game.

    Attributes:
        round: The round.
        outcome: Outcome for the attacker, times the weight of the round; 0 in games that are over
            for it.
    """

    round: Round
    outcome: Outcome


def exact_task(arguments: TaskArguments) -> AttackTask:
    """Return the task in NumPy's double precision."""
    return make_task(**arguments, like=np.zeros(()))


def random_sources(
    task: AttackTask, seed: int | tuple[int, ...], kind: int
) -> tuple[Random, Random]:
    """Return the noise of the game and the random numbers of the policies.

    Args:
        task: Task that is played.
        seed: Random seed.
        kind: `SEARCHED` or `HELD_OUT`.
    """
    seeds = seed if isinstance(seed, tuple) else (whole_number("seed", seed),)
    noise, chance = np.random.SeedSequence((kind, *seeds)).generate_state(2)
    return task.game.random(int(noise)), task.game.random(int(chance))


def attacked_rollout(
    task: AttackTask, attacker: Attacker, batch: tuple[int, int], noise: Random, chance: Random
) -> Iterator[Round]:
    """Play a task to the end of its scenario.

    Args:
        task: Task that is played.
        attacker: Attacker, or K attackers side by side.
        batch: Shape (K, G): K attacks side by side, each in G games. All K meet the same noise, so
            they compare.
        noise: Random numbers of the game.
        chance: Random numbers of the policies. They are apart from the noise, which must not depend
            on the attacker.

    Yields:
        The rounds, in order.
    """
    return rollout(AttackedPlayers(task, attacker), noise, chance, batch[1:], rows=batch[0])


def judged_rollout(
    task: AttackTask, attacker: Attacker, batch: tuple[int, int], noise: Random, chance: Random
) -> Iterator[AttackedRound]:
    """Play a task to the end of its scenario and judge each round. Arguments as for
    `attacked_rollout`.
    """
    return weighted_outcomes(task, attacked_rollout(task, attacker, batch, noise, chance))


def weighted_outcomes(task: AttackTask, rounds: Iterator[Round]) -> Iterator[AttackedRound]:
    """Yield the rounds with the outcome for the attacker, times the weight of the round.

    A game in which the attacker has been caught brings 0 from then on.
    """
    ended: Array | None = None
    for played in rounds:
        outcome = task.judge(played.before, played.actions, played.state)
        if played.state.population is not None:  # else nobody can be caught
            ended = played.state.round < 0 if ended is None else ended  # nobody yet
            reward, objective, cost = (
                namespace(part).where(ended, 0 * part, part) for part in outcome[:3]
            )
            ended = ended | outcome.caught
            outcome = outcome._replace(reward=reward, objective=objective, cost=cost)
        if played.weight < 1:
            reward, objective, cost = (played.weight * part for part in outcome[:3])
            outcome = outcome._replace(reward=reward, objective=objective, cost=cost)
        yield AttackedRound(played, outcome)


def task_memory(task: AttackTask, attacker: Attacker) -> float:
    """Return the memory of each game that measures an attacker, in bytes."""

    def played(games: int) -> Iterator[AttackedRound]:
        return judged_rollout(task, attacker, (1, games), *random_sources(task, 0, HELD_OUT))

    return try_out(played, trial_size(task.game)).memory


def check_games_memory(task: AttackTask, games: int) -> None:
    """Refuse a batch of games that does not fit into the memory. What fits anywhere is not tried
    out.

    Args:
        task: Task that is played, on NumPy.
        games: Number of games that are played at once.

    Raises:
        ValueError: The games do not fit. The message says what they would take, and about how many
            fit.
    """
    if games * pairs(task.game) > _ANYWHERE:
        check_memory("games at once:", games, task_memory(task, Scripted({})))


def mean_rewards(
    task: AttackTask,
    attacker: Attacker,
    seed: int | tuple[int, ...],
    batch: tuple[int, int],
    kind: int,
) -> list[Array]:
    """Return the mean reward, objective and cost per round, each of shape (K, G); the rounds have
    their weights.

    Args:
        task: Task that is played.
        attacker: Attacker, or K attackers side by side.
        seed: Random seed.
        batch: Shape (K, G), see `attacked_rollout`.
        kind: `SEARCHED` or `HELD_OUT`.

    Raises:
        ValueError: The games do not fit into the memory, see `check_games_memory`.
    """
    check_games_memory(task, math.prod(batch))
    total: list[Array] = [0.0, 0.0, 0.0]
    for _, outcome in judged_rollout(task, attacker, batch, *random_sources(task, seed, kind)):
        total = [whole + part for whole, part in zip(total, outcome[:3], strict=True)]
    return [part / task.game.scenario.mean_length for part in total]


def is_certain(arguments: TaskArguments) -> bool:
    """Return whether noise has no part in a task: the same random actions bring the same reward in
    two games.
    """
    task = exact_task(arguments)
    actions = np.random.default_rng(0).random((task.game.scenario.max_cycles, task.action_size))
    rewards = mean_rewards(task, OpenLoop(actions), 0, (1, 2), SEARCHED)[0]
    return bool(np.ptp(rewards) == 0)


Floats = npt.NDArray[np.float64]

_SHARE = 0.0, 1.0

MEASURED = {
    "utility": _SHARE,
    "published": _SHARE,
    "blind": _SHARE,
    "damage": (-1.0, 1.0),
    "false_alarms": _SHARE,
    "auc": _SHARE,
}
"""Scores of a game by name, each with its least and its greatest value.

`utility`: utility of going by trust, see `metrics.utility`. `published`: utility if the same
consumers went by published trust; it differs for a personal trust model with raters as consumers.
`blind`: utility of a blind choice, see `metrics.blind_utility`. `damage`: loss of trust of the
honest agents, see `metrics.damage`. `false_alarms`: share of honest agents that count as attackers,
see `metrics.false_alarms`. `auc`: probability that mean trust tells an attacker from an honest
agent of its role, see `metrics.auc`.
"""

Scores = dict[str, Floats]
"""Scores of K attacks in G games each, shape (K, G), by the names of `MEASURED`; NaN where
undefined."""


class GameRecord(NamedTuple):
    """The record of T rounds of K x G games.

    Attributes:
        trust: Trust of the agents by role, shape (T, N, K, G); NaN where an agent was absent.
        bought: Qualities that consumers got, times the weight of the round, shape (T - 1, K, G).
            The first round has no trust to go by.
        published: Qualities that consumers would have got by published trust, in the same way.
    """

    trust: Floats
    bought: Bought
    published: Bought


class GameScores(NamedTuple):
    """The scores of K attacks in G games each.

    Attributes:
        scores: Scores by the names of `MEASURED`, each of shape (K, G).
        clean: Qualities that consumers got in the same games with everybody honest, once for all
            attacks.
    """

    scores: Scores
    clean: Bought


def watch(
    task: AttackTask, attacker: Attacker, seed: int | tuple[int, ...], batch: tuple[int, int]
) -> GameRecord:
    """Play held-out games to the end and return what is measured. Arguments as for
    `attacked_rollout`.

    Raises:
        ValueError: A game has one round, an attacker or a trust model fails, or an action is NaN or
            outside [0, 1].
    """
    game, trusts, bought, published = task.game, [], [], []
    if game.scenario.max_cycles < 2:
        raise ValueError(
            "max_cycles is 1; consumers choose by trust from the second round on, so it must be 2 "
            "or more"
        )
    sources = random_sources(task, seed, HELD_OUT)
    for before, actions, state, _, weight in attacked_rollout(task, attacker, batch, *sources):
        trust, present = game.agent_trust(state), game.present(state)
        trusts.append(trust if present is None else np.where(present, trust, np.nan))
        bought.append([weight * part for part in task.bought(before, actions, state)])
        published.append(
            [weight * part for part in task.bought_by_published(before, actions, state)]
        )
    own, public = (
        Bought(*(np.stack(part) for part in zip(*got[1:], strict=True)))
        for got in (bought, published)
    )
    return GameRecord(np.stack(trusts), own, public)


def score(
    task: AttackTask,
    attacker: Attacker,
    seed: int | tuple[int, ...],
    batch: tuple[int, int],
) -> GameScores:
    """Play attacks side by side, compare them with the same games with everybody honest, and return
    the scores.

    Args:
        task: Task that is played, in double precision.
        attacker: Attacker, or K attackers side by side.
        seed: Random seed.
        batch: Shape (K, G): K attacks in G games each.

    Raises:
        ValueError: See `watch`.
    """
    judged, weights = _judged(task), task.game.scenario.round_weights
    seen = watch(task, attacker, seed, batch)
    twin = watch(task, Scripted({}), seed, (1, batch[1]))
    honest = [
        i
        for i, name in enumerate(task.game.roster.names)
        if name in judged and name not in task.identities
    ]
    damage = metrics.damage(
        seen.trust, np.broadcast_to(twin.trust, seen.trust.shape), honest, weights
    ).value
    auc = _detection(task, mean_or_nan(seen.trust, 0, weights), judged)
    scores = {**_read(seen, honest, weights), "damage": damage, "auc": auc}
    return GameScores(scores, twin.bought)


def _judged(task: AttackTask) -> tuple[str, ...]:
    """Return the agents that the trust model tells apart: all of them, or the providers."""
    roster = task.game.roster
    return roster.names if Traits.of(task.game.model).rates_raters else roster.provider_names


def _read(seen: GameRecord, honest: list[int], weights: Floats) -> Scores:
    """Return the scores that need no other games for comparison."""
    got, best, blind = seen.bought
    return {
        "utility": metrics.share_of_best(got, best).value,
        "published": metrics.share_of_best(seen.published.got, seen.published.best).value,
        "blind": metrics.share_of_best(blind, best).value,
        "false_alarms": metrics.false_alarms(seen.trust, honest, weights=weights).value,
    }


def _detection(task: AttackTask, mean: Floats, judged: tuple[str, ...]) -> Floats:
    """Return the AUC of mean trust, (N, K, G), averaged over the roles that have attackers and a
    trust.
    """
    roster = task.game.roster
    scores = []
    for names in (roster.rater_names, roster.provider_names):
        indices = [i for i, name in enumerate(roster.names) if name in names and name in judged]
        bad = [k for k, i in enumerate(indices) if roster.names[i] in task.identities]
        if bad:
            scores.append(metrics.auc(mean[indices], bad).value)
    return mean_or_nan(np.stack(scores), axis=0) if scores else np.full(mean.shape[1:], np.nan)
