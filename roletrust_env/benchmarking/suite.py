"""Robustness suites: the trust models, scenarios and attacks of a benchmark as immutable data, and
their cells.

Cells are independent of each other and can be played anywhere and in any order.
"""

from collections.abc import Callable, Mapping, Sequence
from inspect import signature
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

from pydantic import Field, PositiveInt, model_validator

from roletrust_env.benchmarking.known_attacks import KnownAttack, check_names, merge_attacks
from roletrust_env.benchmarking.schema import Label, SuiteSchema, check_unique
from roletrust_env.evaluation.measurement import MEASURED
from roletrust_env.evaluation.search import search_methods
from roletrust_env.evaluation.specs import named_factory
from roletrust_env.game.attack_task import Consumers
from roletrust_env.game.policy import Policy
from roletrust_env.game.policy import registry as attackers
from roletrust_env.registry import Registry
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world import Scenario, make_scenario
from roletrust_env.world.group import FrozenModel
from roletrust_env.world.roster import Roster

HONEST = "nobody"
"""Name of the method in cells in which all agents are honest."""

WITHOUT_SEARCH: frozenset[str] = frozenset({"scripted", "known", HONEST})
"""Methods that play what is given. Every other method is the spec of a search method."""

PLANNER = "white-box planner"
"""Name of the search method that follows gradients."""

WHITE_BOX = (PLANNER, "gradients", "exact", "best known")
"""Names of the project's search methods that use knowledge that a real attacker does not have."""

Scale = Literal["utility", "skill"]
"""Scale of a score: the utility of the choice by trust, or its skill, see
`roletrust_env.metrics.skill`."""

_Part = Annotated[float, Field(gt=0, lt=1)]


class Cell(NamedTuple):
    """Smallest unit of a benchmark: one method against one trust model in one condition with one
    seed.

    Attributes:
        model: Spec of the trust model.
        scenario: Name of the scenario in the suite.
        track: Name of the track in the suite.
        share: Share of compromised agents in each role of the track. 0 if all agents are honest.
        method: Method of the suite that finds the attack. `HONEST` if all agents are honest.
        seed: Random seed.
    """

    model: str
    scenario: str
    track: str
    share: float
    method: str
    seed: int

    @property
    def key(self) -> str:
        """Unique key of the cell in its suite."""
        return "|".join(map(str, self))


class Stage(FrozenModel):
    """Scenario of a suite."""

    field_hints: ClassVar[Mapping[str, str]] = {
        **{name: f"did you mean {name!r} in 'set'?" for name in (*Scenario.model_fields, "noise")},
        **dict.fromkeys(("scenario", "base", "extends", "name", "file"), "did you mean 'preset'?"),
    }

    preset: Label
    """Name of a scenario, or path of its file."""
    set: dict[str, Any] = Field(default_factory=dict)
    """Changed fields of the scenario."""
    shares: dict[Label, tuple[_Part, ...]] | None = None
    """Tracks that are played in the scenario, and the shares of compromised agents there. None
    means all tracks of the suite with all their shares."""
    methods: Annotated[tuple[Label, ...], Field(min_length=1)] | None = None
    """Methods that are played in the scenario. None means all of the suite."""
    budgets: dict[str, PositiveInt] = Field(default_factory=dict)
    """Budgets of single methods in the scenario where they differ from those of the suite."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_unique(methods=self.methods or ())
        self.scenario()
        return self

    def scenario(self) -> Scenario:
        """Return the scenario with its changed fields."""
        rules = make_scenario(self.preset)
        return rules.change(**self.set) if self.set else rules


class Track(FrozenModel):
    """Compromised agents, and changes of the world in which they act."""

    roles: tuple[Literal["SR", "SP"], ...] = ()
    """Roles of the compromised agents: raters, providers or both. Without a role all agents are
    honest."""
    shares: tuple[_Part, ...] = ()
    """Shares of compromised agents in each of these roles. The number is rounded and at least
    one."""
    games: Annotated[int, Field(ge=2, le=100_000)] | None = None
    """Number of games that measure the worst attacks of the track, a multiple of those of the
    suite. Each method then measures its worst attack, and the worst that serves all raters alike,
    in further games. None means as many."""
    budgets: dict[str, PositiveInt] = Field(default_factory=dict)
    """Budgets of single methods on the track where they differ from those of the suite. Those of a
    scenario prevail."""
    reserve: Annotated[int, Field(ge=0, le=100)] = 0
    """Number of reserve identities of each compromised agent. If positive, only attacks that use
    them are played."""
    counted: Literal["agents", "identities"] = "agents"
    """Unit of the shares: agents, or, in a track with reserve identities, identities. Then a share
    is that of all identities of compromised agents among all identities."""
    set: dict[str, Any] = Field(default_factory=dict)
    """Changed fields of every scenario."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if bool(self.roles) != bool(self.shares):
            raise ValueError(
                "roles and shares must both be given, or both be empty if all agents are honest"
            )
        for field, value in (
            ("reserve", self.reserve),
            ("games", self.games),
            ("budgets", self.budgets),
        ):
            if value and not self.roles:
                raise ValueError(f"{field} is {value}, but the track has no compromised agents")
        if self.counted == "identities" and not self.reserve:
            raise ValueError(
                "counted is 'identities', but reserve is 0: each agent has one identity"
            )
        return self

    def compromised(self, share: float, agents: int) -> int:
        """Return the number of compromised agents of a role.

        Args:
            share: Share of the track.
            agents: Number of all agents of the role.
        """
        spare = self.reserve if self.counted == "identities" else 0
        # n agents with r reserve identities each are a share x of N + r n identities if n (1 + r) =
        # x (N + r n).
        return max(1, round(share * agents / (1 + spare - share * spare)))


