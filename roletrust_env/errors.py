"""Error messages in one line: what pydantic refuses, and which names are known."""

import re
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError

_PLAIN = {
    **dict.fromkeys(
        ("tuple_type", "list_type", "set_type", "frozen_set_type"), "it must be a list"
    ),
    **dict.fromkeys(
        (
            "dict_type",
            "mapping_type",
            "model_type",
            "model_attributes_type",
            "dataclass_type",
            "dataclass_exact_type",
        ),
        "it must be a table of names and values",
    ),
    **dict.fromkeys(
        ("int_type", "int_parsing", "int_from_float", "int_parsing_size"), "it must be an integer"
    ),
    **dict.fromkeys(("float_type", "float_parsing"), "it must be a number"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "it must be true or false"),
    **dict.fromkeys(("string_type", "string_unicode"), "it must be a text"),
    "finite_number": "it must be a finite number",
}
"""Words for what pydantic says of types in those of Python."""

_KIND = re.compile(r"bool|int|float|str|constrained-(int|float|str)|[a-z-]+\[.*")
"""Kinds of a union as pydantic names them among the fields that lead to a value."""

_MAX_FIELDS, _MAX_LENGTH = (
    10,
    300,
)  # limits on the wrong fields listed and on the characters shown of a value


def suggest(
    name: object, known: Iterable[str], label: str = "Known:", hint: str | None = None
) -> str:
    """Return the end of a message about an unknown name: the nearest known name, and all of them.

    Args:
        name: Unknown name.
        known: Names that exist.
        label: Words in front of the known names.
        hint: Sentence in place of the nearest known name.

    Example:
        >>> "unknown suite 'quik'" + suggest("quik", ["quick", "full"])
        "unknown suite 'quik'; did you mean 'quick'? Known: quick, full"
    """
    names = {known_name.casefold(): known_name for known_name in known}
    near = get_close_matches(str(name).casefold(), names, 1)
    hint = hint or (f"did you mean {names[near[0]]!r}?" if near else None)
    return f"{f'; {hint}' if hint else '.'} {label} {', '.join(names.values()) or 'none'}"


def counted(number: int, noun: str) -> str:
    """Return a number with its noun.

    Example:
        >>> counted(1, "round"), counted(2000, "rating")
        ('1 round', '2,000 ratings')
    """
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def validation_message(error: ValidationError) -> str:
    """Return one line with each wrong field, its value and the values allowed; of many fields, the
    first ones.
    """
    reasons: dict[str, list[str]] = {}
    for detail in error.errors(include_url=False):
        what, reason = _explain(detail)
        reasons.setdefault(what, []).append(
            reason
        )  # several where each kind of a union refuses the value
    lines = [what + ", or ".join(dict.fromkeys(every)) for what, every in reasons.items()]
    more = f"; and {len(lines) - _MAX_FIELDS} more" if len(lines) > _MAX_FIELDS else ""
    return "; ".join(lines[:_MAX_FIELDS]) + more


def _explain(detail: Any) -> tuple[str, str]:
    """Return the field with its value, and what is wrong with it."""
    places = [str(part) for part in detail["loc"]]
    field = short(".".join([part for part in places if not _KIND.fullmatch(part)] or places))
    if detail["type"] == "union_tag_not_found":
        return f"field {field}.{detail['ctx']['discriminator'].strip(chr(39))} is missing", ""
    if detail["type"] == "missing":
        return f"field {field} is missing", ""
    reason: str = _PLAIN.get(
        detail["type"],
        detail["msg"].removeprefix("Value error, ").replace("Input should be", "it must be"),
    )
    if detail["type"] == "value_error":
        return f"{field}: " if field else "", printable(reason)
    value = (
        list(detail["input"]) if type(detail["input"]) is tuple else detail["input"]
    )  # a list in the file
    return f"{field} is {short(repr(value))}: " if field else "", short(reason)


def check_unicode(what: str, text: str) -> None:
    """Refuse a text that cannot be written as UTF-8, since it has half a surrogate pair.

    Args:
        what: What the text is, for the error message.
        text: Text to check.

    Raises:
        ValueError: The text is such a one.
    """
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise ValueError(
            f"{what} has {printable(text[error.start])}, which is no character of Unicode"
        ) from None


def short(text: str) -> str:
    """Return a text of others for a message: `printable`, and cut off where it is long."""
    return printable(text if len(text) <= _MAX_LENGTH else f"{text[:_MAX_LENGTH]}...")


def printable(text: str) -> str:
    r"""Return a text of others on one line, where what could steer a terminal is escaped.

    Example:
        >>> print(printable("red" + chr(27) + "[31m" + chr(10) + "new line"))
        red\x1b[31m\nnew line
    """
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in text
    )
