"""Options that several commands share, each with one spelling and one help text."""

from pathlib import Path
from typing import Annotated, Any

import typer

from roletrust_env.errors import suggest
from roletrust_experiments.commands import completion

NAMED = "NAME[:key=value,...]"
SEATED = "AGENT=NAME[:key=value,...]"
OWN = "NAME may be your own class, package.module:Class, whose module is then imported."

ScenarioOption = Annotated[
    str | None,
    typer.Option(
        help="Scenario to play instead of the task's own: a name, or the path of a .toml or .yaml file.",
        autocompletion=completion.scenario_names,
        show_default=False,
    ),
]
SettingsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="FIELD=VALUE", help="Field of the scenario to change; repeat for more.", show_default=False
    ),
]
SeatedAttacks = Annotated[
    list[str] | None,
    typer.Option(
        metavar=SEATED,
        help="Attack by an agent; repeat for more. AGENT may be a pattern such as 'sr_*'. Times are in rounds. " + OWN,
        autocompletion=completion.seated_attacks,
        show_default=False,
    ),
]
Compromised = Annotated[
    list[str] | None,
    typer.Option(
        metavar="AGENT", help="Agent that the attacker controls; repeat for more; the task's own if left out.",
        show_default=False,
    ),
]  # fmt: skip
StealthWeight = Annotated[float, typer.Option(min=0, help="Price of a trust gap that gives the attacker away.")]
StealthTolerance = Annotated[float, typer.Option(min=0, max=1, help="Trust gap that costs nothing.")]
Seed = Annotated[int, typer.Option(min=0, help="Random seed; the same seed gives the same results.")]
Workers = Annotated[
    int | None,
    typer.Option(min=1, help="Number of processes; by default one for each core.", show_default=False),
]
Out = Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results; it is created if it is missing.")]
SeededRuns = Annotated[
    int,
    typer.Option("--runs", min=1, help="Number of runs, with this seed and the seeds after it, in folders seed-..."),
]


def find_task(text: str) -> str:
    """Return the id of a task, from its id or its short name in any case.

    Raises:
        ValueError: There is no such task.
    """
    short = completion.task_names()
    wanted = text.lower().removeprefix("roletrust/").removesuffix("-v0").replace("-", "")
    for name, task_id in short.items():
        if wanted == name.lower():
            return task_id
    raise ValueError(f"unknown task {text!r}{suggest(text, short)}")


def check_choice(option: str, value: str, known: tuple[str, ...]) -> Any:
    """Return a value that must be one of several names.

    Raises:
        ValueError: It is another one; the message suggests the nearest.
    """
    if value not in known:
        raise ValueError(f"unknown {option} {value!r}{suggest(value, known)}")
    return value