class Suite(SuiteSchema):
    """Benchmark of trust models: models x scenarios x tracks x shares x methods x seeds.

    The worst case is chosen in one set of games and measured in another set of the same size.
    """

    cell_type: ClassVar = Cell
    field_hints: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(
            Scenario.model_fields,
            "it is of a scenario; give its file as 'preset' of one in 'scenarios'.",
        ),
        **dict.fromkeys(
            ("preset", "set", "scenario"), "did you mean 'preset' and 'set' of one in 'scenarios'?"
        ),
    }
    chosen_scores: ClassVar = MEASURED
    measured_scores: ClassVar = MEASURED
    kind: Literal["robustness"] = "robustness"
    """Type of the suite."""
    models: tuple[Label, ...] | Literal["all"] = "all"
    """Specs of trust models. `all` means all registered or installed ones."""
    attacks: tuple[Label, ...] | Literal["all"] = "all"
    """Specs of scripted attacks. `all` means all registered or installed ones."""
    scenarios: Annotated[dict[Label, Stage], Field(min_length=1)]
    """Scenarios by their name in the suite."""
    tracks: Annotated[dict[Label, Track], Field(min_length=1)]
    """Tracks by name. A track without roles measures a model while all agents are honest."""
    methods: Annotated[tuple[Label, ...], Field(min_length=1)] = (
        "scripted",
        "random search",
        "CMA-ES",
        "PPO",
        PLANNER,
    )
    """Methods that find attacks, each with the same budget: `scripted` plays scripted attacks with
    default parameters, `known` plays `known`, and both need no budget. Every other one is the spec
    of a search method: a registered name or `package.module:Class`, with parameters or without."""
    white_box: tuple[Label, ...] = WHITE_BOX
    """Names of search methods that use knowledge that a real attacker does not have. Their results
    are shown apart, and are never the worst case."""
    budget: PositiveInt = 100_000
    """Budget of each search, learner and planner in a cell, in game rounds (rounds x games)."""
    budgets: dict[str, PositiveInt] = Field(default_factory=dict)
    """Budgets of single methods where they differ from `budget`."""
    known: tuple[KnownAttack, ...] = ()
    """Attacks that the method `known` plays, and from which searches with a parameter `known`
    start, such as evolution. In a TOML file it is the name of their JSON file, or a list of names;
    the files lie beside it."""
    score: Scale = "utility"
    """Scale on which attacks are compared and worst cases count: utility, never below a blind
    choice, or skill, 1 for the best choice, 0 for a blind one, and below 0 where attackers steer
    consumers."""
    places: Literal["last", "random"] = "last"
    """Places of the compromised agents as a trust model sees them: the last of their role, or
    random in each game. The models of this project treat all agents alike, and always see the last
    ones."""
    consumers: Consumers = "public"
    """Who consumes: the public, which goes by published trust, or the honest raters, each by what
    it knows."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.models or not self.attacks:
            raise ValueError("models and attacks must not be empty")
        if HONEST in self.methods:
            raise ValueError(
                f"methods must not contain {HONEST!r}, which is played where all agents are honest"
            )
        check_unique(methods=self.methods)
        check_names(self.known)
        for name, track in self.tracks.items():
            if track.games is not None and track.games % self.games:
                raise ValueError(
                    f"games of track {name!r} are {track.games}, which is no multiple of "
                    f"{self.games}"
                )
        self._check_stages()
        self._check_known()
        for what, names in (("models", self.models), ("attacks", self.attacks)):
            if not isinstance(names, str):
                check_unique(**{what: names})
        return self

    def _check_stages(self) -> None:
        """Check that the methods of `budgets` are played, and that the tracks that scenarios name
        exist.

        Scenarios that a suite has from another one may have budgets of methods that it does not
        play.
        """
        for method in self.budgets:
            if method not in self.methods:
                raise ValueError(
                    f"budgets names {method!r}, which is none of the methods "
                    f"{', '.join(self.methods)}"
                )
        for name, stage in self.scenarios.items():
            if unknown := set(stage.methods or ()) - set(self.methods):
                raise ValueError(
                    f"methods of scenario {name!r} names {min(unknown)!r}, which is none of the "
                    "suite's"
                )
            for track, shares in (stage.shares or {}).items():
                if track not in self.tracks:
                    raise ValueError(
                        f"shares of scenario {name!r} names the track {track!r}, which does not "
                        "exist"
                    )
                if bool(shares) != bool(self.tracks[track].roles):
                    raise ValueError(
                        f"shares of scenario {name!r}: a track has shares if it has compromised "
                        f"agents; {track!r} has "
                        f"{len(self.tracks[track].roles)} roles of compromised agents and "
                        f"{len(shares)} shares"
                    )

    def _check_known(self) -> None:
        """Check that there are known attacks if and only if they are played, and that their
        conditions exist.
        """
        if ("known" in self.methods) != bool(self.known):
            raise ValueError("known and the method 'known' belong together; give both or none")
        for attack in self.known:
            if attack.condition not in self.conditions:
                where = f"{attack.scenario}, {attack.track} {attack.share:g}"
                raise ValueError(
                    f"known attack {attack.name!r} is for {where}, which the suite does not have"
                )
            if attack.name in self.methods or (
                self.attacks != "all" and attack.name in self.attacks
            ):
                raise ValueError(
                    f"known attack {attack.name!r} has the name of another attack of the suite"
                )

    @property
    def worlds(self) -> dict[str, Scenario]:
        """Scenarios by name, without the changes of tracks."""
        return {name: stage.scenario() for name, stage in self.scenarios.items()}

    @property
    def searches(self) -> tuple[str, ...]:
        """Methods that search, as specs of search methods."""
        return tuple(method for method in self.methods if method not in WITHOUT_SEARCH)

    def is_white_box(self, method: str) -> bool:
        """Return whether a method uses knowledge that a real attacker does not have."""
        return method.partition(":")[0] in self.white_box or method in self.white_box

    @property
    def model_names(self) -> list[str]:
        """Specs of the trust models."""
        return trust_models.names() if self.models == "all" else list(self.models)

    @property
    def attack_names(self) -> list[str]:
        """Specs of the scripted attacks. `all` means each registered class of policies."""
        if self.attacks != "all":
            return list(self.attacks)
        factories = {name: attackers.factory(name) for name in attackers.names()}
        return [
            name
            for name, made in factories.items()
            if isinstance(made, type) and issubclass(made, Policy)
        ]

    @property
    def conditions(self) -> list[tuple[str, str, float]]:
        """Scenario, track and share of each condition in which models are attacked."""
        return [
            (scenario, track, share)
            for scenario in self.scenarios
            for track, shares in self.shares_in(scenario).items()
            for share in shares
        ]

    @property
    def entered(self) -> set[tuple[str, tuple[str, str, float]]]:
        """Names and conditions of the known attacks that others have found."""
        return {(attack.name, attack.condition) for attack in self.known if attack.finder}

    def known_in(self, condition: tuple[str, str, float]) -> list[KnownAttack]:
        """Return the known attacks of a condition: scenario, track and share."""
        return [attack for attack in self.known if attack.condition == condition]

    def shares_in(self, scenario: str) -> dict[str, tuple[float, ...]]:
        """Return the shares of compromised agents in a scenario by track. A track without any is
        honest.
        """
        own = self.scenarios[scenario].shares
        return {name: track.shares for name, track in self.tracks.items()} if own is None else own

    def methods_in(self, scenario: str) -> tuple[str, ...]:
        """Return the methods that are played in a scenario."""
        own = self.scenarios[scenario].methods
        return self.methods if own is None else own

    def budget_of(self, cell: Cell) -> int:
        """Return the budget of the method of a cell, in game rounds."""
        own = self.budgets | self.tracks[cell.track].budgets | self.scenarios[cell.scenario].budgets
        return own.get(cell.method, self.budget)

    def cells(self) -> list[Cell]:
        """Return all cells, ordered by trust model."""
        cells = []
        for model in self.model_names:
            for scenario in self.scenarios:
                for track, shares in self.shares_in(scenario).items():
                    pairs = [
                        (share, method) for share in shares for method in self.methods_in(scenario)
                    ] or [(0.0, HONEST)]
                    cells += [
                        Cell(model, scenario, track, *pair, seed)
                        for pair in pairs
                        for seed in self.seeds
                    ]
        return cells

    def factories(self) -> dict[str, Callable[..., Any]]:
        """Return the factories of the trust models, attacks and search methods, by type and
        name.
        """
        kinds: list[tuple[str, Registry[Any], Sequence[str]]] = [
            ("trust model", trust_models, self.model_names),
            ("attack", attackers, self.attack_names),
            ("search method", search_methods, self.searches),
        ]
        return {
            f"{kind} {name}": named_factory(registry, name)
            for kind, registry, names in kinds
            for name in names
        }

    def rules(self, cell: Cell) -> tuple[object, ...]:
        """Return all fields that the result of a cell depends on."""
        stage, track = self.scenarios[cell.scenario], self.tracks[cell.track]
        track = track.model_copy(update={"shares": (), "budgets": {}})
        world = stage.preset, stage.set, track, self.places, self.consumers
        known = (
            self.known_in(cell[1:4])
            if cell.method == "known" or _starts_from_known(cell.method)
            else []
        )
        attacks = known, self.attack_names, self.budget_of(cell)
        return *world, *attacks, self.games, self.limit_s


def _starts_from_known(method: str) -> bool:
    """Return whether a method is a search that may start from known attacks, as its parameter
    `known` says.
    """
    if method in WITHOUT_SEARCH:
        return False
    return "known" in signature(named_factory(search_methods, method)).parameters


def with_known(suite: Suite, attacks: Sequence[KnownAttack]) -> Suite:
    """Return the suite with further known attacks, those of its own conditions.

    Args:
        suite: Suite to change.
        attacks: Known attacks. Those of conditions that the suite does not have are left out.

    Raises:
        ValueError: None is for a condition of the suite.
    """
    fitting = tuple(attack for attack in attacks if attack.condition in suite.conditions)
    if not fitting:
        raise ValueError(
            f"none of the {len(attacks)} known attacks is for a condition of the suite {suite.name}"
        )
    methods = suite.methods if "known" in suite.methods else (*suite.methods, "known")
    return suite.model_copy(
        update={"known": merge_attacks(suite.known, fitting), "methods": methods}
    )


class AttackedScenario(NamedTuple):
    """Scenario of a cell, with the names of its compromised agents."""

    scenario: Scenario
    compromised: tuple[str, ...]


def attacked_scenario(suite: Suite, cell: Cell) -> AttackedScenario:
    """Return the scenario and the compromised agents of a cell.

    The compromised agents are the last ones of their role. They differ from the others in nothing
    else.

    Raises:
        ValueError: The track changes an unknown field, or the scenario has too few agents of a
            role.
    """
    track = suite.tracks[cell.track]
    scenario = suite.scenarios[cell.scenario].scenario()
    if track.set:
        scenario = scenario.change(**track.set)
    if track.reserve:
        scenario = _with_reserve(scenario, track, cell.share)
    roster, names = Roster.of(scenario), []
    for role in track.roles:
        known = [name for name in roster.owner_names if roster.role(name) == role]
        number = track.compromised(cell.share, len(known))
        if number >= len(known):
            raise ValueError(
                f"track {cell.track!r} compromises {number} of {len(known)} agents with the role "
                f"{role} in scenario "
                f"{cell.scenario!r}; at least one must be honest"
            )
        names += known[len(known) - number :]
    return AttackedScenario(scenario, tuple(names))


def _with_reserve(scenario: Scenario, track: Track, share: float) -> Scenario:
    """Return the scenario with reserve identities for the last agents of each compromised role."""
    groups = [group.model_dump() for group in scenario.agents]
    for role in track.roles:
        of_role = [group for group in groups if group["role"] == role]
        remaining = track.compromised(share, sum(group["count"] for group in of_role))
        for group in reversed(of_role):
            number = min(remaining, group["count"])
            remaining -= number
            group["count"] -= number
            if number:
                groups.append({**group, "count": number, "reserve": track.reserve})
    return scenario.change(agents=[group for group in groups if group["count"]])
