"""The cells of a suite: what is played apart from all else, and can be played anywhere and in any order."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from roletrust_env import Policy, Scenario
from roletrust_env.benchmark.suite import PLANNER, Suite, Track
from roletrust_env.evaluation.attacked_games import TaskArguments
from roletrust_env.evaluation.specs import named_factory, parse_trust_model
from roletrust_env.game.attack_task import Objective
from roletrust_env.game.policy_registry import registry as attackers
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world.roster import Roster

HONEST = "nobody"
"""The rung of a track on which everybody is honest."""


class Cell(NamedTuple):
    """One way to attack one trust model in one place.

    Attributes:
        model: as `--model` takes it.
        scenario: its name in the suite.
        track: its name in the suite.
        share: of the agents of the track's roles that are compromised; 0 where everybody is honest.
        rung: how an attack is found; `HONEST` where everybody is honest.
        seed: of all luck.
    """

    model: str
    scenario: str
    track: str
    share: float
    rung: str
    seed: int

    @property
    def key(self) -> str:
        """What tells it from all others of its suite."""
        return "|".join(map(str, self))


def cells(suite: Suite) -> list[Cell]:
    """All cells of a suite, those of one trust model together."""
    found = []
    for model in models(suite):
        for scenario in suite.scenarios:
            for name, track in suite.tracks.items():
                ways: list[tuple[float, str]] = [(share, rung) for share in track.shares for rung in suite.rungs]
                ways = ways or [(0.0, HONEST)]
                found += [Cell(model, scenario, name, *way, seed) for way in ways for seed in suite.seeds]
    return found


def models(suite: Suite) -> list[str]:
    """The trust models of a suite."""
    return trust_models.names() if suite.models == "all" else list(suite.models)


def attacks(suite: Suite) -> list[str]:
    """The scripted attacks of a suite: of those that are registered, the policies that need be told nothing."""
    if suite.attacks != "all":
        return list(suite.attacks)
    found = []
    for name in attackers.names():
        kind = attackers.factory(name)
        if isinstance(kind, type) and issubclass(kind, Policy):
            found.append(name)
    return found


def named(suite: Suite) -> dict[str, Callable[..., Any]]:
    """What makes the models and the attacks of a suite, by what they are."""
    made: dict[str, Callable[..., Any]] = {}
    made |= {f"trust model {name}": named_factory(trust_models, name) for name in models(suite)}
    return made | {f"attack {name}": named_factory(attackers, name) for name in attacks(suite)}


class Place(NamedTuple):
    """Where a cell is played: the scenario as it is there, and who of it is compromised."""

    scenario: Scenario
    compromised: tuple[str, ...]


def place(suite: Suite, cell: Cell) -> Place:
    """Where a cell is played.

    The compromised are the last of their role, which differ from the others in nothing else.

    Raises:
        ValueError: the track changes a field that there is not, or compromises a role that nobody or not enough have.
    """
    track = suite.tracks[cell.track]
    scenario = suite.scenarios[cell.scenario].scenario()
    if track.set:
        scenario = scenario.change(**track.set)
    if track.reserve:
        scenario = _with_reserve(scenario, track, cell.share)
    roster, names = Roster.of(scenario), []
    for role in track.roles:
        known = [name for name in roster.first_names if roster.role(name) == role]
        names += known[len(known) - _number(cell, role, len(known)) :]
    return Place(scenario, tuple(names))


def task_arguments(suite: Suite, cell: Cell) -> TaskArguments:
    """Return the arguments of the attack task that a cell is.

    Args:
        suite: Suite of the cell.
        cell: The cell.

    Raises:
        ValueError: The track cannot be had in this scenario, see `place`, or the trust model cannot be made.
    """
    scenario, compromised = place(suite, cell)
    return {
        "scenario": scenario,
        "trust_model": parse_trust_model(cell.model, scenario),
        # An attack task needs an agent also where everybody is honest; then it plays honestly.
        "compromised": compromised or Roster.of(scenario).first_names[:1],
        "objective": objective(cell.rung, suite.tracks[cell.track].roles),
    }


def objective(rung: str, roles: Sequence[str]) -> Objective:
    """Return the objective of a rung on a track: to mislead consumers, except for the planner, which needs a gradient.

    The most trusted provider jumps. So the planner exploits good trust where providers alone are compromised, and else
    lowers the trust of the honest.

    Args:
        rung: Name of the rung.
        roles: Roles of the compromised agents.
    """
    if rung != PLANNER:
        return "mislead"
    return "exploit" if tuple(roles) == ("SP",) else "damage"


def _number(cell: Cell, role: str, known: int) -> int:
    """How many of the agents of a role are compromised."""
    number = max(1, round(cell.share * known))
    if number >= known:
        raise ValueError(
            f"track {cell.track!r} compromises {number} of {known} agents with the role {role} in scenario "
            f"{cell.scenario!r}; one at least must be honest"
        )
    return number


def _with_reserve(scenario: Scenario, track: Track, share: float) -> Scenario:
    """The scenario in which the last agents of each compromised role have identities in reserve."""
    groups = [group.model_dump() for group in scenario.agents]
    for role in track.roles:
        of_role = [group for group in groups if group["role"] == role]
        left = max(1, round(share * sum(group["count"] for group in of_role)))
        for group in reversed(of_role):
            taken = min(left, group["count"])
            left -= taken
            group["count"] -= taken
            if taken:
                groups.append({**group, "count": taken, "reserve": track.reserve})
    return scenario.change(agents=[group for group in groups if group["count"]])
