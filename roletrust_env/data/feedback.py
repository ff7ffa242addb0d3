"""Feedback events of ERC-8004, the registry of agents, as ratings."""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

_FIELDS = {
    "decimals": "valuedecimals",
    "index": "feedbackindex",
    "event": "event eventname eventtype",
    "revoked": "revoked isrevoked",
    "tag1": "tag1",
    "tag2": "tag2",
    "funder": "funder fundedby fundingaddress",
    "chain": "chain chainid network",
}


class Feedback(NamedTuple):
    """Ratings from feedback events.

    Attributes:
        raters: Addresses in small letters, those that funded the clients where these are known,
            shape (n,).
        agents: Numbers of the agents, after their chain where there are several, shape (n,).
        values: Values with their decimals, NaN where there is none, shape (n,).
        kept: Whether an event is a rating that counts, shape (n,).
        words: What was left out, and what is mixed.
    """

    raters: list[str]
    agents: list[str]
    values: list[float]
    kept: npt.NDArray[np.bool_]
    words: list[str]


def feedback_columns(header: list[str]) -> dict[str, int]:
    """Return the places of the further columns of feedback events; none if the file has no
    `valueDecimals`.
    """
    plain = [re.sub(r"[\W_]+", "", name.casefold()) for name in header]
    found = {
        field: [plain.index(name) for name in names.split() if name in plain]
        for field, names in _FIELDS.items()
    }
    return (
        {field: places[0] for field, places in found.items() if places} if found["decimals"] else {}
    )


def as_ratings(
    raters: list[Any],
    agents: list[Any],
    values: list[Any],
    tag: str | None,
    more: Mapping[str, list[Any]],
) -> Feedback:
    """Return events as ratings.

    A value counts with its decimals. What an event `FeedbackRevoked` or a mark takes back does not
    count. A client is the address that funded it, where that is known.

    Args:
        raters: Address of the client of each event.
        agents: Number of the agent of each event.
        values: Value of each event, a whole number.
        tag: Tag of the ratings that count; None for all.
        more: Further columns, by the names of `feedback_columns`.
    """
    none = [None] * len(values)
    decimals, index, event, marks, one, two, funders, chains = (
        more.get(field) or none for field in _FIELDS
    )
    clients, funded = (
        [_text(address).lower() for address in column] for column in (raters, funders)
    )
    names, chain = list(map(_text, agents)), list(map(_text, chains))
    if len(set(chain)) > 1:
        names = [":".join(pair) for pair in zip(chain, names, strict=True)]
    keys = list(zip(names, clients, map(_text, index), strict=True))
    events = [re.sub("[^a-z]", "", _text(name).casefold()) for name in event]
    taken_back = {key for key, name in zip(keys, events, strict=True) if name == "feedbackrevoked"}
    marked = [_text(mark).casefold() in ("1", "true", "yes") for mark in marks]
    revoked = np.array([key in taken_back for key in keys]) | np.array(marked)
    tags = [(_text(first), _text(second)) for first, second in zip(one, two, strict=True)]
    wanted = np.array([tag is None or tag in pair for pair in tags])
    wanted &= np.array([name in ("", "newfeedback") for name in events])
    kept, words = wanted & ~revoked, list[str]()
    if lost := int((wanted & revoked).sum()):
        words.append(f"revoked feedback left out: {lost:,}")
    if (
        len(mixed := sorted({pair[0] for pair, counts in zip(tags, kept, strict=True) if counts}))
        > 1
    ):
        words.append(f"{len(mixed):,} tags mixed, such as {mixed[-1]} (--tag)")
    if payers := sum(map(bool, funded)):
        words.append(f"clients under the address that funded them: {payers:,}")
    people = [funder or client for funder, client in zip(funded, clients, strict=True)]
    return Feedback(people, names, list(map(_scaled, values, decimals)), kept, words)


def _text(value: Any) -> str:
    return "" if value is None else str(value).strip()


def _scaled(value: Any, decimals: Any) -> float:
    """Return a value with its decimals; NaN if one of them is no number."""
    try:
        return float(float(value) / 10 ** int(float(decimals or 0)))
    except (TypeError, ValueError, OverflowError):
        return float("nan")
