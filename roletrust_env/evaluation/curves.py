"""Curves of games: trust, rewards and quality of each round, without the ratings, which take too
much memory.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.rollout import rollout, stack_offered
from roletrust_env.game.state import State
from roletrust_env.randomness import Random, generator

Floats = npt.NDArray[np.float64]


class Curves(NamedTuple):
    """The curves of T rounds of E games; NaN where an agent was absent.

    Attributes:
        time_s: Time in seconds, shape (T,). The state after round r, counted from 0, stands at (r +
            1) * period_s.
        tor: Trust of the raters, shape (T, S, E).
        top: Trust of the providers, shape (T, P, E).
        trust: Trust of the agents by role, shape (T, N, E).
        rewards: Rewards of the agents, shape (T, N, E).
        offered: Quality on offer, shape (T, P, E), or shape (T, S, P, E) where a provider treats
            raters differently, see `Game.offered`.
        weights: Weights of the rounds in means, shape (T,), see `Scenario.round_weights`; None
            weights all alike.
    """

    time_s: Floats
    tor: Floats
    top: Floats
    trust: Floats
    rewards: Floats
    offered: Floats
    weights: Floats | None = None


def curve_bytes(joint_policy: JointPolicy) -> int:
    """Return the memory of the `Curves` of one game, in bytes."""
    game, roster = joint_policy.game, joint_policy.game.roster
    differs = any("treatment" in policy.attacks for policy in joint_policy.policies.values())
    of_each = roster.n_raters if differs else 1
    columns = roster.n_raters + (1 + of_each) * roster.n_providers + 2 * roster.n_agents
    return columns * game.scenario.max_cycles * np.dtype(np.float64).itemsize


def record_curves(
    joint_policy: JointPolicy,
    seed: int,
    *,
    games: int = 1,
    on_round: Callable[[State], None] = lambda state: None,
) -> Curves:
    """Play games of `max_cycles` rounds as one batch, and return their curves.

    The noise of the games and the random numbers of the policies are drawn apart: with the same
    seed games have the same noise under any policies, so that a run under attack can be paired with
    one without.

    Args:
        joint_policy: Game and policies of its agents.
        seed: Random seed.
        games: Number of games E.
        on_round: Called with the state after each round.

    Raises:
        ValueError: A trust model or a policy fails.
    """
    game = joint_policy.game
    rows: list[tuple[Floats, ...]] = []
    offered: list[Floats] = []
    roster, length = game.roster, game.scenario.max_cycles
    noise, chance = Random(generator(seed)), Random(np.random.default_rng([seed, 1]))
    for before, actions, state, rewards, _ in rollout(joint_policy, noise, chance, (games,)):
        offered.append(game.offered(before, actions, state))
        here = game.present(state)
        present = np.ones(rewards.shape, dtype=bool) if here is None else here
        tor, top = game.published(state)
        rows.append(
            (
                np.where(roster.raters(present), tor, np.nan),
                np.where(roster.providers(present), top, np.nan),
                np.where(present, game.agent_trust(state), np.nan),
                np.where(present, rewards, np.nan),
            )
        )
        on_round(state)
    time_s = np.arange(1, length + 1, dtype=np.float64) * game.scenario.period_s
    columns = [
        *(np.stack(column) for column in zip(*rows, strict=True)),
        stack_offered(offered),
        game.scenario.round_weights,
    ]
    return Curves(time_s, *columns)
