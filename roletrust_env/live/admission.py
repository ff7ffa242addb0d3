"""Admission of newcomers: how many agents join a team in a period, and how many without being known."""

from collections.abc import Container, Iterable

MAX_STRANGERS = 8
"""Agents of a role that may take part without a key and without a place in the scenario."""

_PER_PERIOD = 10


class Admission:
    """Decides which newcomers join, so that a flood of fresh names costs the others nothing.

    Args:
        members: Agents that take part already.
        period: Time between rounds, nanoseconds; only a few newcomers join in each.
        known: Agents that may join, such as those with a key; None for any agent, up to a limit.
        strangers: Number of members that joined without being known.
    """

    def __init__(
        self, members: Iterable[str], period: int, known: Container[str] | None = None, strangers: int = 0
    ) -> None:
        self._members, self._period, self._known, self._strangers = set(members), period, known, strangers
        self._start, self._joined = 0, 0

    def __contains__(self, name: object) -> bool:
        """Return whether an agent takes part."""
        return name in self._members

    def admits(self, name: str, now: int) -> bool:
        """Return whether an agent takes part, as a member or, from now on, as a newcomer.

        Args:
            name: Name of the agent.
            now: Time, nanoseconds.
        """
        if name in self._members:
            return True
        if self._known is None and self._strangers >= MAX_STRANGERS:
            return False
        if self._known is not None and name not in self._known:
            return False
        if now - self._start >= self._period:
            self._start, self._joined = now, 0
        if self._joined >= _PER_PERIOD:
            return False
        self._joined += 1
        self._strangers += self._known is None
        self._members.add(name)
        return True
