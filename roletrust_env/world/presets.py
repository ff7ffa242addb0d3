"""Registry of scenarios, and the scenarios that come with the library."""

from pathlib import Path

from roletrust_env.registry import Registry
from roletrust_env.world.group import AgentGroup
from roletrust_env.world.scenario import (
    Admission,
    Choice,
    Encounters,
    InRange,
    Perturbation,
    RatingDelivery,
    Scenario,
    load_scenario,
)

registry: Registry[Scenario] = Registry("scenario", "roletrust_env.scenarios", Scenario)


def register_scenario(scenario: Scenario) -> None:
    """Register a scenario under its name.

    Raises:
        ValueError: The name is taken or is not a word.
    """
    registry.register(scenario.name, lambda: scenario)


def make_scenario(scenario: str | Path | Scenario) -> Scenario:
    """Return a scenario given by its name, by the path of a TOML or YAML file, or as an object.

    Args:
        scenario: Registered name, path of a file, or `Scenario`, which is returned as it is.

    Raises:
        ValueError: The name is unknown or the file is not a valid scenario.

    Example:
        >>> make_scenario("paper-3x3").period_s
        0.5
    """
    if isinstance(scenario, Scenario):
        return scenario
    if not isinstance(scenario, str | Path):
        raise ValueError(f"scenario is {scenario!r}; it must be a Scenario, the name of one, or the path of a file")
    if isinstance(scenario, Path) or scenario.endswith((".toml", ".yaml", ".yml")):
        return load_scenario(scenario)
    return registry.make(scenario)


def scenarios() -> dict[str, str]:
    """Return the known scenarios: name and one-line description, or the error of a plug-in."""
    return {name: _describe(name) for name in registry.names()}


def _describe(name: str) -> str:
    try:
        return registry.make(name).description
    except ValueError as error:
        return str(error)


def _crowd(n: int) -> tuple[AgentGroup, ...]:
    return (AgentGroup(role="SR", count=n, noise=0.005), AgentGroup(role="SP", count=n))


# The target moves fast at 18 s and at 30 s, for two seconds each.
_FAST_TARGET = (Perturbation(start=36, stop=40, strength=1.0), Perturbation(start=60, stop=64, strength=1.0))

_PAPER = Scenario(
    name="paper-3x3",
    description="Three raters and three cameras, everyone rates everyone, as in Su and Saint-Jore (2023)",
    tags=("paper", "small"),
    agents=_crowd(3),
    perturbations=_FAST_TARGET,
    max_cycles=240,
)

# The descriptions are part of the fingerprint of a benchmark suite: a change would make old submissions differ from it.
for _preset in (
    _PAPER,
    _PAPER.change(
        name="paper-3x3-hog",
        description="The paper's scenario seen for real: HOG people detection in rendered or given camera frames",
        tags=("paper", "small", "vision"),
        service="hog",
        noise=0.0,
    ),
    Scenario(
        name="crowd-10x10",
        description="Ten raters and ten providers, everyone rates everyone",
        tags=("crowd",),
        agents=_crowd(10),
        max_cycles=200,
    ),
    Scenario(
        name="crowd-100x100",
        description="A hundred raters and a hundred providers, everyone rates everyone",
        tags=("crowd", "large"),
        agents=_crowd(100),
        max_cycles=200,
    ),
    Scenario(
        name="robots-that-move",
        description="Twelve robots wander through an arena and serve those within reach; some ratings get lost or late",
        tags=("mobility", "lossy"),
        agents=(
            AgentGroup(role="SR", count=6, noise=0.01),
            AgentGroup(role="SP", count=4),
            AgentGroup(role="SR+SP", count=2, noise=0.01),
        ),
        access=InRange(radius=4.0, arena=10.0, speed=0.3),
        ratings=RatingDelivery(lost=0.1, late=0.2, delay=2),
        max_cycles=300,
    ),
    Scenario(
        name="open-system",
        description="Agents join and leave all the time, and those whose trust stays low are cut off",
        tags=("open", "admission", "choice"),
        agents=(
            AgentGroup(role="SR", count=6, noise=0.01),
            AgentGroup(role="SP", count=5),
            AgentGroup(role="SR", count=5, joins=10, join_rate=0.05, leave_rate=0.01, noise=0.01),
            AgentGroup(role="SP", count=5, joins=10, join_rate=0.05, leave_rate=0.01),
        ),
        access=Choice(providers=2, temperature=0.2),
        values=(1.0, 1.0, 1.0, 5.0),
        admission=Admission(threshold=0.25, rounds=10),
        max_cycles=300,
    ),
    Scenario(
        name="peers",
        description="Nine agents that are rater and provider at once, three of which change roles every ten rounds",
        tags=("peers", "roles"),
        agents=(
            AgentGroup(role="SR+SP", count=6, noise=0.005),
            AgentGroup(role="SR+SP", count=3, noise=0.005, turns=("SR", "SP"), turn_length=10),
        ),
        max_cycles=200,
    ),
    Scenario(
        name="market",
        description="Twenty buyers choose among twelve sellers of differing ability by their trust",
        tags=("market", "choice", "ability", "lossy"),
        agents=(
            AgentGroup(role="SR", count=20, noise=0.05),
            AgentGroup(role="SP", count=12, ability=(0.3, 1.0)),
        ),
        access=Choice(providers=2, temperature=0.1),
        ratings=RatingDelivery(lost=0.05),
        values=(1.0, 1.0, 1.0, 5.0),
        max_cycles=200,
    ),
    Scenario(
        name="subjective",
        description="Ten raters see ten providers of differing ability each in its own way: no two notes mean the same",
        tags=("crowd", "ability", "subjective"),
        agents=(
            AgentGroup(role="SR", count=10, noise=0.02, bias=(-0.1, 0.1), scale=(0.7, 1.1)),
            AgentGroup(role="SP", count=10, ability=(0.3, 1.0)),
        ),
        max_cycles=200,
    ),
    Scenario(
        name="newcomers",
        description="Ten raters and ten providers, and in round 60 fifteen raters whom nobody knows join at once",
        tags=("crowd", "open"),
        agents=(*_crowd(10), AgentGroup(role="SR", count=15, joins=60, noise=0.005)),
        max_cycles=200,
    ),
    Scenario(
        name="city",
        description="Eight thousand raters meet five of two thousand providers in each round, for SparseGame",
        tags=("sparse", "large", "ability"),
        agents=(
            AgentGroup(role="SR", count=8000, noise=0.05),
            AgentGroup(role="SP", count=2000, ability=(0.3, 1.0)),
        ),
        access=Encounters(providers=5),
        max_cycles=50,
    ),
):
    register_scenario(_preset)
