"""Search methods: ways to find an attack, under one protocol and one budget.

A search method gets the arguments of a task, a budget and a seed, and returns an attacker. The
budget counts game rounds: rounds times games that it plays, with or without gradients. `find` then
measures the attacker in held-out games, the same ones for every method; these are not counted.
"""

from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple, Protocol, runtime_checkable

from roletrust_env.arrays import Array
from roletrust_env.evaluation.attackers import Attacker, Scripted
from roletrust_env.evaluation.measurement import HELD_OUT, TaskArguments, exact_task, mean_rewards
from roletrust_env.parameters import whole_number
from roletrust_env.registry import Registry


class UnsuitableError(ValueError):
    """A search method does not apply to a task; the message says why."""


class Budget:
    """A number of game rounds that a search may play.

    Args:
        rounds: Size of the budget, rounds times games.

    Raises:
        ValueError: The size is no whole number, 0 or more.

    Attributes:
        rounds: Size of the budget.
        spent: Rounds that are spent.
    """

    def __init__(self, rounds: int) -> None:
        self.rounds = whole_number("the budget", rounds)
        self.spent = 0

    @property
    def left(self) -> int:
        """Rounds that are left; below 0 where a method spent more than it had."""
        return self.rounds - self.spent

    def spend(self, rounds: int) -> None:
        """Count rounds as spent."""
        self.spent += rounds


Progress = tuple[tuple[int, float], ...]
"""Course of a search: the rounds that it had played, and the best mean reward per round that it
knew of then."""


class SearchResult(NamedTuple):
    """The result of a search.

    Attributes:
        attacker: Attacker that was found.
        rounds: Game rounds that were spent; those of its training for an attacker that was trained
            before.
        description: The attack in a few words.
        seconds: Duration of a search that ran earlier; None for one that ran just now.
        bound: Mean reward per round that no attack exceeds; None if none is known.
        progress: Course of the search; empty if the method does not say.
    """

    attacker: Attacker
    rounds: int
    description: str
    seconds: float | None = None
    bound: float | None = None
    progress: Progress = ()


@runtime_checkable
class SearchMethod(Protocol):
    """A way to find an attack.

    A class may say what it needs in further attributes: `knowledge` of the game, `"black_box"`
    unless it says more; `known_start`, whether it starts from known attackers; and `objectives`,
    the only ones that it is for.
    """

    @property
    def name(self) -> str:
        """Name in tables."""

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """Search for a good attack.

        Args:
            arguments: Arguments of the task.
            budget: Game rounds that may be played.
            seed: Random seed; the same seed finds the same attack.

        Raises:
            UnsuitableError: The method does not apply to this task, or the budget is too small for
                it.
        """


search_methods: Registry[SearchMethod] = Registry(
    "search method", "roletrust_env.search_methods", SearchMethod
)


register_search_method = search_methods.register
"""Register the class of a search method under a name, see `Registry.register`."""


bounds: Registry[SearchMethod] = Registry("bound", "roletrust_env.bounds", SearchMethod)
"""Methods that know the best attack of some tasks, or a reward that no attack exceeds. They have no
budget, and their `SearchResult.bound` has share 1 in a benchmark of learners."""


@dataclass(frozen=True)
class HonestPlay:
    """No attack: the compromised agents play honestly.

    Attributes:
        name: Name in tables.
    """

    name: str = "honest play"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        return SearchResult(Scripted({}), 0, "serves its best, reports what it perceives")


@dataclass(frozen=True, eq=False)
class MeasuredSearch:
    """The result of a search, and its rewards in held-out games.

    Attributes:
        name: Name of the search method.
        attacker: Attacker that was found.
        description: The attack in a few words.
        scores: Mean reward per round in each held-out game, shape (G,); a game brings 0 after its
            end.
        objective: Mean objective per round, shape (G,).
        cost: Mean unweighted cost of stealth per round, shape (G,).
        rounds: Game rounds that the search played.
        seconds: Wall-clock duration of the search, without the measurement.
        bound: Mean reward per round that no attack exceeds; None if none is known.
    """

    name: str
    attacker: Attacker
    description: str
    scores: Array
    objective: Array
    cost: Array
    rounds: int
    seconds: float
    bound: float | None


def find(
    method: SearchMethod, arguments: TaskArguments, *, budget: Budget | int, seed: int, games: int
) -> MeasuredSearch:
    """Search for an attack, then measure it in the true game, in double precision, in held-out
    games.

    Args:
        method: Search method.
        arguments: Arguments of the task.
        budget: Game rounds that the search may play.
        seed: Random seed. Methods with the same seed are measured in the same games.
        games: Number of held-out games.

    Raises:
        UnsuitableError: The method does not apply to this task, or the budget is too small for it.
    """
    began = perf_counter()
    result = method.search(
        arguments, budget if isinstance(budget, Budget) else Budget(budget), seed
    )
    seconds = perf_counter() - began if result.seconds is None else result.seconds
    scores, objective, cost = (
        part[0]
        for part in mean_rewards(exact_task(arguments), result.attacker, seed, (1, games), HELD_OUT)
    )
    return MeasuredSearch(
        method.name,
        result.attacker,
        result.description,
        scores,
        objective,
        cost,
        result.rounds,
        seconds,
        result.bound,
    )
