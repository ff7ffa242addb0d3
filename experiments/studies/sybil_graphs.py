"""Sybil graphs: identities of one attacker that vouch for one another, in a log in which members
rate members.
"""

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
from pydantic import NonNegativeInt

from roletrust_env.logs.log import Log
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.key_index import Ints

Topology = Literal["line", "cycle", "parallel", "layers"]
"""Way in which identities vouch for one another, see `SybilGraph`."""


@checked_dataclass
class SybilGraph:
    """Identities of one attacker, and the ratings among them: the best ones, which cost nothing.

    After the experiments of Nasrulin et al. (2022), with an attacker a, which is the target, and n
    Sybils s:

        line:     a -> s_1 -> s_2 -> ... -> s_n
        cycle:    a -> s_k -> a for each k
        parallel: a -> s_k for each k

    There all bridge edges, the good ratings by honest members, end at the target: everything else
    is behind it. This project adds a topology with as many ways in as there are bridges, so that no
    identity is behind another:

        layers:   bridge edges end at a, s_1, s_2, ... in turn; each of these rates all others, and
                they rate a

    Attributes:
        topology: Way in which the identities vouch for one another.
        sybils: Number of Sybils n besides the target.
        returned: Whether every rating of this attack is returned, also those by honest members. An
            agreed edge, as of `sybil-rank`, needs it.
    """

    topology: Topology
    sybils: NonNegativeInt = 0
    returned: bool = False

    def links(self, bridges: int) -> Iterator[tuple[int, int]]:
        """Yield the ratings among identities, rater and ratee; 0 is the target."""
        sybils = range(1, self.sybils + 1)
        if self.topology == "line":
            yield from ((k - 1, k) for k in sybils)
        elif self.topology == "parallel":
            yield from ((0, k) for k in sybils)
        elif self.topology == "cycle":
            for k in sybils:
                yield from ((0, k), (k, 0))
        else:
            entries = self._entries(bridges)
            yield from (
                (entry, k) for entry in range(entries) for k in range(entries, self.sybils + 1)
            )
            yield from ((k, 0) for k in sybils)

    def _entries(self, bridges: int) -> int:
        """Return the number of identities at which bridge edges end."""
        return max(1, min(bridges, 1 + self.sybils)) if self.topology == "layers" else 1

    def identities(self, log: Log, bought: int | None = None) -> Ints:
        """Return the places of the target and of the Sybils after `added_to`, shape (1 + n,)."""
        size = len(log.rater_names)
        sybils = size + (bought is None) + np.arange(self.sybils)
        return np.concatenate([[size if bought is None else bought], sybils])

    def added_to(self, log: Log, helpers: Sequence[int] = (), bought: int | None = None) -> Log:
        """Return a log with the identities and their ratings at its end, at the time of its last
        rating.

        Args:
            log: Log in which members rate members.
            helpers: Places of the honest members that rate the attacker, one for each bridge edge.
            bought: Place of a member whose account the attacker has bought or rented: it is the
                target, with all the ratings that it has had. None makes the target a new account.

        Raises:
            ValueError: Raters and ratees of the log are no members of one kind, or a place is that
                of none of them.
        """
        size, entries = len(log.rater_names), self._entries(len(helpers))
        if not log.same_agents:
            raise ValueError(
                "Sybils vouch for one another only where members rate members; read with "
                "same_agents"
            )
        members = [*helpers, *([] if bought is None else [bought])]
        if wrong := [place for place in members if not 0 <= place < size]:
            raise ValueError(f"there is no member {wrong[0]}; the log has {size}, counted from 0")
        own = self.identities(log, bought).tolist()
        pairs = [
            (place, own[k % entries])
            for k, place in enumerate(helpers)
            if place != own[k % entries]
        ]
        pairs += [(own[rater], own[ratee]) for rater, ratee in self.links(len(helpers))]
        if self.returned:
            pairs += [(ratee, rater) for rater, ratee in pairs]
        raters, ratees = np.array(list(dict.fromkeys(pairs)), np.int64).reshape(-1, 2).T
        names = [*log.rater_names, *(["target"] if bought is None else [])]
        names += [f"sybil {k}" for k in range(1, self.sybils + 1)]
        times = log.times
        return log._replace(
            raters=np.concatenate([log.raters, raters]),
            ratees=np.concatenate([log.ratees, ratees]),
            values=np.concatenate([log.values, np.ones(len(raters))]),
            times=None
            if times is None
            else np.concatenate([times, np.full(len(raters), times[-1])]),
            rater_names=names,
            ratee_names=names,
        )
