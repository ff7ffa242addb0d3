"""Columns of a table of ratings, and the names by which they are found."""

import re
from collections.abc import Mapping
from typing import NamedTuple

from roletrust_env.errors import suggest

_COMMON = {
    "rater": "rater source src from fromnode sender user userid uid username reviewer customer client buyer worker "  # noqa: E501
    "annotator labeler judge voter author evaluator trustor truster member",
    "ratee": "ratee target dst dest destination to tonode receiver item product movie asin isbn book seller vendor "  # noqa: E501
    "provider shop merchant business question task subject trustee rated agent service",
    "rating": "rating ratings score value weight stars star grade vote answer label response overall points mark sign",  # noqa: E501
    "time": "time timestamp datetime date ts when day created createdat unixtime unixreviewtime epoch blocktime "  # noqa: E501
    "blocktimestamp ratedat",
}
_COMMON_NAMES = {role: frozenset(names.split()) for role, names in _COMMON.items()}


class Columns(NamedTuple):
    """The columns of a file: names, or numbers from 1.

    Where a file has no column of the role's own name, such as `rater`, a common name of the role is
    taken, if just one column has one; without a header, the columns are rater, ratee, rating and
    time.

    Attributes:
        rater: Column of the rater.
        ratee: Column of the ratee, the provider.
        rating: Column of the rating.
        time: Column of the time; None if there is none.
    """

    rater: str = "rater"
    ratee: str = "ratee"
    rating: str = "rating"
    time: str | None = None

    @property
    def wanted(self) -> dict[str, str]:
        """The columns that are read, by role."""
        return {role: name for role, name in self._asdict().items() if name is not None}


def by_number(wanted: Mapping[str, str]) -> bool:
    """Return whether all columns are numbers from 1."""
    return all(name.isdecimal() for name in wanted.values())


def find_columns(
    wanted: Mapping[str, str], where: str, header: list[str] | None, width: int
) -> list[int]:
    """Return the places of columns in a file.

    Args:
        wanted: Name or number of the column of each role; a column with the name of its role may
            have a common name.
        where: Path of the file and what has the names, for messages.
        header: Names of the columns; None without.
        width: Number of columns.

    Raises:
        ValueError: There is no such column, or more than one.
    """
    named = None if by_number(wanted) else header
    places = [
        _place(role, name, where, named, at, width)
        for at, (role, name) in enumerate(wanted.items())
    ]
    if max(places) >= width:
        raise ValueError(
            f"{where.partition(', ')[0]} has {width} columns; {max(places) + 1} are needed"
        )
    return places


def _place(role: str, name: str, where: str, header: list[str] | None, at: int, width: int) -> int:
    """Return the place of the column of a role."""
    named = header or []
    if (found := named.count(name)) == 1:
        return named.index(name)
    if found:
        raise ValueError(f"{where}: there are several columns {name!r}")
    if name.isdecimal():
        if int(name) < 1:
            raise ValueError("columns are numbered from 1")
        return int(name) - 1
    if name == role and header is None and at < width:
        return at
    common = (
        (_common_words(named, role, loose=loose) for loose in (False, True)) if name == role else ()
    )
    likely: list[int] = next(filter(None, common), [])
    if len(likely) == 1:
        return likely[0]
    if likely:
        among = " or ".join(repr(named[place]) for place in likely)
        raise ValueError(f"{where}: the column of the {role} is {among}; name it with --{role}")
    what = (
        suggest(name, named, "Columns:")
        if header is not None
        else f" in {width} columns without a header"
    )
    raise ValueError(f"{where}: there is no column {name!r}{what}; name or number it with --{role}")


def are_common(names: list[str]) -> bool:
    """Return whether columns have common names of a rater and of a ratee."""
    return all(_common_words(names, role) for role in ("rater", "ratee"))


def _common_words(names: list[str], role: str, *, loose: bool = False) -> list[int]:
    """Return the places of columns with common names of a role, such as `Reviewer ID` for the
    rater.

    Args:
        names: Names of the columns.
        role: Role.
        loose: Whether a name need only end with a common one of four letters or more, as
            `Book-Rating` does.
    """
    places = []
    for place, name in enumerate(names):
        plain = re.sub(r"[\W_]+", "", name.casefold())
        ends = tuple(word for word in _COMMON_NAMES[role] if len(word) >= 4) if loose else ()
        short = re.sub("(?:id|name|address|key)$", "", plain)
        if {plain, short} & _COMMON_NAMES[role] or short.endswith(ends):
            places.append(place)
    return places
