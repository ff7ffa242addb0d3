"""Playing a game to its end with a joint policy, in one game or a batch."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.state import State
from roletrust_env.randomness import Random


class Round(NamedTuple):
    """What one round left behind.

    Attributes:
        state: after the round.
        rewards: (N, ...).
        offered: quality that providers had for whoever came, (P, ...) or (S, P, ...), see `Game.offered`.
    """

    state: State
    rewards: Array
    offered: Array


class History(NamedTuple):
    """What a whole game left behind, one row for each of its T rounds.

    Attributes:
        tor: trust of the raters, (T, S, ...).
        top: trust of the providers, (T, P, ...).
        trust: trust of the agents, each by its role, (T, N, ...).
        quality: delivered quality, 0 where nobody came, the mean over those who were served, (T, P, ...).
        ratings: ratings that arrived, 0 where none did, (T, S, P, ...).
        rated: where they did, boolean, (T, S, P, ...).
        served: who was served by whom, boolean, (T, S, P, ...); rated in the next round at the earliest.
        rewards: (T, N, ...).
        present: who is present after the round, boolean, (T, N, ...). The trust of an agent that is not there is the
            initial one before it joins, and stays where it was after it has gone; leave it out of means.
        offered: quality that was there for whoever came, NaN where none was, (T, P, ...); or for each rater,
            (T, S, P, ...), where any provider ever treated them differently, see `Game.offered`.
    """

    tor: Array
    top: Array
    trust: Array
    quality: Array
    ratings: Array
    rated: Array
    served: Array
    rewards: Array
    present: Array
    offered: Array

    def __repr__(self) -> str:
        rounds, raters, providers, *batch = self.ratings.shape
        agents = f"raters: {raters}, providers: {providers}, agents: {self.trust.shape[1]}"
        return f"History(rounds: {rounds}, {agents}, batch: {tuple(batch)})"


def play(joint_policy: JointPolicy, random: Random, batch: tuple[int, ...] = ()) -> Iterator[Round]:
    """Play round after round, to the scenario's end.

    Args:
        joint_policy: the game, and who plays how.
        random: the source of all luck, with the game's array library, dtype and device.
        batch: shape of the batch of games.

    Yields:
        Each round as it was played.

    Raises:
        ValueError: `batch` is no tuple, or a policy fails, see `JointPolicy.checked_act`.
    """
    if not isinstance(batch, tuple):
        raise ValueError(f"batch is {batch!r}; it must be a shape, such as () for one game or (1000,)")
    game = joint_policy.game
    state = game.start(game.draw(random, batch, start=True))
    memories = joint_policy.begin(random, batch)
    for _ in range(game.scenario.max_cycles):
        actions, memories = joint_policy.checked_act(state, memories, random)
        before = state
        state, rewards = game.step(before, actions, game.draw(random, batch))
        yield Round(state, rewards, game.offered(before, actions, state))


def record(joint_policy: JointPolicy, random: Random, batch: tuple[int, ...] = ()) -> History:
    """Play to the scenario's end and keep what happened. Arguments as for `play`.

    Example:
        >>> import roletrust_env
        >>> game = roletrust_env.Game(roletrust_env.make_scenario("paper-3x3").change(noise=0.0))
        >>> history = record(roletrust_env.JointPolicy(game, {}), game.random(seed=0))
        >>> history.top[30].round(3)
        array([1., 1., 1.])
    """
    rows, offered = [], []
    for state, rewards, there in play(joint_policy, random, batch):
        offered.append(there)
        tor, top = joint_policy.game.published(state)
        trust = joint_policy.game.agent_trust(state)
        present = joint_policy.game.present(state)
        if present is None:
            present = trust == trust  # everybody
        rows.append((tor, top, trust, state.quality, state.ratings, state.rated, state.awaiting, rewards, present))
    stack = namespace(rows[0][0]).stack
    columns = [*(stack(column) for column in zip(*rows, strict=True)), stacked(offered)]
    return History(*columns)


def stacked(offered: Sequence[Array]) -> Array:
    """What was offered round by round, (P, ...) or (S, P, ...) each, as one array."""
    xp, shape = namespace(offered[0]), max((one.shape for one in offered), key=len)
    return xp.stack([xp.broadcast_to(one, shape) for one in offered])
