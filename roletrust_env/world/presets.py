"""Registry of scenarios, and the scenarios that come with the library."""

from functools import cache
from pathlib import Path

from roletrust_env.registry import Registry
from roletrust_env.world.scenario import Scenario, load_scenario

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
        raise ValueError(
            f"scenario is {scenario!r}; it must be a Scenario, the name of one, or the path of a "
            "file"
        )
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


def _register(path: Path) -> None:
    """Register the scenario of a file, which is read when it is first asked for."""
    registry.register(path.stem, cache(lambda: load_scenario(path)))


# The descriptions are part of the fingerprint of a benchmark suite: a change would make old
# submissions differ from it.
for _name in (
    "paper-3x3",
    "paper-3x3-hog",
    "crowd-10x10",
    "crowd-100x100",
    "robots-that-move",
    "open-system",
    "peers",
    "market",
    "marketplace",
    "marketplace-40",
    "subjective",
    "newcomers",
    "city",
):
    _register(Path(__file__).parent / "scenarios" / f"{_name}.toml")
