"""The launch file for ROS 2, with stand-ins for the package `launch`."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
import typer

from roletrust_experiments.cli import app

LIVE = Path(__file__).parents[3] / "experiments" / "roletrust_manager" / "dds"


@pytest.fixture
def launch(monkeypatch):
    """Return a function that gives the commands of the launch for some parameters."""
    package, actions, substitutions = (
        ModuleType("launch"),
        ModuleType("actions"),
        ModuleType("substitutions"),
    )
    package.LaunchDescription = list
    actions.DeclareLaunchArgument = lambda name, default_value, description: (
        name,
        default_value,
        description,
    )
    actions.OpaqueFunction = lambda function: function
    actions.ExecuteProcess = lambda cmd, name, output: cmd
    substitutions.LaunchConfiguration = lambda name: SimpleNamespace(
        perform=lambda context: context[name]
    )
    for name, module in (
        ("launch", package),
        ("launch.actions", actions),
        ("launch.substitutions", substitutions),
    ):
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location(
        "team", LIVE / "roletrust_nodes" / "launch" / "team.launch.py"
    )
    team = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(team)
    *declared, run = team.generate_launch_description()
    return lambda **given: run({name: value for name, value, _ in declared} | given)


def parse(command):
    """Parse a command of `roletrust` without running it."""
    assert command[:2] == ["roletrust", "robots"]
    group = typer.main.get_command(app).commands["robots"].loaded
    single = group.commands[command[2]]
    single.make_context(command[2], command[3:])


def test_the_nodes_of_the_paper_start_by_default(launch):
    commands = launch()
    assert [command[2:4] for command in commands] == [
        ["manager", "team.journal"],
        *(["agent", f"sp_{k}"] for k in range(3)),
        *(["agent", f"sr_{k}"] for k in range(3)),
    ]
    for command in commands:
        parse(command)


def test_parameters_reach_the_nodes(launch):
    commands = launch(
        keys="keys",
        journal="",
        cameras="",
        raters="sr_0",
        model="travos",
        speed="2.0",
        network="true",
    )
    shared = ["--set=scenario=paper-3x3", "--set=speed=2.0", "--set=network=true", "--keys", "keys"]
    assert commands == [["roletrust", "robots", "agent", "sr_0", "--role", "rater", *shared]]
    parse(commands[0])
