"""Groups of agents, with their roles and abilities, and the base of all parts of a scenario."""

from collections.abc import Mapping
from difflib import get_close_matches
from inspect import cleandoc
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeInt,
    PositiveInt,
    field_validator,
    model_validator,
)

from roletrust_env.errors import check_unicode, suggest
from roletrust_env.parameters import Amount, BiasOrRange, ScaleOrRange, Share, ShareOrRange, plain

_NEAR = 0.75  # likeness of a name and one that has a hint


class FrozenModel(BaseModel):
    """Frozen, validated data without unknown fields. The docstrings of its fields are added to that
    of its class.
    """

    field_hints: ClassVar[Mapping[str, str]] = {}
    """Sentences that say what to write in place of names that are no fields, in small letters."""

    model_config = ConfigDict(
        frozen=True, strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Add the docstrings of the fields to that of the class."""
        texts = {
            name: " ".join((info.description or "").split())
            for name, info in cls.model_fields.items()
        }
        fields = [f"    {name}: {text}" for name, text in texts.items()]
        cls.__doc__ = "\n".join([cleandoc(cls.__doc__ or ""), "", "Attributes:", *fields])

    @field_validator("*")
    @classmethod
    def _check_texts(cls, value: Any) -> Any:
        for text in value if isinstance(value, tuple) else (value,):
            if isinstance(text, str):
                check_unicode("it", text)
        return value

    @model_validator(mode="before")
    @classmethod
    def _check_fields(cls, data: Any) -> Any:
        for name in data if isinstance(data, dict) else ():
            if name not in cls.model_fields:
                key = str(name).casefold().replace("-", "_")
                near = (
                    []
                    if key in cls.field_hints
                    else get_close_matches(key, cls.model_fields, 1, _NEAR)
                )
                near = near or get_close_matches(key, cls.field_hints, 1, _NEAR)
                hint = cls.field_hints.get(near[0]) if near else None
                raise ValueError(
                    f"there is no field {name!r}{suggest(name, cls.model_fields, hint=hint)}"
                )
        return plain(data)


Role = Literal["SR", "SP", "SR+SP"]


class AgentGroup(FrozenModel):
    """Agents with the same role and the same parameters.

    A parameter with a range is drawn uniformly for each agent and each game. During the game it
    does not change, except an ability with `drift` or `switch`.
    """

    role: Role
    """Role: `SR` rates services, `SP` provides them, `SR+SP` does both."""
    count: Annotated[int, Field(ge=1, le=100_000)] = 1
    """Number of agents. Each of them has its own identity, also if it joins late."""
    reserve: Annotated[int, Field(ge=0, le=1000)] = 0
    """Further identities of each agent, absent until it takes them: newcomers to all others (not in
    PettingZoo)."""
    turns: tuple[Role, ...] = ()
    """Roles that `SR+SP` agents play in turn, again and again; if empty, they play both roles in
    every round."""
    turn_length: PositiveInt = 1
    """Number of rounds that a turn lasts."""
    joins: NonNegativeInt = 0
    """First round in which an agent of the group can be present."""
    join_rate: Share = 1.0
    """Probability that an agent that has not joined yet joins, in each round from `joins` on."""
    leaves: PositiveInt | None = None
    """First round in which no agent of the group is present any more."""
    leave_rate: Share = 0.0
    """Probability that a present agent leaves for good, in each round."""
    noise: Amount = 0.0
    """Standard deviation of the noise in a rater's perception of quality (synthetic service
    only)."""
    ability: ShareOrRange = 1.0
    """Share of the chosen quality that a provider delivers: a number, or a range (low, high) from
    which it is drawn."""
    drift: Amount = 0.0
    """Standard deviation of the change of a provider's ability per round, a random walk that is
    reflected at both ends of the range `ability`."""
    switch: Share = 0.0
    """Probability per round that a provider's ability is drawn again from the range `ability`."""
    bias: BiasOrRange = 0.0
    """Number that a rater adds to the quality (synthetic service only), or a range (low, high)."""
    scale: ScaleOrRange = 1.0
    """Factor by which a rater multiplies the quality before (synthetic service only), or a range
    (low, high)."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.turns and self.role != "SR+SP":
            raise ValueError(f"turns are for agents with the role 'SR+SP', not {self.role!r}")
        if self.leaves is not None and self.leaves <= self.joins:
            raise ValueError(f"leaves is {self.leaves}; it must be later than joins, {self.joins}")
        if self.join_rate == 0:
            raise ValueError("join_rate is 0; it must be above 0, or the group never joins")
        if self.ability != 1 and self.role == "SR":
            raise ValueError(
                f"ability is {self.ability}; it is for agents that provide, not for the role 'SR'"
            )
        changes = self.drift > 0 or self.switch > 0
        if changes and (self.role == "SR" or not isinstance(self.ability, tuple)):
            raise ValueError(
                f"drift is {self.drift} and switch {self.switch}; they need a provider with a "
                f"range of ability, got role {self.role!r} and ability {self.ability}"
            )
        if self.subjective and self.role == "SP":
            raise ValueError(
                f"bias is {self.bias} and scale {self.scale}; they are for raters, not for the "
                "role 'SP'"
            )
        return self

    def role_in(self, round: int) -> Role:
        """Return the role that the agents of the group play in a round."""
        return self.turns[round // self.turn_length % len(self.turns)] if self.turns else self.role

    @property
    def subjective(self) -> bool:
        """True if the raters of the group have a bias or a scale."""
        return self.bias != 0 or self.scale != 1

    @property
    def open(self) -> bool:
        """True if agents of the group join or leave during the game."""
        late = self.joins > 0 or self.join_rate < 1
        return late or self.leaves is not None or self.leave_rate > 0 or self.reserve > 0
