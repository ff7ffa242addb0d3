"""The robustness benchmark: its suites and cells, and how cells are played, stored and ranked.

`benchmark` plays a suite and returns its leaderboard. `roletrust benchmark` does the same on the
command line.
"""

from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.learners.learner import Learner, register_learner
from roletrust_env.benchmarking.run import benchmark
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import load_suite, suites

__all__ = [
    "Leaderboard",
    "Learner",
    "Suite",
    "benchmark",
    "load_suite",
    "register_learner",
    "suites",
]
