"""Cells of a suite. Cells are independent of each other and can be played anywhere and in any order."""

from collections.abc import Callable, Sequence
from inspect import signature
from typing import Any, NamedTuple

from roletrust_env.benchmarking.suite import HONEST, PLANNER, WITHOUT_SEARCH, Suite, Track
from roletrust_env.evaluation.attacked_games import TaskArguments
from roletrust_env.evaluation.isolated import IsolatedModel
from roletrust_env.evaluation.search import search_methods
from roletrust_env.evaluation.specs import is_own_model, named_factory, parse_trust_model
from roletrust_env.game.attack_task import Objective
from roletrust_env.game.policy import Policy
from roletrust_env.game.policy_registry import registry as attackers
from roletrust_env.registry import Registry
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.trust.model_checks import needs_watching
from roletrust_env.trust.seats import RandomSeats
from roletrust_env.world import Scenario
from roletrust_env.world.roster import Roster


class Cell(NamedTuple):
    """Smallest unit of a benchmark: one method against one trust model in one condition with one seed.

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


def cells(suite: Suite) -> list[Cell]:
    """Return all cells of a suite, ordered by trust model."""
    result = []
    for model in model_names(suite):
        for scenario in suite.scenarios:
            for name, shares in suite.shares_in(scenario).items():
                pairs = [(share, method) for share in shares for method in suite.methods] or [(0.0, HONEST)]
                result += [Cell(model, scenario, name, *pair, seed) for pair in pairs for seed in suite.seeds]
    return result


def model_names(suite: Suite) -> list[str]:
    """Return the specs of the trust models of a suite."""
    return trust_models.names() if suite.models == "all" else list(suite.models)


def attack_names(suite: Suite) -> list[str]:
    """Return the specs of the scripted attacks of a suite. `all` means each registered class of policies."""
    if suite.attacks != "all":
        return list(suite.attacks)
    names = []
    for name in attackers.names():
        factory = attackers.factory(name)
        if isinstance(factory, type) and issubclass(factory, Policy):
            names.append(name)
    return names


def factories(suite: Suite) -> dict[str, Callable[..., Any]]:
    """Return the factories of the trust models, attacks and search methods of a suite, by type and name."""
    kinds: list[tuple[str, Registry[Any], Sequence[str]]] = [
        ("trust model", trust_models, model_names(suite)),
        ("attack", attackers, attack_names(suite)),
        ("search method", search_methods, suite.searches),
    ]
    return {f"{kind} {name}": named_factory(registry, name) for kind, registry, names in kinds for name in names}


def rules(suite: Suite, cell: Cell) -> tuple[object, ...]:
    """Return all fields of a suite that the result of a cell depends on.

    Args:
        suite: Suite of the cell.
        cell: The cell.
    """
    stage, track = suite.scenarios[cell.scenario], suite.tracks[cell.track]
    world = stage.preset, stage.set, track.model_copy(update={"shares": ()}), suite.places, suite.consumers
    known = suite.known_in(cell[1:4]) if cell.method == "known" or starts_from_known(cell.method) else []
    attacks = known, attack_names(suite), suite.budget_of(cell.method, cell.scenario)
    return *world, *attacks, suite.games, suite.limit_s


def starts_from_known(method: str) -> bool:
    """Return whether a method is a search that may start from known attacks, as its parameter `known` says."""
    if method in WITHOUT_SEARCH:
        return False
    return "known" in signature(named_factory(search_methods, method)).parameters


class AttackedScenario(NamedTuple):
    """Scenario of a cell, with the names of its compromised agents."""

    scenario: Scenario
    compromised: tuple[str, ...]


def attacked_scenario(suite: Suite, cell: Cell) -> AttackedScenario:
    """Return the scenario and the compromised agents of a cell.

    The compromised agents are the last ones of their role. They differ from the others in nothing else.

    Args:
        suite: Suite of the cell.
        cell: The cell.

    Raises:
        ValueError: The track changes an unknown field, or the scenario has too few agents of a role.
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
                f"track {cell.track!r} compromises {number} of {len(known)} agents with the role {role} in scenario "
                f"{cell.scenario!r}; at least one must be honest"
            )
        names += known[len(known) - number :]
    return AttackedScenario(scenario, tuple(names))


def task_arguments(suite: Suite, cell: Cell, *, isolated: bool = False) -> TaskArguments:
    """Return the arguments of the attack task of a cell.

    Args:
        suite: Suite of the cell.
        cell: The cell.
        isolated: Give a trust model of another package a process of its own.

    Raises:
        ValueError: The track does not fit the scenario, see `attacked_scenario`, or the trust model cannot be created.
    """
    scenario, compromised = attacked_scenario(suite, cell)
    make: Any = IsolatedModel if isolated and not is_own_model(cell.model) else parse_trust_model
    model = make(cell.model, scenario)
    if suite.places == "shuffled" or (suite.places == "random" and needs_watching(model)):
        model = RandomSeats(model, cell.seed)
    return {
        "scenario": scenario,
        "trust_model": model,
        # An attack task needs an agent even if all are honest. This agent then acts honestly.
        "compromised": compromised or Roster.of(scenario).owner_names[:1],
        "objective": objective(cell.method, suite.tracks[cell.track].roles),
        "consumers": suite.consumers,
    }


def objective(method: str, roles: Sequence[str]) -> Objective:
    """Return the objective of a method on a track.

    It is `mislead`, except for the planner, which needs a gradient: the choice of the most trusted provider has none.
    The planner uses `exploit` if only providers are compromised, and `damage` otherwise.

    Args:
        method: Name of the method.
        roles: Roles of the compromised agents.
    """
    if method.partition(":")[0] != PLANNER:
        return "mislead"
    return "exploit" if tuple(roles) == ("SP",) else "damage"


def _with_reserve(scenario: Scenario, track: Track, share: float) -> Scenario:
    """Return the scenario with reserve identities for the last agents of each compromised role."""
    groups = [group.model_dump() for group in scenario.agents]
    for role in track.roles:
        of_role = [group for group in groups if group["role"] == role]
        left = track.compromised(share, sum(group["count"] for group in of_role))
        for group in reversed(of_role):
            number = min(left, group["count"])
            left -= number
            group["count"] -= number
            if number:
                groups.append({**group, "count": number, "reserve": track.reserve})
    return scenario.change(agents=[group for group in groups if group["count"]])
