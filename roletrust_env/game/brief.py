"""One-line descriptions of games and of what they leave behind, for `repr`: names and shapes, and
no array.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from roletrust_env.arrays import library_of
from roletrust_env.world.roster import Roster

_FEW = 4  # agents that are named one by one


def population(roster: Roster) -> str:
    """Return how many agents of each role there are, such as `3 SR + 3 SP`."""
    roles = list(roster.roles.values())
    return " + ".join(f"{roles.count(role)} {role}" for role in dict.fromkeys(roles))


def game_facts(game: Any, batch: tuple[int, ...] | None = None) -> str:
    """Return the scenario, the model, the agents and the rounds of a game, and the shape of the
    batch, if any.

    Args:
        game: A `Game`.
        batch: Shape of the batch of games; None where there is no batch yet.
    """
    like = game.like
    library = (
        ""
        if isinstance(like, np.ndarray) and str(like.dtype) == "float64"
        else f", {library_of(like)}"
    )
    games = "" if not batch else f", batch {batch}"
    rules, agents = game.scenario, population(game.roster)
    rounds = f"{'' if rules.continuation == 1 else 'up to '}{rules.max_cycles}"
    return f"{rules.name!r}, {game.model!r}, agents: {agents}, rounds: {rounds}{games}{library}"


def shapes(record: Any) -> str:
    """Return the fields of a tuple of arrays by their shapes, such as `Actions(quality: (3,),
    ratings: (3, 3))`.
    """
    fields = ", ".join(
        f"{name}: {_brief(value)}"
        for name, value in zip(record._fields, record, strict=True)
        if value is not None
    )
    return f"{type(record).__name__}({fields})"


def players(policies: Mapping[str, Any]) -> str:
    """Return the agents with a policy and the policies, such as `sr_2: BadMouthing()`; of many
    agents a count.
    """
    by_policy: dict[Any, list[str]] = {}
    for name, policy in policies.items():
        by_policy.setdefault(policy, []).append(name)
    return ", ".join(f"{_names(names)}: {policy!r}" for policy, names in by_policy.items())


def _names(names: Sequence[str]) -> str:
    return " ".join(names) if len(names) <= _FEW else f"{names[0]} ... {names[-1]} ({len(names)})"


def _brief(value: Any) -> str:
    if hasattr(value, "shape"):
        return str(tuple(value.shape))
    if isinstance(value, tuple):
        return type(value).__name__
    return repr(value)
