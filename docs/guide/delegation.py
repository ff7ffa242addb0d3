"""Agents without a language model that delegate by trust: `python docs/guide/delegation.py
http://127.0.0.1:8000`.

The consumer, ann, has the tools of `roletrust manager mcp`. Two workers, each a process of its own,
multiply; one of them is often wrong. Before each task ann asks how far each worker can be trusted.
It gives the task to one that nobody has rated, else to the most trusted, checks the product, and
rates the work.
"""

import argparse
import asyncio
import sys
from contextlib import AsyncExitStack
from pathlib import Path
from random import Random
from typing import Any

from mcp.client import Client
from mcp.client.stdio import StdioServerParameters
from mcp.server import MCPServer

from roletrust_manager.http.client import TrustClient

WORKERS = {"bob": 1.0, "eve": 0.3}
"""Probability that a worker is right, by its name."""


def work(url: str, keys: Path, name: str) -> None:
    """Register as a worker, and multiply for whoever starts this process."""
    with TrustClient(url, name, keys) as client:
        client.register()
    server, random = MCPServer(name, log_level="WARNING"), Random(name)

    def multiply(a: int, b: int) -> int:
        """Return the product of two numbers, or something near it."""
        return a * b + int(random.random() >= WORKERS[name])

    server.add_tool(multiply)
    server.run()


async def delegate(url: str, keys: Path, tasks: int, pause_s: float) -> list[str]:
    """Give tasks to workers, by trust, and return who got them."""
    own = StdioServerParameters(
        command="roletrust", args=["manager", "mcp", url, "--name", "ann", "--keys", str(keys)]
    )
    chosen: list[str] = []
    async with AsyncExitStack() as stack:
        trust, workers = await stack.enter_async_context(Client(own)), {}
        for name in WORKERS:
            command = [__file__, url, "--keys", str(keys), "--work", name]
            worker = StdioServerParameters(command=sys.executable, args=command)
            workers[name] = await stack.enter_async_context(Client(worker))
        await call(trust, "register")
        for task in range(tasks):
            answers = {name: (await call(trust, "ask", name=name))["provider"] for name in workers}
            best = max(
                answers, key=lambda name: (answers[name]["ratings"] == 0, answers[name]["trust"])
            )
            product = await call(workers[best], "multiply", a=task, b=7)
            await call(trust, "rate", name=best, rating=float(product["result"] == task * 7))
            chosen.append(best)
            await asyncio.sleep(pause_s)  # until the round has ended
        await call(trust, "list_agents")
    return chosen


async def call(client: Client, tool: str, **arguments: Any) -> dict[str, Any]:
    """Return the answer of a tool as data, and print what a language model would read.

    Raises:
        RuntimeError: The tool refuses.
    """
    result = await client.call_tool(tool, arguments)
    text = "\n".join(content.text for content in result.content)
    if result.is_error:
        raise RuntimeError(text)
    print(f"{tool}: {text}", flush=True)
    return result.structured_content


def main(arguments: list[str] | None = None) -> list[str]:
    """Run the command, and return who got the tasks."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("url", help="Address of the trust manager.")
    parser.add_argument(
        "--keys", type=Path, default=Path("keys"), help="Folder with the keys of the agents."
    )
    parser.add_argument("--tasks", type=int, default=8, help="Number of tasks.")
    parser.add_argument(
        "--pause",
        type=float,
        default=3.0,
        help="Time between tasks, seconds: two rounds and a bit.",
    )
    parser.add_argument("--work", metavar="NAME", choices=sorted(WORKERS), help="Be this worker.")
    given = parser.parse_args(arguments)
    try:
        with TrustClient(given.url, patience_s=3) as reader:
            reader.about()
        if given.work:
            work(given.url, given.keys, given.work)
            return []
        return asyncio.run(delegate(given.url, given.keys, given.tasks, given.pause))
    except (OSError, ValueError, RuntimeError, ExceptionGroup) as error:
        while isinstance(error, ExceptionGroup):  # of the connections to the processes
            error = error.exceptions[0]
        sys.exit(str(error))


if __name__ == "__main__":
    main()
