"""The command line as pages, from the help texts."""

import inspect
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import typer
from rich.text import Text
from typer.core import TyperArgument

from roletrust_experiments.cli import app
from roletrust_experiments.commands.group import EXAMPLES

FUNCTIONS = {
    "play": "roletrust_env.evaluation.games.play",
    "train": "roletrust_agents.training.train.train",
    "benchmark": "roletrust_env.benchmarking.run.benchmark",
    "report": "roletrust_experiments.report.files.report",
    "replay": "roletrust_env.benchmarking.replay.replay",
    "entry pack": "roletrust_env.benchmarking.entries.pack_entry",
    "entry check": "roletrust_env.benchmarking.entry_check.check_entry",
    "rate": "roletrust_env.logs.rate.rate",
    "compare": "roletrust_env.logs.compare.compare",
    "audit": "roletrust_env.logs.audit.audit",
    "manager serve": "roletrust_manager.http.serve.serve",
    "manager backup": "roletrust_manager.journal.backup.back_up",
    "manager check": "roletrust_manager.http.store_check.check_store",
    "figures": "roletrust_experiments.paper.figures.figures",
    "robots demo": "roletrust_manager.robots.demo.run_demo",
    "robots agent": "roletrust_manager.robots.agent.run_agent",
    "robots manager": "roletrust_manager.robots.manager.run_manager",
    "robots view": "roletrust_manager.robots.view.run_view",
}
"""The function that each command calls."""

_MARKS = {"bold": "**", "green": "`", "cyan": "`"}


class Given(NamedTuple):
    """An argument or an option of a command: its spelling and its description in Markdown."""

    name: str
    what: str


class Command(NamedTuple):
    """A command.

    Attributes:
        words: Words that call it, such as `("roletrust", "robots", "demo")`.
        usage: Arguments and options that may follow these words.
        about: Paragraphs of its description in Markdown.
        examples: Example calls, with a comment before each.
        arguments: Positional arguments.
        options: Options.
        commands: Subcommands, in the order of its help.
        function: Function that it calls; empty for a group.
    """

    words: tuple[str, ...]
    usage: str
    about: list[str]
    examples: str
    arguments: list[Given]
    options: list[Given]
    commands: "list[Command]"
    function: str


def roletrust() -> Command:
    """Return the whole command line."""
    return _read(typer.main.get_command(app), ("roletrust",))


def everything(command: Command) -> Iterator[Command]:
    """Yield a command and all its subcommands."""
    yield command
    for one in command.commands:
        yield from everything(one)


def _read(command: Any, words: tuple[str, ...]) -> Command:
    context = command.context_class(command, info_name=words[-1])
    before, _, after = inspect.cleandoc(command.help or "").partition(EXAMPLES)
    given: dict[bool, list[Given]] = {True: [], False: []}
    for parameter in command.params:
        name, what = parameter.get_help_record(context)
        given[isinstance(parameter, TyperArgument)].append(
            Given(name, _escaped(what.replace("\\[", "[")))
        )
    return Command(
        words,
        " ".join(command.collect_usage_pieces(context)),
        [markdown(block) for block in before.split("\n\n") if block.strip()],
        "\n\n".join(_typed(block) for block in after.split("\n\n") if block.strip()),
        given[True],
        given[False],
        [
            _read(one.loaded, (*words, name))
            for name, one in getattr(command, "commands", {}).items()
        ],
        FUNCTIONS.get(" ".join(words[1:]), ""),
    )


def markdown(markup: str) -> str:
    r"""Return a text with the markup of rich as Markdown.

    Example:
        >>> markdown("Draw [bold]every model[/] into [green]models.png[/] \\[0, 1].")
        'Draw **every model** into `models.png` \\[0, 1].'
    """
    text = Text.from_markup(markup.strip())
    parts, at = [], 0
    for span in sorted(text.spans):
        mark = _MARKS[str(span.style)]
        inside = text.plain[span.start : span.end]
        parts += [
            _escaped(text.plain[at : span.start]),
            mark,
            inside if mark == "`" else _escaped(inside),
            mark,
        ]
        at = span.end
    return "".join([*parts, _escaped(text.plain[at:])])


def _typed(markup: str) -> str:
    """Return examples as typed; a backslash ends a line that goes on."""
    text = Text.from_markup(markup.strip())
    return "\n".join(
        text.plain[span.start : span.end].replace("\n", " \\\n  ") for span in sorted(text.spans)
    )


def _escaped(text: str) -> str:
    """Escape a plain text for Markdown, except between backticks."""
    pieces = re.split(r"(`[^`]*`)", text)
    return "".join(
        piece if k % 2 else re.sub(r"([\\*_<\[|$])", r"\\\1", piece)
        for k, piece in enumerate(pieces)
    )
