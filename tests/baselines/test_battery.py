"""What holds for every attack that has a name; those with several identities have tests of their
own."""

import json
import warnings

import numpy as np
import pytest
from typer.testing import CliRunner

from roletrust_env import Game, JointPolicy, Policy, attackers, make_attacker, record
from roletrust_env.evaluation.scripts import Space
from roletrust_env.game.policy import policy_name, registry
from roletrust_env.testing import check_attack
from roletrust_env.world.scenario import AgentGroup, Choice, Scenario
from roletrust_experiments.cli import app

SMALL = Scenario(
    agents=(
        AgentGroup(role="SR", count=3, noise=0.1),
        AgentGroup(role="SP", count=3),
        AgentGroup(role="SR+SP", count=2, noise=0.1),
    ),
    values=(1.0, 5.0),
    access=Choice(providers=3, temperature=0.2),
    max_cycles=25,
)
RATERS = ("sr_0", "srsp_1")
PROVIDERS = ("sp_0", "srsp_1")
SEATS = {"ratings": RATERS, "silence": RATERS, "quality": PROVIDERS, "treatment": PROVIDERS}
NAMES = [
    name
    for name in attackers()
    if name != "learned" and "presence" not in registry.factory(name).attacks
]


def seated(policy):
    return {agent: policy for channel in policy.attacks for agent in SEATS[channel]}


def space(name):
    return Space(registry.factory(name), (1, 2, 3), (0, 4), SMALL.max_cycles)


def played(policy, like, batch):
    game = Game(SMALL, "role-trust", like)
    history = record(JointPolicy(game, seated(policy)), game.random(seed=3), batch)
    return [np.asarray(part) for part in (history.quality, history.ratings, history.top)]


def made(name):
    """An attack with its usual parameters, but that sleepers wake early enough to be seen."""
    facts = {"length": SMALL.max_cycles, "accomplices": (0, 4)}
    early = {"start": 3, "wakes_at": 0.5} if name.startswith("camouflage") else {}
    return make_attacker(name, **registry.accepted_parameters(name, {**facts, **early}))


@pytest.mark.parametrize("name", NAMES)
def test_its_class_is_called_as_it_is(name):
    assert policy_name(space(name).default) == name


@pytest.mark.parametrize("name", NAMES)
def test_it_keeps_to_the_contract_of_attacks(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_attack(made(name))


@pytest.mark.parametrize("name", NAMES)
def test_it_does_something(name):
    attacked, honest = (played(policy, np.zeros(()), (4,)) for policy in (made(name), Policy()))
    assert any(
        np.abs(ours - theirs).max() > 0.01 for ours, theirs in zip(attacked, honest, strict=True)
    )


@pytest.mark.parametrize("name", NAMES)
def test_searches_take_what_it_declares(name):
    searched = space(name)
    corners = [searched.decode([x] * searched.size) for x in (0.0, 0.5, 1.0)]
    for policy in corners:
        assert policy.attacks == searched.channels
    for policy in corners:
        for part in played(policy, np.zeros(()), (2,)):
            assert ((part >= 0) & (part <= 1)).all()


@pytest.mark.parametrize("name", ["conflicting", "bad-mouthing", "cheating-ring"])
def test_it_plays_from_the_command_line(tmp_path, name):
    seats = sorted(
        {"sp_2" if SEATS[channel] is PROVIDERS else "sr_2" for channel in space(name).channels}
    )
    options = [part for agent in seats for part in ("--attack", f"{agent}={name}")]
    arguments = ["play", "paper-3x3", "--set", "max_cycles=12", *options, "--out", str(tmp_path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "results.json").read_text())["attackers"]
    assert list(found) == seats
    assert found[seats[0]]["class"].endswith(registry.factory(name).__name__)
    parameters = found[seats[0]]["parameters"]
    assert parameters.get("length", 12) == 12
    if "sp_2" in seats:
        assert parameters.get("accomplices", [2]) == [2]
