"""A scenario: everything that is fixed before a game starts, as frozen, validated data."""

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    ValidationError,
    model_validator,
)

from roletrust_env.errors import explain
from roletrust_env.ranges import Lam, Share
from roletrust_env.world.base_model import FrozenModel
from roletrust_env.world.group import AgentGroup


class Everyone(FrozenModel):
    """Every rater is served by every provider, as in the paper."""

    kind: Literal["everyone"] = "everyone"
    """`everyone`."""


class InRange(FrozenModel):
    """Agents are robots that move from waypoint to waypoint; a rater is served by the providers near it."""

    kind: Literal["in-range"] = "in-range"
    """`in-range`."""
    radius: PositiveFloat = 4.0
    """Distance up to which a service reaches, in metres."""
    arena: PositiveFloat = 10.0
    """Side of the square arena, in metres."""
    speed: NonNegativeFloat = 0.25
    """Distance that a robot moves in a round, in metres."""


class Choice(FrozenModel):
    """Each rater chooses a few providers by their published trust."""

    kind: Literal["choice"] = "choice"
    """`choice`."""
    providers: PositiveInt = 1
    """How many providers each rater chooses in a round."""
    temperature: NonNegativeFloat = 0.0
    """0 chooses greedily, ties broken at random; above 0, by softmax of trust / temperature, without replacement."""


class RatingChannel(FrozenModel):
    """What happens to ratings on their way to the trust manager."""

    lost: Share = 0.0
    """Probability that a rating is lost."""
    late: Share = 0.0
    """Probability that a rating that is not lost comes late."""
    delay: Annotated[int, Field(ge=1, le=1000)] = 1
    """Rounds by which a late rating is late. It yields to a newer rating that arrives in the same round."""


class Perturbation(FrozenModel):
    """A disturbance that strikes all services for a while, as the fast-moving target does in the paper."""

    start: NonNegativeInt
    """First round struck."""
    stop: PositiveInt
    """First round after it."""
    strength: Share = 1.0
    """Share of every service's quality that is lost; through the camera, how fast the target moves."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.stop <= self.start:
            raise ValueError(f"stop is {self.stop}; it must be later than start, {self.start}")
        return self


class Admission(FrozenModel):
    """Admission control: an agent whose trust stays too low is cut off, for good."""

    threshold: Share
    """Trust under which an agent is in danger."""
    rounds: PositiveInt = 5
    """Rounds in succession under the threshold after which it is cut off."""


class Rewards(FrozenModel):
    """Weights of the rewards that honest agents play for."""

    rater_trust: NonNegativeFloat = 1.0
    """Weight of ToR in a rater's reward."""
    provider_trust: NonNegativeFloat = 1.0
    """Weight of ToP in a provider's reward."""
    agent_trust: NonNegativeFloat = 1.0
    """Weight of ToA in the reward of an agent with both roles."""
    quality_cost: NonNegativeFloat = 0.1
    """Cost of a service of quality 1 and value 1; the quality is that which is delivered."""


