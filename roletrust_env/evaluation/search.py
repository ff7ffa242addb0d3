"""The ladder: ways to attack a task, from honest play to the exact optimum, under one interface and one budget.

A rung is given the arguments of a task, a budget and a seed, and comes back with an attacker. The budget counts game
rounds: rounds times games, all that a rung plays to decide what to do, whether or not it follows gradients through
them. What it found is then measured by `find`, the same way for all, in games whose luck no rung has seen; these are
not counted.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.evaluation.attackers import Attacker, OpenLoop, Scripted
from roletrust_env.game.attack_task import AttackTask, Outcome, TaskState, make_task
from roletrust_env.game.state import Actions, Noise
from roletrust_env.randomness import Random
from roletrust_env.registry import Registry

TaskArguments = Mapping[str, Any]
"""TaskArguments of `roletrust_env.make_task`, all but `like`."""

OnRounds = Callable[[int], None]
"""Told from time to time how many more rounds of the budget are used."""

SEARCHED, HELD_OUT = 0, 1  # the two kinds of luck: what rungs play with, and what they are measured with


class UnsuitableError(ValueError):
    """A rung does not apply to a task; the message says why."""


class SearchResult(NamedTuple):
    """What a rung came back with.

    Attributes:
        attacker: that it found.
        rounds: that were used.
        words: what the attacker is, in a few words.
        seconds: that it took, if it was long ago; None if just now.
        bound: mean reward per round that no attack exceeds; None if none is known.
    """

    attacker: Attacker
    rounds: int
    words: str
    seconds: float | None = None
    bound: float | None = None


class RoundCounter:
    """Counts the rounds that a rung uses, and tells of them."""

    def __init__(self, tell: OnRounds) -> None:
        self.rounds, self._tell = 0, tell

    def count(self, rounds: int) -> None:
        """Some more rounds are used."""
        self.rounds += rounds
        self._tell(rounds)


@runtime_checkable
class SearchMethod(Protocol):
    """A way to find an attack."""

    @property
    def name(self) -> str:
        """What to call it in tables."""
        ...

    def attack(self, arguments: TaskArguments, budget: int, seed: int, tell: OnRounds) -> SearchResult:
        """Look for a good attack.

        Args:
            arguments: of the task.
            budget: game rounds that may be used, rounds times games.
            seed: of all its luck; the same seed finds the same attack.
            tell: is told of rounds as they are used.

        Raises:
            UnsuitableError: it does not apply to this task, or the budget is too small for it.
        """
        ...


@dataclass(frozen=True)
class HonestPlay:
    """The compromised agents do nothing wrong."""

    name: str = "honest play"

    def attack(self, arguments: TaskArguments, budget: int, seed: int, tell: OnRounds) -> SearchResult:
        """See `SearchMethod.attack`."""
        return SearchResult(Scripted({}), 0, "serves its best, reports what it perceives")


search_methods: Registry[SearchMethod] = Registry("search method", "roletrust_env.search_methods", SearchMethod)


@dataclass(frozen=True, eq=False)
class MeasuredSearch:
    """What a rung found and what it is worth.

    Attributes:
        name: of the rung.
        attacker: that it found.
        words: what that is.
        scores: mean reward per round in each of the held-out games, (G,); after its end, a game brings 0.
        objective: the same of the objective alone, (G,).
        cost: the same of the unweighted cost of being told apart, (G,).
        rounds: game rounds that the rung used.
        seconds: that the search took, by the clock on the wall; the measurement is not counted.
        bound: mean reward per round that no attack exceeds, if one is known.
    """

    name: str
    attacker: Attacker
    words: str
    scores: Array
    objective: Array
    cost: Array
    rounds: int
    seconds: float
    bound: float | None


def find(
    rung: SearchMethod, arguments: TaskArguments, *, budget: int, seed: int, games: int, tell: OnRounds
) -> MeasuredSearch:
    """Let a rung search, then measure what it found in the true game, in double precision, on held-out luck.

    All rungs with the same seed are measured in the same games.

    Args:
        rung: that searches.
        arguments: of the task.
        budget: game rounds that the search may use.
        seed: of all luck.
        games: number of held-out games, each with luck of its own.
        tell: is told of rounds as the search uses them.
    """
    began = perf_counter()
    attempt = rung.attack(arguments, budget, seed, tell)
    seconds = perf_counter() - began if attempt.seconds is None else attempt.seconds
    task = exact_task(arguments)
    parts = measure(task, attempt.attacker, seed, (1, games), HELD_OUT)
    scores, objective, cost = (part[0] for part in parts)
    found = (attempt.words, scores, objective, cost, attempt.rounds, seconds, attempt.bound)
    return MeasuredSearch(rung.name, attempt.attacker, *found)


def exact_task(arguments: TaskArguments) -> AttackTask:
    """The task in NumPy's double precision."""
    return make_task(**arguments, like=np.zeros(()))


