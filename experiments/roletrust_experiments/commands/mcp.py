"""`roletrust mcp`: the tools of an agent for a trust manager, by the Model Context Protocol."""

from pathlib import Path
from typing import Annotated

import typer

from roletrust_experiments.commands.extras import require


def mcp(
    url: Annotated[
        str, typer.Argument(help="Address of the trust manager, such as http://127.0.0.1:8000.")
    ],
    name: Annotated[str, typer.Option(help="Name of the agent.")],
    keys: Annotated[
        Path, typer.Option(help="Folder with the agent's key, NAME.key; made if there is none.")
    ],
    patience: Annotated[
        float,
        typer.Option(
            min=0.1, max=50, help="Time for an answer of the manager, with all tries, seconds."
        ),
    ] = 15.0,
) -> None:
    """Give an agent [bold]tools to ask whom to trust[/], and to rate others afterwards.

    The tools are register, ask, rate, list_agents and leave, by the Model Context Protocol (MCP) on
    standard input and output: an agent of any framework starts this command, and calls them.
    Ratings are signed with the agent's key, which no language model sees. `roletrust serve MODEL
    --store FILE` is the manager.

    [bold]Examples[/]

    [cyan]roletrust mcp http://127.0.0.1:8000 --name ann --keys keys[/]
    """
    require("roletrust mcp", "manager", "cryptography", "httpx2", "jwt", "mcp")
    from roletrust_manager.http.client import TrustClient
    from roletrust_manager.http.tools import make_tools

    with TrustClient(url, name, keys, patience_s=patience) as client:
        make_tools(client).run()
