"""Options that several commands share, each with one spelling and one help text."""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from roletrust_env.errors import suggest
from roletrust_env.evaluation.specs import parse_settings

NAMED = "NAME[:key=value,...]"
OWN = "NAME may be your own class, package.module:Class, whose module is then imported."

SettingsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="FIELD=VALUE", help="Field of the scenario to change; repeat for more."
    ),
]
Seed = Annotated[
    int, typer.Option(min=0, help="Random seed; the same seed gives the same results.")
]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Number of processes; by default one for each core.")
]
Out = Annotated[
    Path,
    typer.Option(metavar="DIR", help="Folder for the results; it is created if it is missing."),
]


def keyword_option(flag: str, keywords: Mapping[str, str]) -> Any:
    """Return a repeatable option `KEY=VALUE`; its help says what each keyword is.

    Args:
        flag: The option, such as `--set`.
        keywords: What each keyword is, in a few words, by its name.
    """
    listed = "; ".join(f"{name}: {meaning}" for name, meaning in keywords.items())
    return typer.Option(flag, metavar="KEY=VALUE", help=f"Repeat for more. {listed}.")


def further_arguments(texts: Sequence[str] | None, function: Callable[..., Any]) -> dict[str, Any]:
    """Return the values of `--set` by name, for a function that takes further arguments.

    Raises:
        ValueError: A text has another form, occurs twice, or names an argument of the function that
            has an option of its own.
    """
    given = parse_settings(texts or ())
    for name in set(given) & set(inspect.signature(function).parameters):
        raise ValueError(f"--set has {name!r}, which is an argument or option of its own")
    return given


def parse_keywords(
    texts: Sequence[str] | None, flag: str, keywords: Iterable[str]
) -> dict[str, Any]:
    """Return the values of a `keyword_option` by their keywords.

    Raises:
        ValueError: A text has another form, or a keyword is unknown or occurs twice.
    """
    given = parse_settings(texts or (), flag)
    for name in given:
        if name not in keywords:
            raise ValueError(f"{flag} has no {name!r}{suggest(name, keywords)}")
    return given