class Moment(NamedTuple):
    """One round as it was played.

    Attributes:
        state: after it.
        action: of the attacker, or all agents' actions.
        outcome: what it brought, 0 to games long over.
        offered: quality that the providers had for whoever came, see `Game.offered`.
    """

    state: TaskState
    action: Array | Actions
    outcome: Outcome
    offered: Array


class Turn(NamedTuple):
    """What happened in one round, before anybody judges it.

    Attributes:
        before: the state before it.
        action: of the attacker, or all agents' actions.
        joint: all agents' actions, the attacker's among them.
        after: the state after it.
    """

    before: TaskState
    action: Array | Actions
    joint: Actions
    after: TaskState


def turns(task: AttackTask, attacker: Attacker, batch: tuple[int, int], luck: Random, chance: Random) -> Iterator[Turn]:
    """Play to the scenario's end.

    Args:
        task: what is played.
        attacker: who plays it.
        batch: (K, G): K attacks side by side, each in G games. All K meet the same luck, which makes them comparable.
        luck: of the game.
        chance: of the policies; apart from the luck, which must not depend on who plays.
    """
    state = task.start(_shared(task.game.draw(luck, batch[1:], start=True), batch[0]), chance)
    memory = attacker.begin(task, chance, batch)
    for _ in range(task.game.scenario.max_cycles):
        noise = _shared(task.game.draw(luck, batch[1:]), batch[0])
        action, memory = attacker.act(task, state, memory, chance)
        joint, memories = task.joint(state, action, chance)
        before, state = state, TaskState(task.game.step(state.game, joint, noise)[0], memories)
        yield Turn(before, action, joint, state)


def play(
    task: AttackTask, attacker: Attacker, batch: tuple[int, int], luck: Random, chance: Random
) -> Iterator[Moment]:
    """Play to the scenario's end, and see what each round brings. TaskArguments as for `turns`."""
    ended: Array | None = None
    for before, action, joint, state in turns(task, attacker, batch, luck, chance):
        outcome = task.judge(before.game, joint, state.game)
        if state.game.population is not None:  # else nobody can be caught
            ended = state.game.round < 0 if ended is None else ended  # nobody yet
            reward, objective, cost = (namespace(part).where(ended, 0 * part, part) for part in outcome[:3])
            ended = ended | outcome.caught
            outcome = outcome._replace(reward=reward, objective=objective, cost=cost)
        yield Moment(state, action, outcome, task.game.offered(before.game, joint, state.game))


def measure(
    task: AttackTask, attacker: Attacker, seed: int | tuple[int, ...], batch: tuple[int, int], kind: int
) -> list[Array]:
    """Reward, objective and cost, each (K, G): means over all rounds of the game's full length. See `play`."""
    luck, chance = sources(task, seed, kind)
    total: list[Array] = [0.0, 0.0, 0.0]
    for moment in play(task, attacker, batch, luck, chance):
        total = [whole + part for whole, part in zip(total, moment.outcome[:3], strict=True)]
    return [part / task.game.scenario.max_cycles for part in total]


def sources(task: AttackTask, seed: int | tuple[int, ...], kind: int) -> tuple[Random, Random]:
    """The luck of the game and the chance of the policies, for a seed and a kind, `SEARCHED` or `HELD_OUT`."""
    seeds = (seed,) if isinstance(seed, int) else seed
    luck, chance = np.random.SeedSequence((kind, *seeds)).generate_state(2)
    return task.game.random(int(luck)), task.game.random(int(chance))


def is_certain(arguments: TaskArguments) -> bool:
    """Whether luck has no part in a task: the same random actions bring the same in two games."""
    task = exact_task(arguments)
    actions = np.random.default_rng(0).random((task.game.scenario.max_cycles, task.action_size))
    scores = measure(task, OpenLoop(actions), 0, (1, 2), SEARCHED)[0]
    return bool(np.ptp(scores) == 0)


def _shared(noise: Noise, many: int) -> Noise:
    """The same luck for many attacks: (..., G) as (..., K, G)."""
    return Noise(*(None if part is None else namespace(part).stack([part] * many, axis=-2) for part in noise))
