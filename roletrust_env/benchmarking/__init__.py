"""The robustness benchmark: its suites and cells, and how cells are played, stored and ranked.

`benchmark` and `benchmark_learners` play a suite and return its leaderboard, as `roletrust
benchmark` does on the command line.
"""

from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.learners.learner import Learner, register_learner
from roletrust_env.benchmarking.run import benchmark, benchmark_learners
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import load_suite, suites

__all__ = [
    "Leaderboard",
    "Learner",
    "Suite",
    "benchmark",
    "benchmark_learners",
    "load_suite",
    "register_learner",
    "suites",
]
