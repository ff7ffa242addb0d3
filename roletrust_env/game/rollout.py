"""The loop over the rounds of a game, and the record of a whole game."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, NamedTuple, Protocol

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.state import Actions, Noise, State
from roletrust_env.parameters import check_instance
from roletrust_env.randomness import Random
from roletrust_env.shapes import PerAgent, PerPair, PerProvider, Shape


class Players(Protocol):
    """The behaviour of all agents of a game: a `JointPolicy`, or an attacker among scripted agents.

    Attributes:
        game: The game that they play.
    """

    @property
    def game(self) -> Game:
        """The game that they play."""

    def begin(self, random: Random, batch: tuple[int, ...]) -> Any:
        """Return the memory before the first round."""

    def checked_act(self, state: State, memory: Any, random: Random) -> tuple[Actions, Any]:
        """Return the actions of all agents, each in [0, 1], and the new memory.

        Raises:
            ValueError: A policy fails, or an action is NaN or outside [0, 1]. The message names the
                round.
        """


class Round(NamedTuple):
    """One round of a game.

    Attributes:
        before: State before the round.
        actions: Actions of all agents.
        state: State after the round.
        rewards: Rewards of the agents, shape (N, ...).
        weight: Probability that the round is played, see `Scenario.round_weights`; 1 unless games
            end at random.
    """

    before: State
    actions: Actions
    state: State
    rewards: PerAgent
    weight: float


class History(NamedTuple):
    """The record of a whole game, one row for each of its T rounds.

    Attributes:
        tor: Trust of the raters, shape (T, S, ...).
        top: Trust of the providers, shape (T, P, ...).
        trust: Trust of the agents by role, shape (T, N, ...).
        quality: Delivered quality, shape (T, P, ...): the mean over the raters that were served, 0
            without any.
        ratings: Ratings that arrived, shape (T, S, P, ...); 0 where none did.
        rated: Whether a rating arrived, boolean, shape (T, S, P, ...).
        served: Whether a provider served a rater, boolean, shape (T, S, P, ...). The rating follows
            in the next round at the earliest.
        rewards: Rewards of the agents, shape (T, N, ...).
        present: Whether an agent is present after the round, boolean, shape (T, N, ...). The trust
            of an absent agent is the initial trust before it joins, and stays constant after it has
            left; leave it out of means.
        offered: Quality that was on offer, shape (T, P, ...), or shape (T, S, P, ...) where a
            provider treated raters differently; NaN where a provider did not serve. See
            `Game.offered`.
    """

    tor: Annotated[Array, Shape("T S ...")]
    top: Annotated[Array, Shape("T P ...")]
    trust: Annotated[Array, Shape("T N ...")]
    quality: Annotated[Array, Shape("T P ...")]
    ratings: Annotated[Array, Shape("T S P ...")]
    rated: Annotated[Array, Shape("T S P ...", "bool")]
    served: Annotated[Array, Shape("T S P ...", "bool")]
    rewards: Annotated[Array, Shape("T N ...")]
    present: Annotated[Array, Shape("T N ...", "bool")]
    offered: Annotated[Array, Shape("T P ...")] | Annotated[Array, Shape("T S P ...")]

    def __repr__(self) -> str:
        rounds, raters, *batch = self.tor.shape
        agents = f"raters: {raters}, providers: {self.top.shape[1]}, agents: {self.trust.shape[1]}"
        return f"History(rounds: {rounds}, {agents}, batch: {tuple(batch)})"


def rollout(
    players: Players,
    noise: Random,
    chance: Random,
    batch: tuple[int, ...] = (),
    *,
    rows: int | None = None,
) -> Iterator[Round]:
    """Play games round by round, `max_cycles` rounds. Every other loop over rounds is this one.

    Args:
        players: Behaviour of all agents.
        noise: Random numbers of the game, with its array library, dtype and device.
        chance: Random numbers of the policies. It may be the same object as `noise`: the two
            streams are independent.
        batch: Shape of the batch of games.
        rows: Number of rows K of games that meet the same noise. The players see the batch (K,
            *batch).

    Yields:
        The rounds, in order.

    Raises:
        ValueError: `batch` is no tuple, or the players fail, see `Players.checked_act`.
    """
    if not isinstance(batch, tuple):
        raise ValueError(
            f"batch is {batch!r}; it must be a shape, such as () for one game or (1000,)"
        )
    game = players.game
    state = game.start(_draw(game, noise, batch, rows, start=True))
    memory = players.begin(chance, batch if rows is None else (rows, *batch))
    for weight in game.scenario.round_weights.tolist():
        actions, memory = players.checked_act(state, memory, chance)
        before = state
        state, rewards = game.step(before, actions, _draw(game, noise, batch, rows))
        yield Round(before, actions, state, rewards, weight)


def record(joint_policy: JointPolicy, random: Random, batch: tuple[int, ...] = ()) -> History:
    """Play games of `max_cycles` rounds and return the record.

    Where games end at random, metrics take `Scenario.round_weights`, by which the rounds count.

    Args:
        joint_policy: Game and policies of its agents.
        random: Random numbers of the game and of the policies.
        batch: Shape of the batch of games.

    Raises:
        ValueError: An argument is of another class, or a policy fails.

    Example:
        >>> import roletrust_env
        >>> game = roletrust_env.Game(roletrust_env.make_scenario("paper-3x3").change(noise=0.0))
        >>> history = record(roletrust_env.JointPolicy(game, {}), game.random(seed=0))
        >>> history.top[30].round(3)
        array([1., 1., 1.])
    """
    check_instance("joint_policy", joint_policy, JointPolicy, "a JointPolicy")
    check_instance("random", random, Random, "a Random, as game.random(seed=0) makes it")
    game = joint_policy.game
    rows, offered = [], []
    for before, actions, state, rewards, _ in rollout(joint_policy, random, random, batch):
        offered.append(game.offered(before, actions, state))
        tor, top = game.published(state)
        trust = game.agent_trust(state)
        present = game.present(state)
        if present is None:
            present = trust == trust  # everybody
        rows.append(
            (
                tor,
                top,
                trust,
                state.quality,
                state.ratings,
                state.rated,
                state.awaiting,
                rewards,
                present,
            )
        )
    stack = namespace(rows[0][0]).stack
    columns = [*(stack(column) for column in zip(*rows, strict=True)), stack_offered(offered)]
    return History(*columns)


def stack_offered(
    offered: Sequence[PerProvider | PerPair],
) -> Annotated[Array, Shape("T P ...")] | Annotated[Array, Shape("T S P ...")]:
    """Stack the quality on offer in each round, shape (P, ...) or (S, P, ...), into one array."""
    xp, shape = namespace(offered[0]), max((quality.shape for quality in offered), key=len)
    return xp.stack([xp.broadcast_to(quality, shape) for quality in offered])


def _draw(
    game: Game, random: Random, batch: tuple[int, ...], rows: int | None, *, start: bool = False
) -> Noise:
    """Draw the noise of a round, the same for every row."""
    noise = game.draw(random, batch, start=start)
    if rows is None:
        return noise
    axis = -1 - len(batch)
    return Noise(
        *(
            None if part is None else namespace(part).stack([part] * rows, axis=axis)
            for part in noise
        )
    )
