"""A suite: what is played under attack, by whom and how often, as frozen data."""

import tomllib
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PositiveInt, ValidationError, model_validator

from roletrust_env import Scenario, make_scenario
from roletrust_env.benchmark.learners.suite import LearnersSuite
from roletrust_env.benchmark.schema import SuiteSchema, Text, check_unique
from roletrust_env.errors import explain, suggest
from roletrust_env.world.base_model import FrozenModel

Rung = Literal["scripted", "random search", "CMA-ES", "PPO", "white-box planner"]
"""A way to attack. The planner sees all; what it finds is told beside the others, and is never the worst case."""

PLANNER = "white-box planner"
"""Name of the rung that follows gradients."""

OPEN: frozenset[str] = frozenset({PLANNER})
"""Rungs that know more than an attacker has in life."""

_Part = Annotated[float, Field(gt=0, lt=1)]


class Stage(FrozenModel):
    """A scenario of a suite."""

    preset: Text
    """Name of a scenario, or path of its file."""
    set: dict[str, Any] = Field(default_factory=dict)
    """Fields of it that are changed."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        self.scenario()
        return self

    def scenario(self) -> Scenario:
        """The scenario."""
        rules = make_scenario(self.preset)
        return rules.change(**self.set) if self.set else rules


class Track(FrozenModel):
    """Who is compromised, and what the world does besides."""

    roles: tuple[Literal["SR", "SP"], ...] = ()
    """Of the compromised agents: raters, providers, both; none, and everybody is honest."""
    shares: tuple[_Part, ...] = ()
    """Of the agents of each of these roles, rounded, at least one."""
    reserve: Annotated[int, Field(ge=0, le=100)] = 0
    """Identities in reserve of each compromised agent; with some, the attacks are those that use them."""
    set: dict[str, Any] = Field(default_factory=dict)
    """Fields of every scenario that are changed."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if bool(self.roles) != bool(self.shares):
            raise ValueError("roles and shares go together: both, or neither where everybody is honest")
        if self.reserve and not self.roles:
            raise ValueError(f"reserve is {self.reserve}; it is for compromised agents, and there are none")
        return self


class Suite(SuiteSchema):
    """A benchmark of trust models: models x scenarios x tracks x shares x rungs x seeds.

    The worst case is chosen in as many games as it is measured in, others than these.
    """

    kind: Literal["robustness"] = "robustness"
    """Of suite."""
    models: tuple[Text, ...] | Literal["all"] = "all"
    """Trust models as `--model` takes them; or all that are registered or installed."""
    attacks: tuple[Text, ...] | Literal["all"] = "all"
    """Scripted attacks as `--attack` takes them behind its =; or all that are registered or installed."""
    scenarios: dict[Text, Stage]
    """By the name that they have in the suite."""
    tracks: dict[Text, Track]
    """By name. One without roles shows what a model is worth while everybody is honest."""
    rungs: tuple[Rung, ...] = ("scripted", "random search", "CMA-ES", "PPO", "white-box planner")
    """Ways to attack, each with the same budget; scripts at their defaults need none."""
    budget: PositiveInt = 100_000
    """Game rounds, rounds x games, that each search, learner and planner may play for each cell."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.scenarios or not self.tracks or not self.rungs:
            raise ValueError("scenarios, tracks and rungs must each have one at least")
        if not self.models or not self.attacks:
            raise ValueError("models and attacks must each have one at least, or be 'all'")
        check_unique(rungs=self.rungs)
        for what, names in (("models", self.models), ("attacks", self.attacks)):
            if not isinstance(names, str):
                check_unique(**{what: names})
        return self


def suites() -> dict[str, str]:
    """The suites that come with the project: name and one line of description."""
    names = sorted(path.name.removesuffix(".toml") for path in _FOLDER.iterdir() if path.name.endswith(".toml"))
    return {name: load_suite(name).description for name in names}


def load_suite(suite: str | Path) -> Suite | LearnersSuite:
    """A suite by its name, or from a TOML file.

    Raises:
        ValueError: the name is unknown, or the file cannot be read or holds no valid suite.
    """
    path = Path(suite)
    if path.suffix == ".toml":
        try:
            return read_suite({"name": path.stem, **_parse(path.read_text(encoding="utf-8"), path)}, f"suite {path}")
        except (OSError, UnicodeDecodeError) as error:
            raise ValueError(f"suite {path} cannot be read: {error}") from None
    known = sorted(entry.name.removesuffix(".toml") for entry in _FOLDER.iterdir() if entry.name.endswith(".toml"))
    if str(suite) not in known:
        raise ValueError(f"unknown suite {str(suite)!r}{suggest(suite, known)}, or the path of a .toml file")
    text = (_FOLDER / f"{suite}.toml").read_text(encoding="utf-8")
    return read_suite({"name": str(suite), **_parse(text, suite)}, f"suite {suite}")


def read_suite(data: Mapping[str, Any], source: str) -> Suite | LearnersSuite:
    """A suite of plain data.

    Raises:
        ValueError: names each wrong field, its value and what is allowed.
    """
    if not isinstance(data, Mapping):
        raise ValueError(f"{source}: a suite has fields, and this is none: {str(data)[:100]!r}")
    kind = str(data.get("kind", "robustness"))
    if kind not in _KINDS:
        raise ValueError(f"{source}: kind is {kind!r}; it must be one of {', '.join(_KINDS)}")
    try:
        return _KINDS[kind].model_validate(data)
    except ValidationError as error:
        raise ValueError(f"{source}: {explain(error)}") from None


_KINDS: dict[str, type[Suite | LearnersSuite]] = {"robustness": Suite, "learners": LearnersSuite}
_FOLDER = files("roletrust_env.benchmark") / "suites"


def _parse(text: str, source: str | Path) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ValueError(f"suite {source} is no TOML: {error}") from None
