"""Agents and seats that are not allowed: one line, from a command as from Python, before anything
is written."""

from pathlib import Path
from typing import Any

import pytest
from refusals import refuses
from typer.testing import CliRunner

from roletrust_env import Game, JointPolicy, make_attacker, make_scenario
from roletrust_experiments.cli import app


def agents(sp: str = "", sr: str = "") -> str:
    return f'agents=[{{role="SP",count=2{sp}}},{{role="SR"{sr}}}]'


def told(*arguments: str, out: Path) -> str:
    """The one line that a command ends with when it refuses what it is told."""
    result = CliRunner().invoke(app, [*arguments, "--out", str(out / "results")])
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    assert not list(out.iterdir())
    (line,) = result.stderr.splitlines()
    return line.removeprefix("Error: ")


@pytest.mark.parametrize(
    ("agent", "attack", "parameters", "words"),
    [
        (
            "sp_0",
            "bad-mouthing",
            {},
            ("sp_0", "bad-mouthing"),
        ),
        (
            "sr_0",
            "on-off",
            {},
            ("sr_0", "on-off"),
        ),
        (
            "sp_1",
            "whitewashing",
            {"reserve": 3},
            ("sp_1", "whitewashing", "3", "1"),
        ),
        (
            "sr_0",
            "sybil",
            {},
            ("sr_0", "sybil", "1", "0"),
        ),
        (
            "sp_2",
            "on-off",
            {},
            ("sp_2", "sp_0"),
        ),
        (
            "sp_7",
            "on-off",
            {},
            ("sp_7", "sr_0", "sp_3"),
        ),
    ],
)
def test_a_seat_without_the_channel_or_the_reserve(
    tmp_path: Path, agent: str, attack: str, parameters: dict[str, Any], words: tuple[str, ...]
) -> None:
    given = ",".join(f"{name}={value}" for name, value in parameters.items())
    seat = f"{agent}={attack}:{given}"
    line = told("play", "--set", agents(",reserve=1"), "--attack", seat, out=tmp_path)
    groups = [{"role": "SP", "count": 2, "reserve": 1}, {"role": "SR"}]
    game = Game(make_scenario("paper-3x3").change(agents=groups))
    with refuses(ValueError, agent, *words) as error:
        JointPolicy(game, {agent: make_attacker(attack, **parameters)})
    assert str(error.value) == line


@pytest.mark.parametrize(
    ("text", "value", "words"),
    [
        ("SP: ability = 1.5", 1.5, ("agents.0.ability", "1.5", "[0, 1]")),
        ("SP: ability = nan", float("nan"), ("agents.0.ability", "nan", "[0, 1]")),
        ("SP: ability = [0.8, 0.2]", (0.8, 0.2), ("agents.0.ability", "[0.8, 0.2]")),
        ("SP: ability = 'big'", "big", ("agents.0.ability", "big")),
        ("SR: bias = 2", 2, ("agents.1.bias", "2", "[-1, 1]")),
        ("SR: bias = [-2, 0]", (-2, 0), ("agents.1.bias", "[-2, 0]")),
        ("SR: scale = -1", -1, ("agents.1.scale", "-1", "[0, 1e6]")),
        ("SR: ability = 0.5", 0.5, ("agents.1", "ability", "0.5", "SR")),
        ("SP: bias = 0.5", 0.5, ("agents.0", "bias", "0.5", "SP")),
        ("SP: reserve = -1", -1, ("agents.0.reserve", "-1")),
        ("SP: reserve = 1001", 1001, ("agents.0.reserve", "1001", "1000")),
    ],
)
def test_what_an_agent_cannot_be(
    tmp_path: Path, text: str, value: Any, words: tuple[str, ...]
) -> None:
    role, _, field = text.partition(": ")
    line = told("play", "--set", agents(**{role.lower(): f",{field}"}), out=tmp_path)
    groups = [{"role": "SP", "count": 2}, {"role": "SR"}]
    groups[role == "SR"][field.partition(" = ")[0]] = value
    with refuses(ValueError, "paper-3x3", *words) as error:
        make_scenario("paper-3x3").change(agents=groups)
    assert str(error.value) == line


@pytest.mark.parametrize(
    ("given", "what"),
    [
        (["play"], "--out"),
        (["rate", "ratings.csv"], "--out"),
        (["play", "--set", "max_cycles=12", "--set", "name=?", "--out", "played"], "--set"),
        (["report", "?", "--out", "page"], "the path of the results"),
    ],
)
def test_a_name_that_is_not_unicode(tmp_path: Path, given: list[str], what: str) -> None:
    given = [*given, "--out", "?"] if what == "--out" else given
    result = CliRunner().invoke(app, [one.replace("?", f"{tmp_path}/\udcff") for one in given])
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    assert result.stderr == f"Error: {what} has \\udcff, which is no character of Unicode\n"
    assert not list(tmp_path.iterdir())
