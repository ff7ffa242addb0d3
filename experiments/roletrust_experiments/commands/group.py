"""Groups of commands that are imported when they are called, and that report bad input in one
line.
"""

import ast
import os
import sys
from collections.abc import Callable, Mapping
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from inspect import cleandoc
from pathlib import Path
from typing import Any, ClassVar

import typer
from typer.core import TyperCommand, TyperGroup

EXAMPLES = "[bold]Examples[/]"
"""Line of a help text from which on it shows examples."""

_HELP = ["-h", "--help"]
_STYLE: dict[str, Any] = {
    "rich_markup_mode": "rich",
    "pretty_exceptions_show_locals": False,
    "context_settings": {"help_option_names": _HELP},
}


def _plain_flags(parameters: Any) -> Any:
    """Return the parameters of a command; the help of a flag shows no type."""
    for parameter in parameters:
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
    return parameters


class LateCommand(TyperCommand):
    """A command, or a group of commands, that is imported when it is called.

    Args:
        name: Name of the command.
        place: Its function or its group, as `module:name`.
    """

    def __init__(self, name: str, place: str) -> None:
        super().__init__(name)
        self._module, _, self._attribute = place.partition(":")

    @cached_property
    def loaded(self) -> Any:
        """The command itself."""
        app_or_function = getattr(import_module(self._module), self._attribute)
        if not isinstance(app_or_function, typer.Typer):
            app = typer.Typer(add_completion=False, **_STYLE)
            app.command(self.name)(app_or_function)
            app_or_function = app
        command: Any = typer.main.get_command(app_or_function)
        with typer.Context(command, help_option_names=_HELP) as context:
            _plain_flags(command.get_params(context))
        about, examples, rest = cleandoc(command.help or "").partition(EXAMPLES)
        paragraphs = [" ".join(paragraph.split("\n")) for paragraph in about.split("\n\n")]
        command.help = (
            "\n\n".join(paragraphs) + examples + rest
        )  # typer breaks lines where the docstring does
        return command

    def make_context(
        self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any
    ) -> Any:
        """Return the context of the command itself, which is imported now.

        Raises:
            ValueError: An option is not Unicode, as results and pages are, which show it.
        """
        from roletrust_env.errors import check_unicode

        context = self.loaded.make_context(info_name, args, parent, **extra)
        for option in (
            parameter
            for parameter in context.command.params
            if parameter.param_type_name == "option"
        ):
            value = context.params.get(option.name)
            for text in value if isinstance(value, list | tuple) else [value]:
                check_unicode(option.opts[0], str(text))
        return context

    def summarize(self) -> None:
        """Read the first paragraph of the help from the source, which is parsed and not run."""
        spec = find_spec(self._module)
        assert spec is not None
        assert spec.origin is not None
        for node in ast.parse(Path(spec.origin).read_bytes()).body:
            if isinstance(node, ast.FunctionDef) and node.name == self._attribute:
                self.short_help = " ".join(
                    (ast.get_docstring(node) or "").partition("\n\n")[0].split()
                )


class CommandGroup(TyperGroup):
    """A group of late commands that reports bad input, unwritable files and an interrupt in one
    message.
    """

    places: ClassVar[Mapping[str, str]] = {}
    moved: ClassVar[Mapping[str, str]] = {}

    def __init__(self, **attributes: Any) -> None:
        super().__init__(
            **attributes
            | {"commands": {name: LateCommand(name, at) for name, at in self.places.items()}}
        )

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:  # the reader has stopped, as `head` does
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - Python writes to it once more when it ends
            raise typer.Exit(141) from None
        except (ValueError, OSError, MemoryError) as error:
            from rich.markup import escape

            from roletrust_env.errors import printable
            from roletrust_experiments.commands.console import errors

            said = "\n".join(map(printable, str(error).splitlines()))
            errors.print(f"[bold red]Error:[/] {escape(said or 'out of memory')}", soft_wrap=True)
            raise typer.Exit(2) from None
        except KeyboardInterrupt:
            from roletrust_experiments.commands.console import errors

            errors.print("Stopped. What is saved stays; the same command continues from there.")
            raise typer.Exit(130) from None

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command of the arguments; for an old name, an error has the new one."""
        if args and args[0] in self.moved:
            ctx.fail(f"{args[0]} is now: roletrust {self.moved[args[0]]}")
        return super().resolve_command(ctx, args)

    def get_params(self, ctx: Any) -> Any:
        """Return the options of the group."""
        return _plain_flags(super().get_params(ctx))

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, with a line on each command."""
        for command in self.commands.values():
            if isinstance(command, LateCommand):
                command.summarize()
        super().format_help(ctx, formatter)


def command_group(
    places: Mapping[str, str], *, moved: Mapping[str, str] | None = None, **options: Any
) -> Callable[[Callable[..., None]], typer.Typer]:
    """Return a decorator that makes a function a group of commands; its docstring is the help of
    the group.

    Args:
        places: Where each command is, as `module:function` by name; a place may be another group.
        moved: New names of commands by their old ones.
        **options: Further options of `typer.Typer`.
    """

    def decorate(function: Callable[..., None]) -> typer.Typer:
        group = type("Commands", (CommandGroup,), {"places": places, "moved": moved or {}})
        app = typer.Typer(cls=group, no_args_is_help=True, **_STYLE, **options)
        app.callback()(function)
        return app

    return decorate
