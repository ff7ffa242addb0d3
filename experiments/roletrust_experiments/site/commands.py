"""The command line as pages, from what it says itself under `--help`."""

import inspect
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import typer
from rich.text import Text
from typer.core import TyperArgument

from roletrust_experiments.cli import app

_EXAMPLES = "[bold]Examples[/]"
_MARKS = {"bold": "**", "green": "`", "cyan": "`"}


class Given(NamedTuple):
    """An argument or an option of a command: how it is written, and what it is for, in Markdown."""

    name: str
    what: str


class Command(NamedTuple):
    """A command.

    Attributes:
        words: how it is called, such as `("roletrust", "live", "demo")`.
        usage: what may stand behind these words.
        about: what it does, in Markdown, a paragraph each.
        examples: how it is typed, with a comment before each.
        arguments: that it takes by their place.
        options: that it takes by their name.
        commands: that belong to it.
    """

    words: tuple[str, ...]
    usage: str
    about: list[str]
    examples: str
    arguments: list[Given]
    options: list[Given]
    commands: "list[Command]"


def roletrust() -> Command:
    """The whole command line."""
    return _read(typer.main.get_command(app), ("roletrust",))


def everything(command: Command) -> Iterator[Command]:
    """A command and all that belong to it."""
    yield command
    for one in command.commands:
        yield from everything(one)


def _read(command: Any, words: tuple[str, ...]) -> Command:
    context = command.context_class(command, info_name=words[-1])
    before, _, after = inspect.cleandoc(command.help or "").partition(_EXAMPLES)
    given: dict[bool, list[Given]] = {True: [], False: []}
    for parameter in command.params:
        name, what = parameter.get_help_record(context)
        given[isinstance(parameter, TyperArgument)].append(Given(name, _escaped(what.replace("\\[", "["))))
    return Command(
        words,
        " ".join(command.collect_usage_pieces(context)),
        [markdown(block) for block in before.split("\n\n") if block.strip()],
        "\n\n".join(_typed(block) for block in after.split("\n\n") if block.strip()),
        given[True],
        given[False],
        [_read(one, (*words, name)) for name, one in sorted(getattr(command, "commands", {}).items())],
    )


def markdown(markup: str) -> str:
    r"""A text with the markup of a terminal, as Markdown.

    Example:
        >>> markdown("Draw [bold]every model[/] into [green]models.png[/] \\[0, 1].")
        'Draw **every model** into `models.png` \\[0, 1].'
    """
    text = Text.from_markup(markup.strip())
    parts, at = [], 0
    for span in sorted(text.spans):
        mark = _MARKS[str(span.style)]
        inside = text.plain[span.start : span.end]
        parts += [_escaped(text.plain[at : span.start]), mark, inside if mark == "`" else _escaped(inside), mark]
        at = span.end
    return "".join([*parts, _escaped(text.plain[at:])])


def _typed(markup: str) -> str:
    """Examples as they are typed; a command that goes on in the next line says so."""
    text = Text.from_markup(markup.strip())
    return "\n".join(text.plain[span.start : span.end].replace("\n", " \\\n  ") for span in sorted(text.spans))


def _escaped(text: str) -> str:
    """A plain text that Markdown shows as it is, but for what stands in backticks."""
    pieces = re.split(r"(`[^`]*`)", text)
    return "".join(piece if k % 2 else re.sub(r"([\\*_<\[|$])", r"\\\1", piece) for k, piece in enumerate(pieces))
