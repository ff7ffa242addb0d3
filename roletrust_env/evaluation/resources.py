"""Memory and time of a run, estimated before it starts; `roletrust_env.memory` knows what is
free.
"""

import platform
import re
import tracemalloc
from collections.abc import Callable, Iterator
from itertools import islice
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.game.game import Game
from roletrust_env.memory import kernel_file, two_digits

_ROUNDS, _CELLS = 2, 200_000  # of a trial: rounds, and pairs of agents


class Cost(NamedTuple):
    """The cost of one more game.

    Attributes:
        memory: Peak memory in a round, in bytes.
        seconds: Duration of a round, in seconds.
    """

    memory: float
    seconds: float


def trial_size(game: Game) -> int:
    """Return a number of games for a trial: large enough that what grows with it prevails, small
    enough to be quick.
    """
    return 2 if game.scenario.service == "hog" else max(2, _CELLS // pairs(game))


def pairs(game: Game) -> int:
    """Return how many pairs of agents a game may keep numbers for: each rater with all providers,
    or all raters.
    """
    return game.roster.n_raters * max(game.roster.n_raters, game.roster.n_providers)


def try_out(rounds: Callable[[int], Iterator[object]], many: int) -> Cost:
    """Return the cost of a game in a large batch: the difference between some games and half as
    many, in two rounds.

    Args:
        rounds: Function from a number of games to their rounds.
        many: Number of games, see `trial_size`.
    """
    _trace(rounds, 1)  # what is loaded and made but once
    (few_memory, few_seconds), (memory, seconds) = (
        _trace(rounds, games) for games in (many // 2, many)
    )
    more = many - many // 2
    return Cost(
        max(0.0, memory - few_memory) / more, max(0.0, seconds - few_seconds) / more / _ROUNDS
    )


def processor() -> str:
    """Return the name of the processor, and those of its instructions that NumPy found.

    Another processor may round the same sums differently, and so may the same one where a virtual
    machine hides some of its instructions.
    """
    match = re.search(r"^model name\s*:\s*(.+)$", kernel_file("/proc/cpuinfo"), re.MULTILINE)
    name = match[1] if match else platform.processor() or platform.machine()
    build: dict[str, Any] = np.show_config(mode="dicts")  # type: ignore[assignment]  # None in the other modes
    return " ".join([name, *build.get("SIMD Extensions", {}).get("found", [])])


def in_time(seconds: float) -> str:
    """Return a time for people.

    Example:
        >>> in_time(90), in_time(8000), in_time(3e7)
        ('90 seconds', '2.2 hours', '350 days')
    """
    units = (("days", 86_400), ("hours", 3600), ("minutes", 60))
    unit, of = next(((unit, of) for unit, of in units if seconds >= 2 * of), ("seconds", 1))
    return f"{two_digits(seconds / of)} {unit}"


def _trace(rounds: Callable[[int], Iterator[object]], games: int) -> tuple[int, float]:
    """Return the peak memory and the duration of a trial."""
    tracemalloc.start()
    try:
        began = perf_counter()
        for _ in islice(rounds(games), _ROUNDS):
            pass
        return tracemalloc.get_traced_memory()[1], perf_counter() - began
    finally:
        tracemalloc.stop()
