"""Worlds that are drawn from a distribution, and their compromised agents.

A table of worlds is one of a scenario with draws in place of values. `{ low = 5, high = 25 }` is a
number between two, both included, a whole one if both are. `{ choices = [...] }` is one of several
values. Draws may stand anywhere, also in lists and in choices. Each draw has random numbers of its
own, by the seed, the world and the place of the draw: more worlds leave the first ones as they are,
and further draws leave the others.
"""

from collections.abc import Iterator
from functools import cache
from random import Random
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from roletrust_env.benchmarking.schema import Label
from roletrust_env.world import Scenario, make_scenario
from roletrust_env.world.group import AgentGroup, FrozenModel
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Choice

Use = Literal["selection", "measured"]
"""Use of a world: to choose attacks, or to measure them."""

SPREAD = 0.15
"""Least mean of best - blind. Worlds in which choosing matters less are drawn again."""

_TRIES = 100
_DIGITS = 3  # after the point
_MOST = 1_000_000  # of an end of a range, either way


def draw(value: Any, place: str) -> Any:
    """Return a value with its draws replaced.

    Args:
        value: Plain data.
        place: Seed, world and place in its table, as text that seeds the draw.
    """
    if isinstance(value, tuple):
        return [draw(part, f"{place}|{k}") for k, part in enumerate(value)]
    if not isinstance(value, dict):
        return value
    part = Random(place).random()  # in [0, 1)
    if value.keys() == {"low", "high"}:
        low, high = value["low"], value["high"]
        if (
            not all(type(end) in (int, float) and abs(end) <= _MOST for end in (low, high))
            or low > high
        ):
            raise ValueError(
                f"{place}: low is {low!r:.20} and high {high!r:.20}; they must be numbers from "
                f"{-_MOST} to {_MOST}, "
                "the lower one first"
            )
        whole = type(low) is type(high) is int
        if whole:
            return low + int(part * (high - low + 1))
        return min(max(round(low + part * (high - low), _DIGITS), low), high)
    if value.keys() == {"choices"}:
        choices = value["choices"]
        if not isinstance(choices, tuple) or not choices:
            raise ValueError(
                f"{place}: choices are {choices!r:.300}; they must be a list with one value or more"
            )
        return draw(choices[int(part * len(choices))], f"{place}|choice")
    return {name: draw(field, f"{place}|{name}") for name, field in value.items()}


