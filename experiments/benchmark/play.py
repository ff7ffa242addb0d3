"""How a cell's games are watched, and what is read off them."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from agents.ladder.players import Attacker, Scripted
from agents.ladder.rungs import HELD_OUT, play, sources
from roletrust_env import metrics
from roletrust_env.game.attack import AttackTask
from roletrust_env.metrics.score import mean_where
from roletrust_env.trust import Traits

Floats = npt.NDArray[np.float64]

CHOOSING = 2
"""The luck of the games in which the worst case is chosen; beside `SEARCHED` and `HELD_OUT`, see `agents.ladder`."""

MEASURED = ("utility", "blind", "damage", "false_alarms", "auc")
"""What is read off a game.

`utility` and `blind`: see `metrics.utility` and `metrics.blind_utility`; `damage`: what the honest lost of their trust,
see `metrics.damage`; `false_alarms`: how often they were taken for attackers, see `metrics.false_alarms`; `auc`: how
well the mean trust tells the attackers from the honest of their role, see `metrics.auc`.
"""

Scores = dict[str, Floats]
"""A number for each game, (K, G), by the names of `MEASURED`; NaN where it is undefined."""


class Watched(NamedTuple):
    """What T rounds of K x G games left behind; NaN where an agent was not there or did not serve.

    Attributes:
        trust: of the agents, each by its role, (T, N, K, G).
        top: of the providers, (T, P, K, G).
        offered: quality for whoever came, (T, P, K, G).
    """

    trust: Floats
    top: Floats
    offered: Floats


def watch(task: AttackTask, attacker: Attacker, seed: int, batch: tuple[int, int], kind: int) -> Watched:
    """Play to the end and keep what is measured. Arguments as for `agents.ladder.rungs.play` and `sources`."""
    game, roster, rows = task.game, task.game.roster, []
    for moment in play(task, attacker, batch, *sources(task, seed, kind)):
        state = moment.state.game
        trust, top, present = game.agent_trust(state), game.published(state)[1], game.present(state)
        if present is not None:
            trust = np.where(present, trust, np.nan)
            top = np.where(roster.providers(present), top, np.nan)
        rows.append((trust, top, moment.offered))
    return Watched(*(np.stack(column) for column in zip(*rows, strict=True)))


def measure(task: AttackTask, attacker: Attacker, seed: int, batch: tuple[int, int], kind: int = HELD_OUT) -> Scores:
    """Play some attacks side by side, and the same games once with everybody honest, and measure them.

    Args:
        task: what is played, exactly.
        attacker: K attacks side by side, or one.
        seed: of all luck.
        batch: (K, G), K attacks in G games each.
        kind: of luck: `CHOOSING` or `HELD_OUT`.
    """
    seen = watch(task, attacker, seed, batch, kind)
    twin = watch(task, Scripted({}), seed, (1, batch[1]), kind)
    roster, rated = task.game.roster, Traits.of(task.game.model).rates_raters
    judged = roster.names if rated else roster.provider_names
    honest = [i for i, name in enumerate(roster.names) if name in judged and name not in task.identities]
    scores = {
        "utility": metrics.utility(seen.top, seen.offered),
        "blind": metrics.blind_utility(seen.top, seen.offered),
        "damage": metrics.damage(seen.trust, np.broadcast_to(twin.trust, seen.trust.shape), honest),
        "false_alarms": metrics.false_alarms(seen.trust, honest),
    }
    return {**{name: score.value for name, score in scores.items()}, "auc": _told_apart(task, seen.trust, judged)}


def measure_honest(task: AttackTask, seed: int, games: int) -> Scores:
    """The same where everybody is honest: there is nothing to lose and nobody to find."""
    seen = watch(task, Scripted({}), seed, (1, games), HELD_OUT)
    rated = Traits.of(task.game.model).rates_raters
    judged = task.game.roster.names if rated else task.game.roster.provider_names
    everybody = [i for i, name in enumerate(task.game.roster.names) if name in judged]
    nothing = np.full((1, games), np.nan)
    return {
        "utility": metrics.utility(seen.top, seen.offered).value,
        "blind": metrics.blind_utility(seen.top, seen.offered).value,
        "damage": nothing,
        "false_alarms": metrics.false_alarms(seen.trust, everybody).value,
        "auc": nothing,
    }


def _told_apart(task: AttackTask, trust: Floats, judged: tuple[str, ...]) -> Floats:
    """The AUC of the mean trust, the mean over the roles that have attackers and trust."""
    mean, roster = mean_where(trust, axis=0), task.game.roster
    found = []
    for names in (roster.rater_names, roster.provider_names):
        places = [i for i, name in enumerate(roster.names) if name in names and name in judged]
        bad = [k for k, i in enumerate(places) if roster.names[i] in task.identities]
        if bad:
            found.append(metrics.auc(mean[places], bad).value)
    return mean_where(np.stack(found), axis=0) if found else np.full(trust.shape[2:], np.nan)
