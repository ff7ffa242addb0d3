"""Scripted attacks of a task as a search space: defaults, and a cube of all parameters.

The class of an attack declares the space on its fields. A field whose type has a range (`Share`,
`Annotated[PositiveInt, SearchRange(1, 12)]`), the choices of a `Literal`, the places of `Victims`
and the number of `Identities` are coordinates, in the order of the class's signature. A field
marked `NotSearched`, and every other field, keeps its default. The exceptions are facts of the
game: `Accomplices` and `GameLength`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass, fields, is_dataclass
from functools import partial
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from pydantic import ValidationError

from roletrust_env.arrays import Array
from roletrust_env.errors import validation_message
from roletrust_env.evaluation.attackers import HONEST_POLICY, Both
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.policy import Channel, Policy, policy_name
from roletrust_env.game.policy import registry as attackers
from roletrust_env.parameters import (
    Accomplices,
    GameLength,
    Identities,
    NotSearched,
    SearchRange,
    Victims,
)

AttackKind = Callable[..., Policy]
"""Class of a policy, or a `functools.partial` of it that fixes some parameters."""

ParameterRange = SearchRange | Victims | Identities | tuple[Any, ...]
"""Range of a parameter in a search: an interval, victims, identities, or the options of a
`Literal`."""


class Space:
    """The attacks of one kind, as a cube of their parameters.

    Args:
        kind: Kind of attack.
        victims: Indices of the honest providers on the provider axis.
        accomplices: Indices of the attacker's own providers.
        length: Number of rounds of the game.
        reserve: Number of identities that the attacker has in reserve.

    Raises:
        ValueError: A parameter without a range and without a fixed value has no default, or the
            fields of the class cannot be read.

    Attributes:
        default: Attack with the default parameters.
        channels: Channels of that attack.
    """

    def __init__(
        self,
        kind: AttackKind,
        victims: tuple[int, ...],
        accomplices: tuple[int, ...],
        length: int,
        reserve: int = 0,
    ) -> None:
        self._make: Any
        self._make, given = (kind.func, kind.keywords) if isinstance(kind, partial) else (kind, {})
        self._fixed = {**declared_facts(self._make, accomplices, length), **given}
        hints = _hints(self._make)
        self.default = self._policy()
        self.channels: frozenset[Channel] = self.default.attacks
        self._coordinates = {
            name: _value_at(range, hints[name], victims, reserve)
            for name, range in declared_ranges(self._make).items()
            if name not in self._fixed
        }

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self._coordinates)

    def decode(self, point: Sequence[float] | Array) -> Policy:
        """Return the attack at a point of the cube [0, 1] ** size; further coordinates are
        ignored.
        """
        values = {
            name: value_at(float(point[k]))
            for k, (name, value_at) in enumerate(self._coordinates.items())
        }
        return self._policy(**values)

    def _policy(self, **parameters: Any) -> Policy:
        given = {**self._fixed, **parameters}
        try:
            policy = self._make(**given)
        except (ValidationError, TypeError, ValueError) as error:
            why = validation_message(error) if isinstance(error, ValidationError) else error
            raise ValueError(
                f"attack {self._make.__name__} cannot be searched, it refuses {given}: {why}"
            ) from None
        if not isinstance(policy, Policy):
            raise ValueError(
                f"attack {self._make.__name__} cannot be searched, it makes {policy!r}, no Policy"
            )
        return policy


class Mixture:
    """A mixture of kinds of attack: the first coordinate picks the kind, the others are its
    parameters.

    A single kind needs no such coordinate. All kinds read the same coordinates, so the cube grows
    with the largest kind and not with their number. A mixture of no kinds is honest play.

    Args:
        spaces: Search spaces of the kinds.
    """

    def __init__(self, spaces: Sequence[Space]) -> None:
        self._spaces = tuple(spaces)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return max((space.size for space in self._spaces), default=0) + (len(self._spaces) > 1)

    @property
    def default(self) -> Policy:
        """Default of the first kind."""
        return self._spaces[0].default if self._spaces else HONEST_POLICY

    def decode(self, point: Sequence[float] | Array) -> Policy:
        """Return the attack at a point of the cube [0, 1] ** size."""
        if not self._spaces:
            return HONEST_POLICY
        if len(self._spaces) == 1:
            return self._spaces[0].decode(point)
        return self._spaces[_part(float(point[0]), len(self._spaces))].decode(point[1:])


def declared_facts(kind: Any, accomplices: tuple[int, ...], length: int) -> dict[str, Any]:
    """Return the facts of the game that a kind of attack declares as parameters, by the parameter's
    name.

    Args:
        kind: Class of the attack.
        accomplices: Indices of the attacker's own providers on the provider axis; an empty tuple is
            left out.
        length: Number of rounds of the game.
    """
    known = ((Accomplices, accomplices), (GameLength, length))
    hints = _hints(kind).items()
    return {
        name: fact for name, hint in hints for mark, fact in known if fact and _mark(hint, mark)
    }


def declared_ranges(kind: Any) -> dict[str, ParameterRange]:
    """Return the search ranges that a kind of attack declares, by the parameter's name."""
    ranges = {name: _declared(hint) for name, hint in _hints(kind).items()}
    return {name: range for name, range in ranges.items() if range is not None}


