"""A group of agents in a scenario: what is fixed of each before a game starts."""

from typing import Annotated, Literal, Self

from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveInt, model_validator

from roletrust_env.ranges import DrawnBias, DrawnScale, DrawnShare, Share
from roletrust_env.world.base_model import FrozenModel

Role = Literal["SR", "SP", "SR+SP"]


class AgentGroup(FrozenModel):
    """Agents of one kind.

    What has a range is drawn for each agent and each game, uniformly, and lasts for the game.
    """

    role: Role
    """`SR` rates services, `SP` provides them, `SR+SP` does both."""
    count: Annotated[int, Field(ge=1, le=100_000)] = 1
    """Number of agents; each is an identity of its own, also one that joins late."""
    reserve: Annotated[int, Field(ge=0, le=1000)] = 0
    """Further identities of each agent, not there until it takes them: newcomers to all others (not in PettingZoo)."""
    turns: tuple[Role, ...] = ()
    """For `SR+SP` agents: the roles that they play in turn, over and over; empty: both roles in every round."""
    turn_length: PositiveInt = 1
    """Rounds that a turn lasts."""
    joins: NonNegativeInt = 0
    """First round in which a member may be present."""
    join_rate: Share = 1.0
    """Probability, in each round from `joins` on, that a member that is not there yet joins."""
    leaves: PositiveInt | None = None
    """First round in which no member is present any more."""
    leave_rate: Share = 0.0
    """Probability, in each round, that a present member leaves, for good."""
    noise: NonNegativeFloat = 0.0
    """Standard deviation of a rater's perception of quality (synthetic service only)."""
    ability: DrawnShare = 1.0
    """What a provider delivers of the quality that it chooses: a number, or a range (low, high) to draw it from."""
    bias: DrawnBias = 0.0
    """What a rater adds to what it perceives (synthetic service only): a number, or a range (low, high)."""
    scale: DrawnScale = 1.0
    """What it multiplies quality by before (synthetic service only): a number, or a range (low, high)."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.turns and self.role != "SR+SP":
            raise ValueError(f"turns are for agents with the role 'SR+SP', not {self.role!r}")
        if self.leaves is not None and self.leaves <= self.joins:
            raise ValueError(f"leaves is {self.leaves}; it must be later than joins, {self.joins}")
        if self.join_rate == 0:
            raise ValueError("join_rate is 0; it must be above 0, or the group never joins")
        if self.ability != 1 and self.role == "SR":
            raise ValueError(f"ability is {self.ability}; it is for agents that provide, not for the role 'SR'")
        if self.subjective and self.role == "SP":
            raise ValueError(f"bias is {self.bias} and scale {self.scale}; they are for raters, not for the role 'SP'")
        return self

    def role_in(self, round: int) -> Role:
        """The role that its members play in a round."""
        return self.turns[round // self.turn_length % len(self.turns)] if self.turns else self.role

    @property
    def subjective(self) -> bool:
        """Whether its raters have a bias or a scale of their own."""
        return self.bias != 0 or self.scale != 1

    @property
    def open(self) -> bool:
        """Whether members join or leave while the game runs."""
        late = self.joins > 0 or self.join_rate < 1
        return late or self.leaves is not None or self.leave_rate > 0 or self.reserve > 0
