"""What the commands on attack tasks are told alike: the task, and the options that change it."""

from typing import Annotated

import typer

from roletrust_env.envs.tasks import TASKS

ScenarioOption = Annotated[str | None, typer.Option(help="Another scenario than the task's: a name or a file.")]
SettingsOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="FIELD=VALUE", help="Change a field of the scenario; repeat for more."),
]
TrustModelOption = Annotated[
    str, typer.Option(metavar="NAME[:key=value,...]", help="Trust model, with parameters of its own.")
]
StealthWeight = Annotated[float, typer.Option(min=0, help="Price of a trust gap that shows.")]
StealthTolerance = Annotated[float, typer.Option(min=0, max=1, help="Trust gap that costs nothing.")]


def find_task(text: str) -> str:
    """The id of a task, of which the middle will do.

    Raises:
        ValueError: there is no such task.
    """
    short = {task_id.removeprefix("RoleTrust/").removesuffix("-v0"): task_id for task_id in TASKS}
    wanted = text.lower().removeprefix("roletrust/").removesuffix("-v0").replace("-", "")
    for name, task_id in short.items():
        if wanted == name.lower():
            return task_id
    raise ValueError(f"unknown task {text!r}; known: {', '.join(short)}")
