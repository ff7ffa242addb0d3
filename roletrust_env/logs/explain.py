"""What makes the trust in an agent: the ratings that it got, or gave, and its trust without
them.
"""

from collections.abc import Callable
from difflib import get_close_matches
from typing import Any, NamedTuple, get_args

import numpy as np

from roletrust_env.logs.evidence import Role
from roletrust_env.logs.log import Log
from roletrust_env.logs.log_rounds import played
from roletrust_env.logs.values import trimmed
from roletrust_env.trust.key_index import Floats, Ints

MOST = 10
"""Number of agents without whose ratings trust is computed again."""

_MANY, _NEAR = 10_000, 3  # names among which some are suggested, and how many


class Reason(NamedTuple):
    """A rater of the agent, or an agent that it rates.

    Attributes:
        other: Its name.
        trust: Trust in it.
        ratings: Ratings of the one by the other on [0, 1], in the order of time.
        others: Mean rating that the rated one has from all others; NaN if there are none.
        without: Trust in the agent without these ratings.
        rank: Rank of the agent without them, 1 for the most trusted.
    """

    other: str
    trust: float
    ratings: Floats
    others: float
    without: float
    rank: int


class Explanation(NamedTuple):
    """Trust in an agent, and what makes it.

    Attributes:
        name: Name of the agent.
        role: Its role.
        trust: Trust in the agent.
        rank: Its rank by trust among the agents with ratings, 1 for the most trusted.
        n_ratings: Number of its ratings, received or given.
        n_others: Number of its raters, or of the agents that it rates.
        reasons: The most important ones, those first without whose ratings its trust is furthest
            from what it is.
    """

    name: str
    role: Role
    trust: float
    rank: int
    n_ratings: int
    n_others: int
    reasons: list[Reason]


def find_agent(log: Log, name: str, roles: tuple[Role, ...] = get_args(Role)) -> dict[Role, int]:
    """Return the place of an agent by its name, in each of some roles in which it has ratings.

    Raises:
        ValueError: There is none. The message has the nearest names.
    """
    places = {}
    for role in roles:
        names, agents = (
            (log.ratee_names, log.ratees) if role == "ratee" else (log.rater_names, log.raters)
        )
        texts = list(names)
        places[role] = {texts[at]: at for at in np.unique(agents).tolist()}
    if found := {
        role: known[trimmed(name)] for role, known in places.items() if trimmed(name) in known
    }:
        return found
    known = {one.casefold(): one for role in roles for one in list(places[role])[:_MANY]}
    near = " or ".join(
        repr(known[one]) for one in get_close_matches(trimmed(name).casefold(), known, _NEAR)
    )
    raise ValueError(f"no agent {name!r} has ratings{f'; did you mean {near}?' if near else ''}")


def explain(
    model: Any,
    log: Log,
    numbers: Ints,
    role: Role,
    agent: int,
    *,
    most: int = MOST,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> Explanation:
    """Return what makes the trust in an agent.

    The whole log is played again without the ratings of the agent by each of its raters, or by it
    of each agent. Of more raters than `most`, those are taken whose mean rating is furthest from
    its trust, weighted by the trust in them. Of more agents that it rates, half are those of which
    its mean rating is furthest from the trust in them, and half those where it is nearest.

    Args:
        model: Trust model.
        log: Log.
        numbers: Number of the round of each rating, shape (n,), ascending.
        role: Role of the agent.
        agent: Place of the agent among those with this role.
        most: Number of raters, or of agents that it rates.
        advance: Function that is called with the number of logs that were played, and of all.

    Raises:
        MemoryError: The model does not fit, see `make_run`.
    """
    rated = role == "ratee"
    raters, ratees = (log.raters, log.rater_names), (log.ratees, log.ratee_names)
    (mine, names), (theirs, other_names) = (ratees, raters) if rated else (raters, ratees)
    own, known = mine == agent, np.unique(mine)

    def trusts_after(without: Any) -> dict[Role, Floats]:
        run = played(model, log, numbers, without=without)
        return {"ratee": run.provider_trust, "rater": run.rater_trust}

    trusts = trusts_after(None)
    trust, other_trust = float(trusts[role][agent]), trusts["rater" if rated else "ratee"]
    others, place, times = np.unique(theirs[own], return_inverse=True, return_counts=True)
    means = np.bincount(place, log.values[own]) / times
    far = (
        other_trust[others] * np.abs(means - trust)
        if rated
        else np.abs(means - other_trust[others])
    )
    order = np.argsort(-far, kind="stable")
    chosen = others[
        order
        if len(order) <= most
        else order[:most]
        if rated
        else np.r_[order[: most // 2], order[-most // 2 :]]
    ]
    reasons = []
    for done, other in enumerate(chosen.tolist(), 1):
        these = own & (theirs == other)
        ratee, rater = (agent, other) if rated else (other, agent)
        rest = log.values[(log.ratees == ratee) & (log.raters != rater)]
        after = trusts_after(these)[role]
        view = float(rest.mean()) if len(rest) else float("nan")
        without = float(after[agent])
        one = Reason(
            other_names[other],
            float(other_trust[other]),
            log.values[these],
            view,
            without,
            _rank(after[known], without),
        )
        reasons.append(one)
        advance(done, len(chosen))
    reasons.sort(key=lambda reason: -abs(reason.without - trust))
    rank = _rank(trusts[role][known], trust)
    return Explanation(names[agent], role, trust, rank, int(own.sum()), len(others), reasons)


def _rank(trusts: Floats, trust: float) -> int:
    return 1 + int((trusts > trust).sum())
