"""A team: its agents, the ratings of a round, and the trust after it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario

RatingRows = Mapping[str, Sequence[float | None]]
"""The ratings of a round: for each rater, one entry per provider in the team's order. None means no
rating."""


@dataclass(frozen=True)
class Team:
    """The agents of a team, in the order of the array axes. An agent with both roles is on both
    axes.

    Attributes:
        raters: Names of the raters, in the order of axis 0.
        providers: Names of the providers, in the order of axis 1.
    """

    raters: tuple[str, ...] = ()
    providers: tuple[str, ...] = ()

    @classmethod
    def of(cls, scenario: Scenario) -> "Team":
        """Return the team of a scenario."""
        roster = Roster.of(scenario)
        return cls(roster.rater_names, roster.provider_names)

    def with_newcomers(self, raters: Iterable[str], providers: Iterable[str]) -> "Team":
        """Return the team with new agents appended."""
        return Team(
            tuple(dict.fromkeys((*self.raters, *raters))),
            tuple(dict.fromkeys((*self.providers, *providers))),
        )

    @property
    def peers(self) -> NDArray[np.bool_]:
        """Mask of the pairs in which rater and provider are the same agent, shape (S, P)."""
        return np.array(
            [[rater == provider for provider in self.providers] for rater in self.raters], bool
        )

    @property
    def dual_role(self) -> tuple[str, ...]:
        """Names of the agents with both roles, in the order of the raters."""
        return tuple(name for name in self.raters if name in self.providers)


class Trust(NamedTuple):
    """The trust values of a team.

    Attributes:
        tor: Trust of each rater.
        top: Trust of each provider.
        toa: Trust of each agent with both roles.
    """

    tor: tuple[float, ...]
    top: tuple[float, ...]
    toa: tuple[float, ...]


class PublishedTrust(NamedTuple):
    """The trust after a round, as the manager publishes it.

    Attributes:
        round: Number of the round.
        stamp: Time stamp of the round's services, nanoseconds.
        tor: Trust of the raters, by name.
        top: Trust of the providers, by name.
        missing: Expected raters whose ratings did not arrive in time.
    """

    round: int
    stamp: int
    tor: dict[str, float]
    top: dict[str, float]
    missing: tuple[str, ...]