def as_spec(policy: Policy) -> str:
    """Return the spec of a policy, as `--attack` takes it: its name and its parameters with a range
    or another value.

    Numbers are rounded, and of many indices only the first and the last are shown.
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


def _value_at(
    declared: ParameterRange, hint: Any, victims: tuple[int, ...], reserve: int
) -> Callable[[float], Any]:
    """Return the function from a position in [0, 1] to the value of a field with a range."""
    if isinstance(declared, Victims):
        return _first_of(victims)
    if isinstance(declared, Identities):
        return _whole(1, max(1, reserve))
    if isinstance(declared, SearchRange):
        low, high = declared.low, declared.high
        return _whole(int(low), int(high)) if _bare(hint) is int else _between(low, high)
    return _one_of(declared)


def _declared(hint: Any) -> ParameterRange | None:
    """Return the search range of a type; None without one."""
    if _mark(hint, NotSearched):
        return None
    options = get_args(_bare(hint)) if get_origin(_bare(hint)) is Literal else None
    declared: ParameterRange | None = (
        _mark(hint, Victims) or _mark(hint, Identities) or options or _mark(hint, SearchRange)
    )
    return declared


def _bare(hint: Any) -> Any:
    """Return a type without its annotations."""
    return get_args(hint)[0] if get_origin(hint) is Annotated else hint


def _fields(kind: Any) -> list[Field[Any]]:
    """Return the fields of a dataclass in the order of its signature; other classes have none."""
    known = fields(kind) if isinstance(kind, type) and is_dataclass(kind) else ()
    return sorted((field for field in known if field.init), key=lambda field: bool(field.kw_only))


def _hints(kind: Any) -> dict[str, Any]:
    """Return the types of the fields with their annotations."""
    names = [field.name for field in _fields(kind)]
    try:
        known = get_type_hints(kind, include_extras=True) if names else {}
    except NameError as error:
        raise ValueError(
            f"attack {kind.__name__} cannot be searched: the types of its fields say {error}"
        ) from None
    return {name: known[name] for name in names}


def _mark(hint: Any, kind: type[Any]) -> Any:
    """Return the last annotation of a class on a type; None without one."""
    marks = [mark for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, kind)]
    return marks[-1] if marks else None


def _part(x: float, parts: int) -> int:
    """Return the index of the part of [0, 1] that holds x, of some equal parts."""
    return min(int(x * parts), parts - 1)


def _between(low: float, high: float) -> Callable[[float], Any]:
    return lambda x: low + x * (high - low)


def _whole(low: int, high: int) -> Callable[[float], Any]:
    return lambda x: low + _part(x, high - low + 1)


def _one_of(options: tuple[Any, ...]) -> Callable[[float], Any]:
    return lambda x: options[_part(x, len(options))]


def _first_of(indices: tuple[int, ...]) -> Callable[[float], Any]:
    """Return a function from [0, 1] to the first of some indices, at least one; to None where there
    are none.
    """
    return lambda x: indices[: 1 + _part(x, len(indices))] or None


_PAPER_ATTACKS = ("on-off", "bad-mouthing")

SERVING_CHANNELS: frozenset[Channel] = frozenset({"quality", "treatment"})
RATING_CHANNELS: frozenset[Channel] = frozenset({"ratings", "silence", "claims"})


def paper_attacks() -> tuple[AttackKind, ...]:
    """Return the paper's attacks: a provider attacks on and off, a rater by bad-mouthing, an SR+SP
    agent by both.
    """
    return tuple(attackers.factory(name) for name in _PAPER_ATTACKS)


@dataclass(frozen=True)
class Scripts:
    """The scripted attacks that the compromised agents of a task can play.

    An agent without an attack for its role plays honestly. An SR+SP agent serves by one attack and
    rates by another.

    Attributes:
        agents: Compromised agents: the name, whether it attacks by its services, and whether by its
            ratings.
        serving: Attacks by services.
        rating: Attacks by ratings.
        alike: Whether all agents of a role play the same attack.
    """

    agents: tuple[tuple[str, bool, bool], ...]
    serving: Mixture
    rating: Mixture
    alike: bool = False

    @classmethod
    def of(
        cls, task: AttackTask, attacks: Sequence[AttackKind] | None = None, alike: bool = False
    ) -> "Scripts":
        """Return the scripts of a task: honest providers are the victims, compromised ones the
        accomplices.

        Args:
            task: Task with the compromised agents.
            attacks: Kinds of attack; several for one role are a mixture. None are the attacks of
                the paper that fit.
            alike: Whether all agents of a role play the same attack.

        Raises:
            ValueError: No compromised agent can play a kind, a compromised agent has fewer
                identities in reserve than a kind needs, or a kind cannot be searched, see `Space`.
        """
        roster, bad = task.game.roster, {*task.identities, *task.joint_policy.attackers}
        providers = list(enumerate(roster.provider_names))
        victims = tuple(index for index, name in providers if name not in bad)
        accomplices = tuple(index for index, name in providers if name in task.identities)
        owners = list(roster.owners.values())
        reserve = min(owners.count(name) - 1 for name in task.compromised)
        facts = victims, accomplices, task.game.scenario.max_cycles, reserve
        spaces = [Space(kind, *facts) for kind in (paper_attacks() if attacks is None else attacks)]
        roles = ((SERVING_CHANNELS, roster.provider_names), (RATING_CHANNELS, roster.rater_names))
        decided = {
            channel
            for by, names in roles
            if not set(names).isdisjoint(task.compromised)
            for channel in by
        }
        for space in spaces if attacks is not None else ():
            if space.default.reserve > reserve:
                raise ValueError(
                    f"{as_spec(space.default)} needs a reserve of {space.default.reserve}, and of "
                    f"{', '.join(task.compromised)} one has {reserve}; a group's reserve gives it "
                    "identities"
                )
            if not space.channels & decided:
                by, who = (
                    " and ".join(sorted(space.channels)) or "nothing",
                    ", ".join(task.compromised),
                )
                raise ValueError(
                    f"{as_spec(space.default)} attacks by {by}, on which no compromised agent "
                    f"decides: {who}"
                )
        serving, rating = ([space for space in spaces if space.channels & by] for by, _ in roles)
        agents = tuple(
            (
                name,
                bool(serving) and name in roster.provider_names,
                bool(rating) and name in roster.rater_names,
            )
            for name in task.compromised
        )
        return cls(agents, Mixture(serving), Mixture(rating), alike)

    @property
    def size(self) -> int:
        """Number of parameters; each agent has its own, unless all play alike."""
        if self.alike:
            return self.serving.size + self.rating.size
        return sum(
            self.serving.size * serves + self.rating.size * rates
            for _, serves, rates in self.agents
        )

    @property
    def roles(self) -> tuple[bool, bool]:
        """True where some agent attacks: first by its services, second by its ratings."""
        return any(serves for _, serves, _ in self.agents), any(
            rates for _, _, rates in self.agents
        )

    @property
    def default(self) -> dict[str, Policy]:
        """First attack of each role with its default parameters."""
        return self._all(self.serving.default, self.rating.default)

    def decode(self, point: Sequence[float] | Array) -> dict[str, Policy]:
        """Return the attack at a point of the cube [0, 1] ** size."""
        if self.alike:
            return self._all(
                self.serving.decode(point), self.rating.decode(point[self.serving.size :])
            )
        policies, at = {}, 0
        for name, *channels in self.agents:
            roles = []
            for mixture, attacks in zip((self.serving, self.rating), channels, strict=True):
                if attacks:
                    roles.append(mixture.decode(point[at : at + mixture.size]))
                    at += mixture.size
            policies[name] = (
                Both(*roles) if len(roles) == 2 else roles[0] if roles else HONEST_POLICY
            )
        return policies

    def _all(self, serving: Policy, rating: Policy) -> dict[str, Policy]:
        both = Both(serving, rating)
        return {
            name: both
            if serves and rates
            else serving
            if serves
            else rating
            if rates
            else HONEST_POLICY
            for name, serves, rates in self.agents
        }


def with_paper(task: AttackTask, kind: AttackKind) -> tuple[AttackKind, ...]:
    """Return a kind of attack, and the attack of the paper for a compromised role that it leaves
    out.

    Args:
        task: Task with the compromised agents.
        kind: Kind of attack that one of them can play.
    """
    roles = zip(
        paper_attacks(), Scripts.of(task).roles, Scripts.of(task, [kind]).roles, strict=True
    )
    return (kind, *(paper for paper, compromised, covered in roles if compromised and not covered))


def describe_attack(attack: Mapping[str, Policy]) -> str:
    """Return an attack in a few words. Agents with the same policy stand together."""
    agents: dict[str, list[str]] = {}
    for name, policy in attack.items():
        roles = (policy.serves, policy.rates) if isinstance(policy, Both) else (policy,)
        agents.setdefault(" and ".join(map(as_spec, roles)), []).append(name)
    return "; ".join(f"{', '.join(names)}: {text}" for text, names in agents.items())
