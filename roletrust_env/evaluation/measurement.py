"""Scores of attacks: the games that are watched, and the numbers that are read off them."""

from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from roletrust_env import metrics
from roletrust_env.evaluation.attacked_games import HELD_OUT, attacked_rollout, random_sources
from roletrust_env.evaluation.attackers import Attacker, Scripted
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.consumer import Bought
from roletrust_env.metrics.score import mean_or_nan, ratio
from roletrust_env.trust import Traits

Floats = npt.NDArray[np.float64]

MEASURED = ("utility", "published", "blind", "damage", "false_alarms", "auc")
"""Names of the scores of a game.

`utility`: utility of going by trust, see `metrics.utility`. `published`: utility if the same consumers went by
published trust; it differs for a personal trust model with raters as consumers. `blind`: utility of a blind choice, see
`metrics.blind_utility`. `damage`: loss of trust of the honest agents, see `metrics.damage`. `false_alarms`: share of
honest agents that count as attackers, see `metrics.false_alarms`. `auc`: probability that mean trust tells an attacker
from an honest agent of its role, see `metrics.auc`.
"""

Scores = dict[str, Floats]
"""Scores of K attacks in G games each, shape (K, G), by the names of `MEASURED`; NaN where undefined."""


class GameRecord(NamedTuple):
    """The record of T rounds of K x G games.

    Attributes:
        trust: Trust of the agents by role, shape (T, N, K, G); NaN where an agent was absent.
        bought: Qualities that consumers got, shape (T - 1, K, G). The first round has no trust to go by.
        published: Qualities that consumers would have got by published trust.
    """

    trust: Floats
    bought: Bought
    published: Bought


class GameScores(NamedTuple):
    """The scores of K attacks in G games each.

    Attributes:
        scores: Scores by the names of `MEASURED`, each of shape (K, G).
        bought: Qualities that consumers got under the attacks.
        clean: Qualities that consumers got in the same games with everybody honest, once for all attacks.
    """

    scores: Scores
    bought: Bought
    clean: Bought


class SplitScores(NamedTuple):
    """The scores of K attacks in held-out games, in two halves.

    Attributes:
        chosen: Scores in the first half of the games, which choose the worst case.
        measured: Scores in the second half, which measure the worst case.
        by_round: Mean utility over the second half in each round from the second on, shape (T - 1, K); NaN where no
            provider served well.
    """

    chosen: Scores
    measured: Scores
    by_round: Floats

    @classmethod
    def halves(cls, scores: Scores, bought: Bought) -> Self:
        """Split scores of shape (K, 2 G), and what consumers got in the same games."""
        first, second = zip(*(np.split(values, 2, axis=-1) for values in scores.values()), strict=True)
        got, best = (np.split(part, 2, axis=-1)[1] for part in (bought.got, bought.best))
        chosen, measured = (dict(zip(scores, half, strict=True)) for half in (first, second))
        return cls(chosen, measured, mean_or_nan(ratio(got, best), axis=-1))


def watch(task: AttackTask, attacker: Attacker, seed: int, batch: tuple[int, int]) -> GameRecord:
    """Play held-out games to the end and return what is measured. Arguments as for `attacked_rollout`.

    Raises:
        ValueError: An attacker or a trust model fails, or an action is NaN or outside [0, 1].
    """
    game, trusts, bought, published = task.game, [], [], []
    for before, actions, state, _ in attacked_rollout(task, attacker, batch, *random_sources(task, seed, HELD_OUT)):
        trust, present = game.agent_trust(state), game.present(state)
        trusts.append(trust if present is None else np.where(present, trust, np.nan))
        bought.append(task.bought(before, actions, state))
        published.append(task.bought_by_published(before, actions, state))
    rounds = (Bought(*(np.stack(part) for part in zip(*kept[1:], strict=True))) for kept in (bought, published))
    return GameRecord(np.stack(trusts), *rounds)


def watch_honest(task: AttackTask, seed: int, games: int) -> GameRecord:
    """Play held-out games with everybody honest, the twins of attacked games, shape (1, G). See `watch`."""
    return watch(task, Scripted({}), seed, (1, games))


def score(
    task: AttackTask, attacker: Attacker, seed: int, batch: tuple[int, int], twin: GameRecord | None = None
) -> GameScores:
    """Play attacks side by side, compare them with the same games with everybody honest, and return the scores.

    Args:
        task: Task that is played, in double precision.
        attacker: Attacker, or K attackers side by side.
        seed: Random seed.
        batch: Shape (K, G): K attacks in G games each.
        twin: The honest games, `watch_honest` of the same task, seed and G; None plays them.

    Raises:
        ValueError: See `watch`.
    """
    judged = _judged(task)
    seen = watch(task, attacker, seed, batch)
    twin = watch_honest(task, seed, batch[1]) if twin is None else twin
    honest = [i for i, name in enumerate(task.game.roster.names) if name in judged and name not in task.identities]
    damage = metrics.damage(seen.trust, np.broadcast_to(twin.trust, seen.trust.shape), honest).value
    auc = _told_apart(task, seen.trust, judged)
    return GameScores({**_read(seen, honest), "damage": damage, "auc": auc}, seen.bought, twin.bought)


def measure(
    task: AttackTask, attacker: Attacker, seed: int, batch: tuple[int, int], twin: GameRecord | None = None
) -> SplitScores:
    """Score attacks in games that choose the worst case and in other games that measure it.

    Args:
        task: Task that is played, in double precision.
        attacker: Attacker, or K attackers side by side.
        seed: Random seed.
        batch: Shape (K, G): K attacks, in G games each to choose the worst case, and in G others to measure it.
        twin: The 2 G honest games, see `score`.
    """
    scored = score(task, attacker, seed, (batch[0], 2 * batch[1]), twin)
    return SplitScores.halves(scored.scores, scored.bought)


def measure_honest(task: AttackTask, seed: int, games: int) -> SplitScores:
    """Score games with everybody honest. Damage and AUC are undefined there."""
    judged = _judged(task)
    agents = [i for i, name in enumerate(task.game.roster.names) if name in judged]
    nothing = np.full((1, 2 * games), np.nan)
    seen = watch_honest(task, seed, 2 * games)
    return SplitScores.halves({**_read(seen, agents), "damage": nothing, "auc": nothing}, seen.bought)


def _judged(task: AttackTask) -> tuple[str, ...]:
    """Return the agents that the trust model tells apart: all of them, or the providers."""
    roster = task.game.roster
    return roster.names if Traits.of(task.game.model).rates_raters else roster.provider_names


def _read(seen: GameRecord, honest: list[int]) -> Scores:
    """Return the scores that need no other games for comparison."""
    got, best, blind = seen.bought
    return {
        "utility": metrics.share_of_best(got, best).value,
        "published": metrics.share_of_best(seen.published.got, seen.published.best).value,
        "blind": metrics.share_of_best(blind, best).value,
        "false_alarms": metrics.false_alarms(seen.trust, honest).value,
    }


def _told_apart(task: AttackTask, trust: Floats, judged: tuple[str, ...]) -> Floats:
    """Return the AUC of mean trust, averaged over the roles that have attackers and a trust."""
    mean, roster = mean_or_nan(trust, axis=0), task.game.roster
    found = []
    for names in (roster.rater_names, roster.provider_names):
        places = [i for i, name in enumerate(roster.names) if name in names and name in judged]
        bad = [k for k, i in enumerate(places) if roster.names[i] in task.identities]
        if bad:
            found.append(metrics.auc(mean[places], bad).value)
    return mean_or_nan(np.stack(found), axis=0) if found else np.full(trust.shape[2:], np.nan)
