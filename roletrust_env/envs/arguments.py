"""Checks of the arguments of environments."""

from collections.abc import Callable, Iterable, Mapping
from inspect import Parameter, signature
from typing import Any, Literal, TypeVar, get_args

import gymnasium

from roletrust_env.errors import short
from roletrust_env.frozen import Frozen
from roletrust_env.game.policy import Policy
from roletrust_env.memory import check_memory
from roletrust_env.randomness import own_seeds
from roletrust_env.trees import arrays
from roletrust_env.trust import TrustModel
from roletrust_env.world import Scenario
from roletrust_env.world.roster import shown

Space = TypeVar("Space")


Engine = Literal["rules", "compiled"]
"""What plays the rounds: the rules on NumPy, or `roletrust_env.compiled`."""


def is_compiled(engine: str) -> bool:
    """Return whether an engine is the compiled one.

    Raises:
        ValueError: There is no such engine.
    """
    if engine not in get_args(Engine):
        known = " or ".join(map(repr, get_args(Engine)))
        raise ValueError(f"engine must be {known}, got {engine!r}")
    return engine == "compiled"


def refuse_changeable(parts: Iterable[Any]) -> None:
    """Refuse trust models and policies that may change, since compiled rounds have their attributes
    as constants.

    Raises:
        ValueError: A part has attributes that can be assigned.
    """
    for part in parts:
        settings, attributes = (
            getattr(part, "__dataclass_params__", None),
            getattr(part, "__dict__", {}),
        )
        frozen = isinstance(part, Frozen) or (settings is not None and settings.frozen)
        if attributes and not frozen:
            raise ValueError(
                f"engine 'compiled' needs parts that cannot change, got {part!r}; make "
                f"{type(part).__name__} a frozen dataclass"
            )
        refuse_changeable(
            value for value in attributes.values() if isinstance(value, Policy | TrustModel)
        )


def refuse_unknown(
    environment: type[Any], arguments: Iterable[str], *takers: Callable[..., Any]
) -> None:
    """Refuse an unknown keyword argument, with the message of Python itself, which some libraries
    look for.

    Args:
        environment: Class that was called.
        arguments: Names of keyword arguments.
        takers: Functions that take the arguments, beside `Scenario.change`.

    Raises:
        TypeError: An argument is no parameter of the takers, no field of a scenario and not
            `noise`.
    """
    callables: tuple[Callable[..., Any], ...] = (environment, *takers)
    parameters = [p for taker in callables for p in signature(taker).parameters.values()]
    named = [p.name for p in parameters if p.kind is not Parameter.VAR_KEYWORD]
    known = list(dict.fromkeys([*named, *Scenario.model_fields, "noise"]))
    for name in arguments:
        if name not in known:
            raise TypeError(
                f"{environment.__name__}.__init__() got an unexpected keyword argument {name!r}; "
                f"known are {', '.join(known)}"
            )


def refuse_empty_start(scenario: Scenario) -> None:
    """Refuse a scenario in which nobody is there at first, for an environment whose episode ends
    with nobody there.

    Raises:
        ValueError: Every group joins late.
    """
    if all(group.joins > 0 or group.join_rate < 1 for group in scenario.agents):
        raise ValueError(
            "agents: every group joins late; an episode begins with a group of joins 0, join_rate 1"
        )


def check_games(name: str, games: int, game: Any) -> None:
    """Refuse a batch whose state alone would not fit into the memory.

    Args:
        name: Argument that sets the number of games.
        games: Number of games.
        game: State of one game, with what is observed of it.

    Raises:
        ValueError: It does not fit. The message says about how many games do.
    """
    check_memory(
        f"{name}:", games, float(sum(getattr(array, "nbytes", 8) for array in arrays(game)))
    )


def seed_spaces(spaces: Mapping[str, gymnasium.Space[Any]], seed: int | None) -> None:
    """Seed the spaces of all agents, also of those who join later, whom nobody else can seed in
    time; None does not.
    """
    if seed is not None:
        for own, space in zip(own_seeds(int(seed), len(spaces)), spaces.values(), strict=True):
            space.seed(own)


def option(options: Any, name: str) -> Any:
    """Return one of the options of `reset`; None if it is not there.

    Raises:
        ValueError: The options are no dict.
    """
    if not isinstance(options, Mapping | None):
        raise ValueError(
            f"options are {short(repr(options))}; they must be a dict from name to value, or None"
        )
    return (options or {}).get(name)


def space_of(agent: str, spaces: Mapping[str, Space]) -> Space:
    """Return the space of an agent.

    Raises:
        ValueError: There is no such agent.
    """
    try:
        return spaces[agent]
    except (KeyError, TypeError):
        raise ValueError(f"there is no agent {agent!r}; there are {shown(list(spaces))}") from None
