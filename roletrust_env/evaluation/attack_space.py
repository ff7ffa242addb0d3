"""The attacks of one kind as points to search: what a policy's class declares on its fields, whatever the class.

A field whose type has a range (`Share`, `Annotated[PositiveInt, SearchRange(1, 12)]`), the choices of a `Literal`, the
places of `Victims` and the number of `Identities` are coordinates, in the order of the class's signature. A field
marked `NotSearched`, and every other field, keeps its default. `Accomplices` and `GameLength` are filled in.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import Field, fields, is_dataclass
from functools import partial
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from pydantic import ValidationError

from roletrust_env.arrays import Array
from roletrust_env.errors import explain
from roletrust_env.game.policy import Channel, Policy, policy_name
from roletrust_env.ranges import Accomplices, GameLength, GridValues, Identities, NotSearched, SearchRange, Victims

Kind = Callable[..., Policy]
"""A policy's class, or `functools.partial` of one where some of its parameters are fixed."""

Declared = SearchRange | Victims | Identities | tuple[Any, ...]
"""Where searches look for a parameter: in a range, among victims, identities, or the options of a `Literal`."""

HONEST = Policy()


class Axis(NamedTuple):
    """One coordinate.

    Attributes:
        name: of the parameter.
        at: its value at a place in [0, 1].
        tried: the values that a grid tries.
    """

    name: str
    at: Callable[[float], Any]
    tried: tuple[Any, ...]


class Space:
    """The attacks of one kind, as a cube and as a grid.

    Args:
        kind: of the attacks.
        victims: places of the honest providers on the provider axis.
        accomplices: places of the attacker's own providers there.
        length: of the game, in rounds.
        reserve: identities in reserve that the attacker has.

    Raises:
        ValueError: the kind has no defaults for what is neither searched nor fixed, or its fields cannot be read.

    Attributes:
        default: the attack with the default parameters.
        channels: on which that attacks.
    """

    def __init__(
        self, kind: Kind, victims: tuple[int, ...], accomplices: tuple[int, ...], length: int, reserve: int = 0
    ) -> None:
        self._make: Any
        self._make, given = (kind.func, kind.keywords) if isinstance(kind, partial) else (kind, {})
        self._fixed = {**told(self._make, accomplices, length), **given}
        hints = _hints(self._make)
        free = [name for name in hints if name not in self._fixed]
        self.default = self._made()
        self.channels: frozenset[Channel] = self.default.attacks
        axes = (_axis(name, hints[name], getattr(self.default, name, None), victims, reserve) for name in free)
        self._axes = [axis for axis in axes if axis is not None]

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self._axes)

    @property
    def grid(self) -> list[Policy]:
        """A few values of each parameter, all in combination."""
        names = [axis.name for axis in self._axes]
        rows = itertools.product(*(axis.tried for axis in self._axes))
        return [self._made(**dict(zip(names, row, strict=True))) for row in rows]

    def decode(self, point: Sequence[float] | Array) -> Policy:
        """The attack at a point of the cube [0, 1] ** size; further coordinates count for nothing."""
        return self._made(**{axis.name: axis.at(float(point[k])) for k, axis in enumerate(self._axes)})

    def _made(self, **parameters: Any) -> Policy:
        given = {**self._fixed, **parameters}
        try:
            policy = self._make(**given)
        except (ValidationError, TypeError, ValueError) as error:
            why = explain(error) if isinstance(error, ValidationError) else error
            raise ValueError(f"attack {self._make.__name__} cannot be searched, it refuses {given}: {why}") from None
        if not isinstance(policy, Policy):
            raise ValueError(f"attack {self._make.__name__} cannot be searched, it makes {policy!r}, no Policy")
        return policy


class Mixture:
    """Attacks of some kinds: one coordinate picks the kind, if there are several, and the others are its parameters.

    All kinds read the same coordinates, so that the cube grows with the largest of them and not with their number.
    Without any kind it is honest play.
    """

    def __init__(self, spaces: Sequence[Space]) -> None:
        self._spaces = tuple(spaces)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return max((space.size for space in self._spaces), default=0) + (len(self._spaces) > 1)

    @property
    def default(self) -> Policy:
        """The first kind's default."""
        return self._spaces[0].default if self._spaces else HONEST

    @property
    def grid(self) -> list[Policy]:
        """The grids of all kinds, one after the other."""
        return [policy for space in self._spaces for policy in space.grid]

    def decode(self, point: Sequence[float] | Array) -> Policy:
        """The attack at a point of the cube [0, 1] ** size."""
        if len(self._spaces) == 1:
            return self._spaces[0].decode(point)
        return self._spaces[_part(float(point[0]), len(self._spaces))].decode(point[1:])


