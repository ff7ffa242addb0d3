"""What is written behind `--attack`, `--model` and `--set`."""

import sys

import pytest
from refusals import assert_names, refuses
from typer.testing import CliRunner

from roletrust_env import make_scenario
from roletrust_env.evaluation.scripts import Scripts
from roletrust_env.evaluation.specs import (
    check_installed,
    parse_attacks,
    parse_kinds,
    parse_settings,
    parse_trust_model,
    parse_value,
)
from roletrust_env.game.make_task import make_task
from roletrust_env.game.policy import registry as attackers
from roletrust_experiments.cli import app

PAPER = make_scenario("paper-3x3")


def test_values():
    assert parse_value("[0, [1]]") == (0, (1,))
    assert parse_value("true") is True
    assert parse_value("random") == "random"
    assert parse_value("[" * 50_000) == "[" * 50_000
    assert parse_value("1\nother = 2") == "1\nother = 2"
    assert parse_settings(['access={kind = "choice", providers = 2}'])["access"]["providers"] == 2


def test_commas_inside_values_do_not_split():
    policy = parse_attacks(
        ["sr_0=bad-mouthing:targets=[0,1],lie=relative"], make_scenario("paper-3x3")
    )["sr_0"]
    assert (policy.targets, policy.lie) == ((0, 1), "relative")


@pytest.mark.parametrize("targets", ["[1,sp_2]", '["sp_1","sp_2"]', "[ sp_1, sp_2 ]", "[1,2]"])
def test_targets_by_name(targets):
    policy = parse_attacks([f"sr_0=bad-mouthing:targets={targets}"], make_scenario("paper-3x3"))[
        "sr_0"
    ]
    assert policy.targets == (1, 2)
    one = parse_attacks(["srsp_0=bad-mouthing:targets=srsp_3"], make_scenario("peers"))["srsp_0"]
    assert one.targets == (3,)
    assert parse_attacks(["sr_0=bad-mouthing:targets=2"], PAPER)["sr_0"].targets == (2,)


def test_trust_model_takes_the_scenarios_lam_unless_told():
    scenario = make_scenario("paper-3x3").change(lam=0.7)
    assert parse_trust_model("role-trust", scenario).lam == 0.7
    assert parse_trust_model("role-trust:lam=0.6", scenario).lam == 0.6


def test_an_attack_of_an_installed_package_is_searched_by_its_name(install):
    """It is one file and one line of the package's own; nothing here knows of it."""
    code = (
        "from dataclasses import dataclass\n"
        "from typing import Annotated, ClassVar\n"
        "from roletrust_env import Policy\n"
        "from roletrust_env.parameters import SearchRange\n"
        "@dataclass(frozen=True)\n"
        "class Shift(Policy):\n"
        "    by: Annotated[int, SearchRange(-3, 3)] = 0\n"
        "    attacks: ClassVar = frozenset({'ratings'})\n"
    )
    install("package_of_lies", "roletrust_env.attackers", code, "shift = package_of_lies:Shift")
    kinds = parse_kinds(["shift", "shift:by=2"], PAPER)
    space = Scripts.of(make_task(PAPER, ("sr_0",)), kinds)
    found = [
        space.decode([kind, x])["sr_0"].by
        for kind, x in ((0.0, 0.0), (0.0, 0.5), (0.0, 1.0), (1.0, 0.0))
    ]
    assert found == [-3, 0, 3, 2]


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """A module of the user's own, in the folder where we are; each of its parts makes a file when
    it is called."""
    (tmp_path / "mine_for_attacks.py").write_text(
        "from pathlib import Path\n"
        "def touch(**parameters): Path('called').touch()\n"
        "class Alien:\n"
        "    def __init__(self, **parameters): touch()\n"
        "class HalfAModel(Alien):\n"
        "    start = update = rater_trust = touch\n"
        "class NoModel(HalfAModel):\n"
        "    provider_trust = 0.5\n"
        "alien = object()\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield "mine_for_attacks"
    sys.modules.pop("mine_for_attacks", None)


@pytest.mark.parametrize("name", ["touch", "Alien", "HalfAModel", "NoModel", "alien"])
def test_nothing_is_called_before_it_is_known_what_it_is(tmp_path, mine, name):
    with refuses(ValueError, mine, name):
        parse_attacks([f"sr_1={mine}:{name}:level=0"], PAPER)
    with refuses(ValueError, "TrustModel", mine, name):
        parse_trust_model(f"{mine}:{name}", PAPER)
    assert not (tmp_path / "called").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["play", "--attack", "sr_1=os:system:command=touch called"],
        ["play", "--model", "mine_for_attacks:touch"],
    ],
)
def test_no_command_calls_what_it_should_not(tmp_path, mine, arguments):
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert_names(result.stderr, "class")
    assert not (tmp_path / "called").exists()


def test_what_a_class_made_is_looked_at(tmp_path, mine):
    with (tmp_path / f"{mine}.py").open("a") as file:
        file.write(
            "from roletrust_env.trust import Mean\nclass Cuckoo(Mean):\n    def __new__(cls, **_): "
            "return 7\n"
        )
    with refuses(ValueError, "Cuckoo", "7", "TrustModel"):
        parse_trust_model(f"{mine}:Cuckoo", PAPER)


def test_a_file_with_a_wrong_name_is_told_the_names_and_one_with_a_class_the_option():
    check_installed(attackers, ["bad-mouthing", "on-off:period=4"])
    for text in ("bad-mouthng", "bad-mouthng:level=0"):
        with refuses(ValueError, "bad-mouthng", "bad-mouthing"):
            check_installed(attackers, [text])
    for text in ("os:system", "os:system:command=ls"):
        with refuses(ValueError, "--allow-code"):
            check_installed(attackers, [text])