class Scenario(FrozenModel):
    """Everything that is fixed before a game starts. Times are in rounds; a round lasts `period_s` seconds.

    Example:
        >>> Scenario(agents=[{"role": "SR", "count": 3}, {"role": "SP", "count": 3}], lam=0.7).max_cycles
        120
    """

    name: str = "custom"
    """What it is called."""
    description: str = ""
    """One line on what it shows."""
    tags: tuple[str, ...] = ()
    """Words to find it by."""
    agents: tuple[AgentGroup, ...]
    """The groups of agents."""
    access: Annotated[Everyone | InRange | Choice, Field(discriminator="kind")] = Everyone()
    """Who is served by whom, and so who can rate whom; never oneself."""
    service: Literal["synthetic", "hog"] = "synthetic"
    """`synthetic`: perceived quality is a number. `hog`: a people detector looks at camera frames."""
    frames: str | int | None = None
    """For `hog`: a video file, an image folder or a camera number; None renders a scene, the same for every seed."""
    playback: Literal["once", "loop"] = "once"
    """Of a video or image folder: `once`, and it must last as long as the game; `loop`: again and again."""
    ratings: RatingChannel = RatingChannel()
    """How many ratings get lost or come late: `lost`, `late`, `delay`."""
    perturbations: tuple[Perturbation, ...] = ()
    """What strikes all services for a while: `start`, `stop`, `strength`."""
    values: Annotated[tuple[PositiveFloat, ...], Field(min_length=1)] = (1.0,)
    """The value of each service is drawn from these, each as likely; the provider knows it before it serves."""
    admission: Admission | None = None
    """Who is cut off for good: `threshold`, `rounds`; None cuts nobody off."""
    rewards: Rewards = Rewards()
    """Weights of the rewards of honest agents."""
    max_cycles: Annotated[int, Field(ge=1, le=1_000_000)] = 120
    """Length of the game, in rounds."""
    period_s: PositiveFloat = 0.5
    """Seconds from one service to the next."""
    lam: Lam = 0.5
    """Weight of the newest round in every trust."""
    initial_trust: Share = 0.5
    """Trust of everyone before any rating."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not any(self._somebody_rates(round) for round in range(self.max_cycles)):
            roles = ", ".join(f"{g.count} {' then '.join(g.turns) or g.role}" for g in self.agents) or "none at all"
            raise ValueError(
                f"agents: {roles}; nobody could rate anybody. In some round there must be a rater (SR or SR+SP) "
                "and another agent that provides (SP or SR+SP)"
            )
        providers = sum(group.count for group in self.agents if group.role != "SR")
        if isinstance(self.access, Choice) and self.access.providers > providers:
            raise ValueError(f"access.providers is {self.access.providers}; there are {providers} to choose from")
        if self.frames == "" or (isinstance(self.frames, int) and not 0 <= self.frames < 2**31):
            raise ValueError(f"frames is {self.frames!r}; it must be a path, or a camera number from 0 on")
        if self.frames is not None and self.service != "hog":
            raise ValueError(f"frames are for the service 'hog', not {self.service!r}")
        if self.service != "synthetic" and any(group.subjective for group in self.agents):
            raise ValueError(f"raters' bias and scale are for the service 'synthetic', not {self.service!r}")
        if self.playback == "loop" and not isinstance(self.frames, str):
            raise ValueError(f"playback is 'loop', for a video or a folder of images; frames is {self.frames!r}")
        return self

    def _somebody_rates(self, round: int) -> bool:
        """Whether, in this round, one agent rates and another one provides."""
        there = [g for g in self.agents if g.joins <= round and (g.leaves is None or round < g.leaves)]
        playing = [(group.role_in(round), group.count) for group in there]
        raters = sum(count for role, count in playing if role != "SP")
        providers = sum(count for role, count in playing if role != "SR")
        both = sum(count for role, count in playing if role == "SR+SP")
        return raters > 0 and providers > 0 and not raters == providers == both == 1

    def change(self, /, **changes: Any) -> "Scenario":
        """The same scenario with other values of some fields, validated anew.

        Args:
            **changes: fields of the scenario; and `noise`, which replaces every group's perception noise.

        Raises:
            ValueError: a field does not exist or a value is not allowed.
        """
        source, noise = f"scenario {self.name!r}", changes.pop("noise", None)
        changed = read_scenario({**self.model_dump(), **changes}, source)
        if noise is None:
            return changed
        agents = [{**group.model_dump(), "noise": noise} for group in changed.agents]
        return read_scenario({**changed.model_dump(), "agents": agents}, source)


def read_scenario(data: Mapping[str, Any], source: str) -> Scenario:
    """Make a scenario of plain data.

    Args:
        data: the fields of `Scenario`, nested as in a TOML file.
        source: where the data came from, for error messages.

    Raises:
        ValueError: names each wrong field, its value and what is allowed.
    """
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        raise ValueError(f"{source}: {explain(error)}") from None


def load_scenario(path: str | Path) -> Scenario:
    """Read a scenario from a TOML or YAML file.

    Raises:
        ValueError: the file cannot be read, is neither TOML nor YAML, or holds no valid scenario.
    """
    path = Path(path)
    readers: dict[str, Callable[[str], Any]] = {".toml": tomllib.loads, ".yaml": _parse_yaml, ".yml": _parse_yaml}
    if path.suffix not in readers:
        raise ValueError(f"scenario file {path}: its name must end in one of {', '.join(readers)}")
    try:
        data = readers[path.suffix](path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"scenario file {path} cannot be read: {error.strerror}") from None
    except RecursionError:
        raise ValueError(f"scenario file {path} is broken: it is nested too deeply") from None
    except ValueError as error:  # the parsers' own errors and wrong UTF-8 are ValueErrors
        raise ValueError(f"scenario file {path} is broken: {error}") from None
    if not isinstance(data, dict):
        raise ValueError(f"scenario file {path} holds a {type(data).__name__}; it must hold fields with values")
    return read_scenario({"name": path.stem, **data}, f"scenario file {path}")


def _parse_yaml(text: str) -> Any:
    try:
        import yaml
    except ImportError:
        raise ValueError("YAML needs PyYAML: pip install 'roletrust-env[cli]'; TOML needs nothing") from None

    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from None
