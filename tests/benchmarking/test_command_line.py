"""The command that reproduces a run, compared with the suite that the command line makes of it."""

import shlex
from pathlib import Path

import pytest
from small_suites import small

from roletrust_env.benchmarking.known_attacks import KnownAttack
from roletrust_env.benchmarking.suite import with_known
from roletrust_env.benchmarking.suite_files import load_suite, reproduction_command
from roletrust_experiments.commands.benchmark import _asked

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
def test_a_suite_of_the_project_is_given_by_its_name(suite, fields):
    played = load_suite(suite).model_copy(update=fields)
    words = shlex.split(reproduction_command(played, FILE))
    assert words[:2] == ["roletrust", "benchmark"]
    options = {}
    for option, value in zip(words[2::2], words[3::2], strict=True):
        options.setdefault(option, []).append(value)
    assert options.pop("--suite") == [suite]
    assert options.pop("--out") == ["results/my run"]
    assert {key: tuple(names) for key, names in options.items()} == {
        f"--{key[:-1]}": fields[key] for key in fields
    }


def test_known_attacks_are_a_file():
    known = [KnownAttack(name="mine", scenario="drawn-1", track="raters", share=0.3, record="{}")]
    command = reproduction_command(with_known(load_suite("standard"), known), FILE)
    assert (
        command == "roletrust benchmark --suite standard --known known.json --out 'results/my run'"
    )


def test_the_stored_suite_gives_the_command():
    """The stored suite has names in place of `all`."""
    stored = _asked(load_suite("quick"), None, None, None, allow_code=False)
    assert (list(stored.models), list(stored.attacks)) == (stored.model_names, stored.attack_names)
    assert (
        reproduction_command(stored, FILE)
        == "roletrust benchmark --suite quick --out 'results/my run'"
    )


def test_another_suite_is_given_by_its_file():
    assert "--suite small.toml " in reproduction_command(small(name="small"), FILE)
    assert "--suite quick.toml " in reproduction_command(
        load_suite("quick").model_copy(update={"games": 2}), FILE
    )
    for name in ("quick, worlds 3", "quick, worlds of mine"):
        assert "--suite quick.toml " in reproduction_command(small(name=name), FILE)