def told(kind: Any, accomplices: tuple[int, ...], length: int) -> dict[str, Any]:
    """What an attack of a kind asks to be told of the game, by its parameters.

    Args:
        kind: the class of the attack.
        accomplices: places of the attacker's own providers on the provider axis; it is not told of none.
        length: of the game, in rounds.
    """
    known = ((Accomplices, accomplices), (GameLength, length))
    hints = _hints(kind).items()
    return {name: fact for name, hint in hints for mark, fact in known if fact and _mark(hint, mark)}


def searched(kind: Any) -> dict[str, Declared]:
    """What is searched of the attacks of a kind, by parameter: see `Declared`.

    Args:
        kind: the class of the attack.
    """
    found = {name: _declared(hint) for name, hint in _hints(kind).items()}
    return {name: range for name, range in found.items() if range is not None}


def words(policy: Policy) -> str:
    """A policy as `roletrust play --attack` takes it: its name, and all that is searched or not as usual.

    Numbers are rounded, and of many places the first and the last are given.
    """
    parts = []
    usual = {field.name: field.default for field in _fields(type(policy))}
    for name, hint in _hints(type(policy)).items():
        value = getattr(policy, name)
        if value is not None and (_declared(hint) or value != usual[name]):
            parts.append(f"{name}={_short(value)}")
    return f"{policy_name(policy)}:{','.join(parts)}" if parts else policy_name(policy)


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.2g}"
    if isinstance(value, tuple):
        items = [str(item) for item in value]
        return f"[{','.join(items if len(items) <= 4 else [items[0], '...', items[-1]])}]"
    return str(value)


def _axis(name: str, hint: Any, usual: Any, victims: tuple[int, ...], reserve: int) -> Axis | None:
    """The coordinate that a field declares, if it does."""
    declared = _declared(hint)
    tried: tuple[Any, ...]
    if declared is None:
        return None
    if isinstance(declared, Victims):
        at, tried = _first_of(victims), (usual, victims[:1]) if len(victims) > 1 else (usual,)
    elif isinstance(declared, Identities):
        at, tried = _whole(1, max(1, reserve)), tuple({1, max(1, reserve)})
    elif isinstance(declared, SearchRange):
        low, high = declared.low, declared.high
        at = _whole(int(low), int(high)) if _bare(hint) is int else _between(low, high)
        tried = tuple(dict.fromkeys(at(x) for x in (0.0, 0.5, 1.0)))
    else:
        at, tried = _one_of(declared), declared
    chosen = _mark(hint, GridValues)
    return Axis(name, at, chosen.values if chosen else tried)


def _declared(hint: Any) -> Declared | None:
    """Where searches look for a parameter of a type, if anywhere."""
    if _mark(hint, NotSearched):
        return None
    options = get_args(_bare(hint)) if get_origin(_bare(hint)) is Literal else None
    found: Declared | None = _mark(hint, Victims) or _mark(hint, Identities) or options or _mark(hint, SearchRange)
    return found


def _bare(hint: Any) -> Any:
    """A type without what is annotated to it."""
    return get_args(hint)[0] if get_origin(hint) is Annotated else hint


def _fields(kind: Any) -> list[Field[Any]]:
    """The fields of a dataclass in the order of its signature; none of what is no dataclass."""
    known = fields(kind) if isinstance(kind, type) and is_dataclass(kind) else ()
    return sorted((field for field in known if field.init), key=lambda field: bool(field.kw_only))


def _hints(kind: Any) -> dict[str, Any]:
    """The types of these fields with what is annotated there."""
    names = [field.name for field in _fields(kind)]
    try:
        known = get_type_hints(kind, include_extras=True) if names else {}
    except NameError as error:
        raise ValueError(f"attack {kind.__name__} cannot be searched: the types of its fields say {error}") from None
    return {name: known[name] for name in names}


def _mark(hint: Any, kind: type[Any]) -> Any:
    """What of a kind is annotated to a type, the last if there are several; None without."""
    marks = [mark for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, kind)]
    return marks[-1] if marks else None


def _part(x: float, parts: int) -> int:
    """In which of some equal parts of [0, 1] a place is."""
    return min(int(x * parts), parts - 1)


def _between(low: float, high: float) -> Callable[[float], Any]:
    return lambda x: low + x * (high - low)


def _whole(low: int, high: int) -> Callable[[float], Any]:
    return lambda x: low + _part(x, high - low + 1)


def _one_of(options: tuple[Any, ...]) -> Callable[[float], Any]:
    return lambda x: options[_part(x, len(options))]


def _first_of(places: tuple[int, ...]) -> Callable[[float], Any]:
    """Some of the places, at least one; None where there are none."""
    return lambda x: places[: 1 + _part(x, len(places))] or None
