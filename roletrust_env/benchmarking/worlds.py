"""Worlds of a suite that are drawn from a distribution, which its file states in one place.

A table of worlds is one of a scenario with draws in place of values. `{ low = 5, high = 25 }` is a
number between two, both included, a whole one if both are. `{ choices = [...] }` is one of several
values. Draws may stand anywhere, also in lists and in choices. Each draw has random numbers of its
own, by the seed, the world and the place of the draw: more worlds leave the first ones as they are,
and further draws leave the others.
"""

from random import Random
from typing import Annotated, Any, NamedTuple

from pydantic import Field, ValidationError

from roletrust_env.errors import validation_message
from roletrust_env.world import Scenario
from roletrust_env.world.group import FrozenModel

_DIGITS = 3  # after the point
_MOST = 1_000_000  # of an end of a range, either way


class _Worlds(FrozenModel):
    """Table of worlds in a file. For the other fields see
    `roletrust_env.benchmarking.suite.Stage`.
    """

    number: Annotated[int, Field(ge=1, le=100)]
    seed: Annotated[int, Field(ge=0)] = 0
    preset: Any
    set: dict[str, Any] = Field(default_factory=dict)
    shares: Any = None
    methods: Any = None
    budgets: dict[str, Any] = Field(default_factory=dict)


def draw_worlds(tables: Any, seed: int | None = None, scenarios: Any = None) -> dict[str, Any]:
    """Return the scenarios of a suite with those that are drawn, as plain data: `name-1`, `name-2`
    and so on.

    Python promises equal random numbers for equal text in all versions and on all machines.

    Args:
        tables: Tables of worlds by name.
        seed: Seed that replaces those of the tables. None keeps them.
        scenarios: Scenarios that are not drawn, by name.

    Raises:
        ValueError: A table is wrong, a draw has no values, or a world has the name of a scenario.
    """
    if not isinstance(tables, dict) or not isinstance(scenarios or {}, dict):
        raise ValueError("worlds and scenarios must be tables by name")
    worlds = dict(scenarios or {})
    for name, data in tables.items():
        if not isinstance(data, dict):
            raise ValueError(f"worlds {name} is {data!r:.100}; it must be a table")
        try:
            table = _Worlds.model_validate(data)
        except ValidationError as error:
            raise ValueError(f"worlds {name}: {validation_message(error)}") from None
        fields = table.model_dump(exclude={"number", "seed"})
        for k in range(1, table.number + 1):
            world = f"{name}-{k}"
            if world in worlds:
                raise ValueError(f"worlds {name}: there is a scenario {world!r}, too")
            worlds[world] = draw(fields, f"{table.seed if seed is None else seed}|{world}")
    return worlds


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


class WorldRow(NamedTuple):
    """World of a suite for a table. Where groups of a role differ, a field has the values of each.

    Attributes:
        scenario: Name in the suite.
        raters: Number of raters.
        providers: Number of providers.
        lost: Share of ratings that are lost.
        noise: Noise of the raters' perception.
        bias: Bias of raters.
        scale: Scale of raters.
        ability: Ability of providers, with its drift and switch if it changes.
        access: Which providers serve a rater.
        rounds: Length of a game, the longest.
        continuation: Probability that it goes on after a round.
    """

    scenario: str
    raters: int
    providers: int
    lost: float
    noise: str
    bias: str
    scale: str
    ability: str
    access: str
    rounds: int
    continuation: float

    @classmethod
    def of(cls, name: str, world: Scenario) -> "WorldRow":
        """Return the row of a scenario."""
        raters = [group for group in world.agents if group.role != "SP"]
        providers = [group for group in world.agents if group.role != "SR"]
        own = {
            field: _text(getattr(rater, field) for rater in raters)
            for field in ("noise", "bias", "scale")
        }
        changes = [
            f"{field} {_text(getattr(group, field) for group in providers)}"
            for field in ("drift", "switch")
            if any(getattr(group, field) for group in providers)
        ]
        changed = world.access.model_dump(exclude_defaults=True)
        access = ", ".join(f"{field}={value}" for field, value in changed.items())
        return cls(
            name,
            sum(group.count for group in raters),
            sum(group.count for group in providers),
            world.ratings.lost,
            **own,
            ability=", ".join([_text(group.ability for group in providers), *changes]),
            access=f"{world.access.kind} {access}".rstrip(),
            rounds=world.max_cycles,
            continuation=world.continuation,
        )


def _text(values: Any) -> str:
    """Return different values, numbers or ranges, as text."""
    texts = (
        f"{value[0]:g} to {value[1]:g}" if isinstance(value, tuple) else f"{value:g}"
        for value in values
    )
    return ", ".join(dict.fromkeys(texts))
