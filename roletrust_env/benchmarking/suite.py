"""Suites of the closed loop: trust models, settings and ways to attack as immutable data, and their
cells.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, get_args

from pydantic import Field, PositiveInt, TypeAdapter, model_validator

from roletrust_env.benchmarking.schema import FORBIDDEN, Label, Name, SuiteSchema, check_unique
from roletrust_env.benchmarking.worlds import (
    AttackedWorld,
    Distribution,
    Use,
    compromise,
    draw,
)
from roletrust_env.evaluation.attackers import MAX_RECORD, Attacker, record_of
from roletrust_env.evaluation.received import RANGES
from roletrust_env.evaluation.specs import named_factory, parse_trust_model
from roletrust_env.game.policy import registry as attackers
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world import Scenario
from roletrust_env.world.group import FrozenModel
from roletrust_env.world.roster import Roster

Rule = Literal["common", "own"]
"""Choice rule of consumers: `common`, greedy by their own trust with forced exploration, or the
`own` rule of the trust model."""

Method = Literal["scripts", "replayed", "search"]
"""Way to attack: scripted attacks with default parameters, attacks that somebody found, or a search
over scripted attacks and their parameters."""


_HONEST: tuple[Literal["honest"]] = ("honest",)
_POSITIVE = TypeAdapter(PositiveInt)

RULES: tuple[Rule, ...] = ("common", "own")


class Setting(FrozenModel):
    """Compromised agents, and what they and all others may report."""

    roles: tuple[Literal["SR", "SP"], ...] = ()
    """Roles of the compromised agents: raters, providers or both. Without a role all are honest."""
    share: Annotated[float, Field(ge=0, lt=1)] = 0.0
    """Share of compromised agents in each of these roles. The number is rounded and at least
    one."""
    reserve: Annotated[int, Field(ge=0, le=100)] = 0
    """Identities in reserve of each compromised agent. Then the share is that of all identities of
    compromised agents among all identities, and only attacks that use them are played."""
    reports: Literal["verified", "open"] = "verified"
    """Reports: `verified`, one for each service, or `open`, a number in each round, also without a
    service."""
    silent: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Share of the honest raters that send no reports; if positive, one at least."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if bool(self.roles) != bool(self.share):
            raise ValueError(
                f"roles are {self.roles} and share is {self.share}; both must be given, or none"
            )
        if self.reserve and not self.roles:
            raise ValueError(f"reserve is {self.reserve}, but the setting has no compromised agent")
        if self.silent and self.roles:
            raise ValueError(f"silent is {self.silent}; it is for settings without attackers")
        return self


class ReplayedAttack(FrozenModel):
    """An attack that somebody found, and that plays again without a search."""

    name: Name
    """Name in tables, which says how it was found and against which trust model."""
    setting: Label
    """Name of the setting in the suite."""
    finder: Annotated[str, Field(max_length=300, pattern=r"^[^\x00-\x1f\x7f]*$")] = ""
    """Who found the attack. Empty for the project."""
    record: Annotated[str, Field(min_length=1, max_length=MAX_RECORD)]
    """Record of the attacker, see `roletrust_env.evaluation.attackers`."""


class Search(FrozenModel):
    """Budget of a search for an attack, the same for each trust model and setting."""

    candidates: PositiveInt = 24
    """Number of attacks that each start tries after the scripted ones, in generations of eight, at
    least one."""
    games: PositiveInt = 2
    """Number of games in each selection world in which they are tried."""
    starts: Annotated[int, Field(ge=1, le=10)] = 2
    """Number of independent starts."""


class Cell(NamedTuple):
    """Smallest unit of a benchmark: a trust model in a setting under one way to attack.

    Attributes:
        model: Spec of the trust model.
        rule: Choice rule of the consumers.
        setting: Name of the setting in the suite.
        method: Way to attack, or `honest` in a setting without compromised agents. All cells of a
            suite play the same games.
    """

    model: str
    rule: Rule
    setting: str
    method: Method | Literal["honest"]

    @property
    def key(self) -> str:
        """Unique key of the cell in its suite."""
        return "|".join(map(str, self))


class Suite(SuiteSchema):
    """Benchmark of trust models in the closed loop: models x settings x ways to attack.

    Attacks are chosen in some worlds, and measured in others.
    """

    cell_type: ClassVar = Cell
    field_hints: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("preset", "set", "scenario", "scenarios"), "did you mean 'preset' and 'set' of 'worlds'?"
    )
    chosen_scores: ClassVar = {"skill": RANGES["skill"]}
    measured_scores: ClassVar = RANGES
    kind: Literal["closed-loop"] = "closed-loop"
    """Type of the suite."""
    version: str = ""
    """Version of the suite. Numbers of different versions do not compare."""
    games: Annotated[int, Field(ge=1, le=100_000)] = 8
    """Number of games in each measured world."""
    selection_games: PositiveInt = 4
    """Number of games in each selection world, in which the worst attack of a cell is chosen."""
    models: tuple[Label, ...]
    """Specs of trust models."""
    own: tuple[Label, ...] = ()
    """Those that are also played by their own choice rule, see `with_models`."""
    solo: dict[Rule, Label]
    """Spec of the trust model that listens to nobody, against which the gain of the models with a
    choice rule is measured, by the choice rule."""
    worlds: Distribution
    """Distribution of the worlds."""
    reports: dict[str, Any] | PositiveInt = 1
    """Number of reports of a rater in a round with open reports: a number, or one that is drawn."""
    settings: Annotated[dict[Label, Setting], Field(min_length=1)]
    """Settings by name."""
    attacks: Annotated[tuple[Label, ...], Field(min_length=1)]
    """Specs of scripted attacks that the way `scripts` plays."""
    usual: dict[str, Label] = Field(default_factory=lambda: {"SR": "bad-mouthing", "SP": "on-off"})
    """Attack of each role where a scripted attack is for the other role alone."""
    methods: Annotated[tuple[Method, ...], Field(min_length=1)] = ("scripts",)
    """Ways to attack. Honest play of the compromised agents is always one of them."""
    replayed: tuple[ReplayedAttack, ...] = ()
    """Attacks that the way `replayed` plays."""
    search: Search = Search()
    """Budget of the way `search`."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_unique(methods=self.methods, attacks=self.attacks, models=self.models, own=self.own)
        for name, given, needed in (
            ("usual", self.usual, ("SP", "SR")),
            ("solo", self.solo, RULES),
        ):
            if set(given) != set(needed):
                raise ValueError(f"{name} has {sorted(given)}; it must have {sorted(needed)}")
        for use in get_args(Use):
            for number in range(getattr(self.worlds, use)):
                _POSITIVE.validate_python(self._reports(use, number))
        if unknown := set(self.own) - set(self.model_names):
            raise ValueError(
                f"own is {self.own}; {', '.join(sorted(unknown))} is none of the models"
            )
        if not any(setting.roles for setting in self.settings.values()):
            raise ValueError("settings must contain one with compromised agents")
        for attack in self.replayed:
            if attack.setting not in self.settings:
                raise ValueError(
                    f"replayed attack {attack.name!r} is for the setting {attack.setting!r}, which "
                    "the suite does not have"
                )
        if ("replayed" in self.methods) != bool(self.replayed):
            raise ValueError("replayed and the method 'replayed' must both be given, or none")
        names = [(attack.name, attack.setting) for attack in self.replayed]
        check_unique(replayed=tuple(names))
        return self

    @property
    def model_names(self) -> list[str]:
        """Specs of the trust models, with the solo model."""
        return list(dict.fromkeys([*self.models, *self.solo.values()]))

    @property
    def entrants(self) -> list[tuple[str, Rule]]:
        """Trust models with the choice rules by which they are played."""
        return [
            (name, rule)
            for name in self.model_names
            for rule in (RULES if name in self.own else RULES[:1])
        ]

    def replayed_in(self, setting: str) -> list[ReplayedAttack]:
        """Return the replayed attacks of a setting."""
        return [attack for attack in self.replayed if attack.setting == setting]

    def cells(self) -> list[Cell]:
        """Return all cells, ordered by trust model."""
        cells = []
        for model, rule in self.entrants:
            for name, setting in self.settings.items():
                for method in self.methods if setting.roles else _HONEST:
                    if method != "replayed" or self.replayed_in(name):
                        cells.append(Cell(model, rule, name, method))
        return cells

    def factories(self) -> dict[str, Callable[..., Any]]:
        """Return the factories of the trust models and attacks, by type and name."""
        models = {
            f"trust model {name}": named_factory(trust_models, name) for name in self.model_names
        }
        scripts = {
            f"attack {name}": named_factory(attackers, name)
            for name in (*self.attacks, *self.usual.values())
        }
        return models | scripts

    def rules(self, cell: Cell) -> tuple[object, ...]:
        """Return all fields that the result of a cell depends on."""
        setting = self.settings[cell.setting]
        return (
            *(self.worlds, self.reports, setting, self.games, self.selection_games, self.limit_s),
            *{
                "honest": (),
                "scripts": (self.attacks, self.usual),
                "replayed": (self.replayed_in(cell.setting),),
                "search": (self.attacks, self.search),
            }[cell.method],
        )

    def world(self, cell: Cell, use: Use, number: int) -> AttackedWorld:
        """Return a world in the setting and with the choice rule of a cell."""
        setting, world = self.settings[cell.setting], self.worlds.worlds(use)[number]
        access = world.access.model_dump()
        if cell.rule == "own":
            access |= {"by": "model", "explore": 0.0, "temperature": 0.0}
        changes: dict[str, Any] = {"access": access}
        if setting.reports == "open":
            reports = self._reports(use, number)
            changes["ratings"] = {**world.ratings.model_dump(), "open": reports}
        world = world.change(**changes)
        if not setting.roles:
            return AttackedWorld(world, ())
        return compromise(world, setting.roles, setting.share, setting.reserve)

    def _reports(self, use: Use, number: int) -> Any:
        """Return the number of reports of a rater in a round of a world with open reports."""
        return draw(self.reports, f"{self.worlds.seed}|{use}-{number}|reports")

    def silent(self, cell: Cell, world: Scenario) -> list[str]:
        """Return the names of the raters that send no reports in a world: the first ones."""
        share, raters = self.settings[cell.setting].silent, Roster.of(world).rater_names
        return list(raters[: max(1, round(share * len(raters)))]) if share else []


