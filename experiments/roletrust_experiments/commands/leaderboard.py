"""Results of a benchmark of trust models as the commands read them."""

from pathlib import Path

from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.benchmarking.suite import Suite


def read_board(results: Path) -> Leaderboard:
    """Return the leaderboard of a results file.

    Raises:
        ValueError: The file cannot be read, or is of a suite for learners.
    """
    with ResultStore(results) as store:
        suite, stored = store.suite, store.all()
    if not isinstance(suite, Suite):
        raise ValueError(f"{results} is of a suite for {suite.kind}; give one for trust models")
    return Leaderboard.of(suite, stored)
