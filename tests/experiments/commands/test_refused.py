"""Agents and seats that are not allowed: one line, from a command as from Python, before anything
is written."""

from pathlib import Path
from typing import Any

import pytest
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
    ("agent", "attack", "parameters", "message"),
    [
        (
            "sp_0",
            "bad-mouthing",
            {},
            "'sp_0' cannot play bad-mouthing: that attacks by ratings, .* only .* on presence and "
            "quality",
        ),
        (
            "sr_0",
            "on-off",
            {},
            "'sr_0' cannot play on-off: that attacks by quality, .* only decides on ratings",
        ),
        (
            "sp_1",
            "whitewashing",
            {"reserve": 3},
            "'sp_1' .* whitewashing: that needs a reserve of 3, .* has 1 here",
        ),
        (
            "sr_0",
            "sybil",
            {},
            "'sr_0' cannot play sybil: that needs a reserve of 1, and the agent has 0 here; .* by "
            "reserve = 1",
        ),
        (
            "sp_2",
            "on-off",
            {},
            "'sp_2' is an identity in reserve of 'sp_0'; name the policy of that",
        ),
        (
            "sp_7",
            "on-off",
            {},
            "there is no agent 'sp_7'; the scenario has sr_0, sp_0, sp_1, sp_2, sp_3",
        ),
    ],
)
def test_a_seat_without_the_channel_or_the_reserve(
    tmp_path: Path, agent: str, attack: str, parameters: dict[str, Any], message: str
) -> None:
    given = ",".join(f"{name}={value}" for name, value in parameters.items())
    seat = f"{agent}={attack}:{given}"
    line = told("play", "--set", agents(",reserve=1"), "--attack", seat, out=tmp_path)
    groups = [{"role": "SP", "count": 2, "reserve": 1}, {"role": "SR"}]
    game = Game(make_scenario("paper-3x3").change(agents=groups))
    with pytest.raises(ValueError, match=message) as error:
        JointPolicy(game, {agent: make_attacker(attack, **parameters)})
    assert str(error.value) == line


_SHARE = r"it must be a number in \[0, 1\], or a range \(low, high\) of two such numbers"
_BIAS = _SHARE.replace(r"\[0,", r"\[-1,")


@pytest.mark.parametrize(
    ("text", "value", "message"),
    [
        ("SP: ability = 1.5", 1.5, rf"agents.0.ability is 1.5: {_SHARE}"),
        ("SP: ability = nan", float("nan"), rf"agents.0.ability is nan: {_SHARE}"),
        ("SP: ability = [0.8, 0.2]", (0.8, 0.2), rf"agents.0.ability is \[0.8, 0.2\]: {_SHARE}"),
        ("SP: ability = 'big'", "big", rf"agents.0.ability is 'big': {_SHARE}"),
        ("SR: bias = 2", 2, rf"agents.1.bias is 2: {_BIAS}"),
        ("SR: bias = [-2, 0]", (-2, 0), rf"agents.1.bias is \[-2, 0\]: {_BIAS}"),
        ("SR: scale = -1", -1, r"agents.1.scale is -1: it must be a number in \[0, 1e6\], .*"),
        (
            "SR: ability = 0.5",
            0.5,
            "agents.1: ability is 0.5; it is for agents that provide, not for the role 'SR'",
        ),
        (
            "SP: bias = 0.5",
            0.5,
            "agents.0: bias is 0.5 .* they are for raters, not for the role 'SP'",
        ),
        ("SP: reserve = -1", -1, "agents.0.reserve is -1: .* greater than or equal to 0"),
        ("SP: reserve = 1001", 1001, "agents.0.reserve is 1001: .* less than or equal to 1000"),
    ],
)
def test_what_an_agent_cannot_be(tmp_path: Path, text: str, value: Any, message: str) -> None:
    role, _, field = text.partition(": ")
    line = told("play", "--set", agents(**{role.lower(): f",{field}"}), out=tmp_path)
    groups = [{"role": "SP", "count": 2}, {"role": "SR"}]
    groups[role == "SR"][field.partition(" = ")[0]] = value
    with pytest.raises(ValueError, match=f"^scenario 'paper-3x3': {message}$") as error:
        make_scenario("paper-3x3").change(agents=groups)
    assert str(error.value) == line


@pytest.mark.parametrize(
    ("given", "what"),
    [
        (["play"], "--out"),
        (["rate", "ratings.csv"], "--out"),
        (["live", "scenario", "log.csv"], "--out"),
        (["rate", "ratings.csv", "--state", "?", "--out", "trust"], "--state"),
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
