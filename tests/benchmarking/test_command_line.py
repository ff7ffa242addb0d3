"""The command that reproduces a run, compared with the suite that the command line makes of it."""

import shlex
from itertools import pairwise
from pathlib import Path

import pytest
from small_suites import small

from roletrust_env.benchmarking.run import selected_suite
from roletrust_env.benchmarking.suite import with_search
from roletrust_env.benchmarking.suite_files import load_suite, reproduction_command

FILE = Path("results/my run/results.sqlite")


@pytest.mark.parametrize("search", [False, True])
def test_a_suite_of_the_project_is_given_by_its_name(search):
    quick = load_suite("quick", 3)
    played = selected_suite(with_search(quick) if search else quick, ["mean", "median"])
    words = shlex.split(reproduction_command(played, FILE))
    expected = ["mean", "median", "--suite", "quick", "--seed", "3", *["--search"] * search]
    assert words == ["roletrust", "benchmark", *expected, "--out", "results/my run"]


def test_attacks_that_replace_those_of_a_suite_are_options():
    played = selected_suite(load_suite("quick"), ["mean"], ["on-off", "rank-lies"])
    words = shlex.split(reproduction_command(played, FILE))
    given = [word for option, word in pairwise(words) if option == "--attack"]
    assert given == ["on-off", "rank-lies"]


def test_learners_are_options():
    suite = load_suite("learners").model_copy(update={"learners": ("PPO", "my.own:Learner")})
    words = shlex.split(reproduction_command(suite, FILE))
    assert words[2:6] == ["PPO", "my.own:Learner", "--suite", "learners"]


def test_another_suite_is_given_by_its_file():
    assert "--suite small.toml " in reproduction_command(small(), FILE)
