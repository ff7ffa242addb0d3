"""Columns of a table of ratings, by their names."""

import re
from collections.abc import Mapping
from typing import Literal, get_args

from roletrust_env.errors import short, suggest
from roletrust_env.logs.sources import Source

Column = Literal["rater", "ratee", "rating", "time"]
"""Columns of a log."""

COLUMNS: tuple[Column, ...] = get_args(Column)

ALIASES: dict[Column, frozenset[str]] = {
    "rater": frozenset({"rater", "raterid", "source", "reviewer", "reviewerid", "user", "userid"}),
    "ratee": frozenset({"ratee", "rateeid", "target", "item", "itemid", "product", "productid"}),
    "rating": frozenset({"rating", "score", "stars"}),
    "time": frozenset({"time", "timestamp", "date", "datetime"}),
}
"""Names by which a column is found, without blanks, underscores and upper case."""

_SHOWN = 3
"""Number of rows in an error message."""


def find_columns(source: Source, given: Mapping[str, str | None]) -> dict[Column, int]:
    """Return the position of each column of a log in a source.

    A column that is not given is the one with its own name, such as `rater`, or else the only one
    with an alias. The time may be missing.

    Args:
        source: Source.
        given: Names of columns, by column of the log; None where it is not known.

    Raises:
        ValueError: A column is missing, or several fit. The message shows the first rows.
    """
    names = source.table.column_names
    if not names:
        raise ValueError(f"{source.name} has no ratings")
    found = dict[Column, int]()
    for column in COLUMNS:
        name = given.get(column)
        if name is not None:
            places = [place for place, other in enumerate(names) if other == name]
            if not places:
                raise ValueError(_refusal(source, f"no column {name!r}{suggest(name, names)}"))
        else:
            folded = [_folded(other) for other in names]
            usual = {column} if column in folded else ALIASES[column]
            places = [place for place, other in enumerate(folded) if other in usual]
            if not places and column == "time":
                continue
            if not places:
                raise ValueError(_refusal(source, f"no column is known as the {column}"))
        if len(places) > 1:
            several = " and ".join(repr(names[place]) for place in places)
            raise ValueError(_refusal(source, f"the columns {several} may be the {column}"))
        found[column] = places[0]
    if len(set(found.values())) < len(found):
        raise ValueError(_refusal(source, "one column is given twice"))
    return found


def _folded(name: str) -> str:
    return re.sub(r"[\s_-]", "", name).casefold()


def _refusal(source: Source, why: str) -> str:
    """Return an error message with the first rows, and how to name the columns."""
    table = source.table
    rows = [" | ".join(table.column_names)]
    rows += [
        " | ".join(str(value) for value in row.values())
        for row in table.slice(0, _SHOWN).to_pylist()
    ]
    shown = "; ".join(short(row) for row in rows)
    return (
        f"{source.name}: {why}. Its rows are: {shown}. Name the columns: "
        "rater=..., ratee=..., rating=..., time=...; if the first row has no names, header=false "
        "and numbers from 1 (on the command line --set rater=...)"
    )