def with_models(suite: Suite, models: Sequence[str]) -> Suite:
    """Return the suite with other trust models. Those that have a choice rule of their own are also
    played by it, see `TrustModel.preference`.

    Args:
        suite: Suite to change.
        models: Specs of the trust models.

    Raises:
        ValueError: A trust model is unknown or cannot be made.
    """
    example, names = (
        suite.worlds.world("measured", 0),
        list(dict.fromkeys([*models, *suite.solo.values()])),
    )
    own = [name for name in names if hasattr(parse_trust_model(name, example), "preference")]
    return suite.model_copy(update={"models": tuple(models), "own": tuple(own)})


def with_attackers(suite: Suite, attackers: Mapping[str, Attacker]) -> Suite:
    """Return the suite with other replayed attacks, which play in each setting with compromised
    agents.

    Args:
        suite: Suite to change.
        attackers: Attackers by name, which do not depend on the number of agents.

    Raises:
        ValueError: An attacker cannot be recorded, or a name is not allowed.
    """
    replayed = list[ReplayedAttack]()
    if not isinstance(attackers, Mapping):
        raise ValueError(f"attackers is of {type(attackers)}; it must map names to attackers")
    for name, attacker in attackers.items():
        if not isinstance(name, str) or name in ("", "honest"):
            raise ValueError(f"an attacker has the name {name!r}, which is not allowed")
        if isinstance(attacker, type) or not (record := record_of(attacker)):
            raise ValueError(f"attacker {name!r} must have a record, got {type(attacker)}")
        replayed += [
            ReplayedAttack(
                name=re.sub(FORBIDDEN, "_", name), setting=setting, finder=name, record=record
            )
            for setting, fields in suite.settings.items()
            if fields.roles
        ]
    methods = dict.fromkeys([*suite.methods, "replayed"])
    return Suite.model_validate(
        {**suite.model_dump(), "replayed": replayed, "methods": tuple(methods)}
    )


def with_search(suite: Suite) -> Suite:
    """Return the suite with the way `search` besides its own ways to attack."""
    return suite.model_copy(update={"methods": tuple(dict.fromkeys([*suite.methods, "search"]))})


def without_models(suite: Suite) -> Suite:
    """Return the suite without trust models, for those that are published."""
    return suite.model_copy(update={"models": (), "own": ()})
