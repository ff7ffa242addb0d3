"""The command by which a run was played, against the suites that the command line would make of it."""

import shlex
from pathlib import Path

import pytest
from roletrust_experiments.commands.benchmark import _asked
from small_suites import small

from roletrust_env.benchmark.cells import attacks, models
from roletrust_env.benchmark.command_line import command
from roletrust_env.benchmark.suite import load_suite

FILE = Path("results/my run/results.sqlite")


@pytest.mark.parametrize(
    ("suite", "fields"),
    [
        ("quick", {}),
        ("quick", {"models": ("mean", "trimmed-mean:share=0.3")}),
        ("quick", {"models": ("mean",), "attacks": ("on-off", "sybil")}),
        ("learners-quick", {}),
        ("learners", {"learners": ("PPO", "my.own:Learner")}),
    ],
)
def test_a_suite_of_the_project_is_played_by_its_name(suite, fields):
    played = load_suite(suite).model_copy(update=fields)
    words = shlex.split(command(played, FILE))
    assert words[:2] == ["roletrust", "benchmark"]
    given = {}
    for option, value in zip(words[2::2], words[3::2], strict=True):
        given.setdefault(option, []).append(value)
    assert given.pop("--suite") == [suite]
    assert given.pop("--out") == ["results/my run"]
    assert {key: tuple(names) for key, names in given.items()} == {f"--{key[:-1]}": fields[key] for key in fields}


def test_what_the_command_keeps_gives_it_back():
    """`all` is kept as the names that it stood for."""
    asked = _asked(load_suite("quick"), None, None, None, allow_code=False)
    assert (list(asked.models), list(asked.attacks)) == (models(asked), attacks(asked))
    assert command(asked, FILE) == "roletrust benchmark --suite quick --out 'results/my run'"


def test_another_suite_is_played_by_its_file():
    assert "--suite small.toml " in command(small(name="small"), FILE)
    assert "--suite quick.toml " in command(load_suite("quick").model_copy(update={"games": 2}), FILE)