class Distribution(FrozenModel):
    """A distribution of worlds. Tables of the form `{ low, high }` and `{ choices }` are drawn, see
    `draw`.
    """

    preset: Label
    """Name of a scenario in which raters choose providers, or path of its file."""
    set: dict[str, Any] = Field(default_factory=dict)
    """Changed fields of the scenario, with draws in place of values."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Random seed of the worlds. Another seed draws other worlds."""
    selection: Annotated[int, Field(ge=1, le=1000)] = 12
    """Number of worlds in which attacks are searched and chosen."""
    measured: Annotated[int, Field(ge=2, le=1000)] = 30
    """Number of worlds in which attacks are measured; none of them is one of the selection."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        world = self.world("measured", 0)
        if not isinstance(world.access, Choice):
            raise ValueError(
                f"preset {self.preset!r} has access {world.access.kind!r}; it must be 'choice'"
            )
        return self

    def worlds(self, use: Use) -> tuple[Scenario, ...]:
        """Return the worlds of a use."""
        return _worlds(self.model_dump_json(), use)

    def world(self, use: Use, number: int) -> Scenario:
        """Return one world of a use.

        Raises:
            ValueError: A draw or a scenario is not valid, or no world has the spread `SPREAD`.
        """
        base = make_scenario(self.preset)
        for attempt in range(_TRIES):
            place = f"{self.seed}|{use}-{number}" + (f"|{attempt}" if attempt else "")
            drawn = {name: draw(value, f"{place}|{name}") for name, value in self.set.items()}
            world = base.change(**drawn) if drawn else base
            if expected_spread(world) >= SPREAD:
                return world
        raise ValueError(
            f"no world of preset {self.preset!r} has a mean of best - blind of {SPREAD} or more"
        )


@cache
def _worlds(distribution: str, use: Use) -> tuple[Scenario, ...]:
    drawn = Distribution.model_validate_json(distribution, strict=False)
    return tuple(drawn.world(use, k) for k in range(getattr(drawn, use)))


def expected_spread(world: Scenario) -> float:
    """Return the expected difference between the mean of the n largest abilities and the mean
    ability of the providers, for n services in a round.

    The k-th largest of P uniform numbers in [0, 1] has the mean 1 - k / (P + 1). Groups of
    providers count by the mean of their ranges.
    """
    groups = [group for group in world.agents if group.role != "SR"]
    ranges = np.array([np.broadcast_to(group.ability, 2) for group in groups])
    counts = np.array([group.count for group in groups])
    low, high = np.average(ranges, axis=0, weights=counts)
    services = world.access.providers if isinstance(world.access, Choice) else 1
    best = 1 - (services + 1) / 2 / (counts.sum() + 1)
    return float((high - low) * (best - 0.5))


class AttackedWorld(NamedTuple):
    """A world with the names of its compromised agents."""

    scenario: Scenario
    compromised: tuple[str, ...]


def compromise(
    world: Scenario, roles: tuple[str, ...], share: float, reserve: int = 0
) -> AttackedWorld:
    """Return a world in which a share of the agents of some roles is compromised.

    They are the last ones of each group of the role, so that they differ from honest agents in
    nothing else. With identities in reserve, the share limits all identities of compromised agents
    among all identities.

    Args:
        world: World in which all agents are honest.
        roles: Roles of the compromised agents.
        share: Share of them in each role.
        reserve: Number of identities in reserve of each compromised agent.

    Raises:
        ValueError: A role has too few agents: one at least must be compromised, and one honest.
    """
    bad = dict[int, int]()
    for role in roles:
        groups = [k for k, group in enumerate(world.agents) if group.role == role]
        counts = [world.agents[k].count for k in groups]
        # n agents with r reserve identities each are a share x of N + r n identities if n (1 + r) =
        # x (N + r n).
        number = max(1, round(share * sum(counts) / (1 + reserve - share * reserve)))
        if number >= sum(counts):
            raise ValueError(
                f"{number} of {sum(counts)} agents with the role {role} would be compromised; at "
                "least one must be honest"
            )
        bad |= dict(zip(groups, _apportioned(number, counts), strict=True))
    split = [part for k, group in enumerate(world.agents) for part in _split(group, bad.get(k, 0))]
    agents = [
        {**group.model_dump(), "reserve": reserve if compromised else group.reserve}
        for group, compromised in split
    ]
    scenario = world.change(agents=agents)
    roster = Roster.of(scenario)
    flags = [compromised for group, compromised in split for _ in range(group.count)]
    names = zip(_owners_by_group(roster, scenario), flags, strict=True)
    return AttackedWorld(scenario, tuple(name for name, compromised in names if compromised))


def _split(group: AgentGroup, bad: int) -> Iterator[tuple[AgentGroup, bool]]:
    """Yield the honest and the compromised part of a group, each with whether it is compromised."""
    for count, compromised in ((group.count - bad, False), (bad, True)):
        if count:
            yield group.model_copy(update={"count": count}), compromised


def _apportioned(number: int, counts: list[int]) -> list[int]:
    """Return a number in parts that are proportional to counts, by the largest remainders."""
    quotas = number * np.array(counts) / sum(counts)
    parts = np.floor(quotas).astype(int)
    rest = np.argsort(-(quotas - parts), kind="stable")[: number - parts.sum()]
    parts[rest] += 1
    return [int(part) for part in parts]


def _owners_by_group(roster: Roster, scenario: Scenario) -> list[str]:
    """Return the names of the agents without identities in reserve, group by group."""
    of_role: dict[str, list[str]] = {}
    for name in roster.owner_names:
        of_role.setdefault(roster.role(name), []).append(name)
    names = {role: iter(agents) for role, agents in of_role.items()}
    return [next(names[group.role]) for group in scenario.agents for _ in range(group.count)]
