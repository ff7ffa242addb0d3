"""Scenario: everything that is fixed before a game starts, as frozen, validated data."""

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, NonNegativeInt, PositiveInt, ValidationError, model_validator

from roletrust_env.errors import validation_message
from roletrust_env.parameters import (
    Amount,
    Factor,
    Lam,
    PositiveAmount,
    Share,
    ZeroOrAmount,
    check_instance,
)
from roletrust_env.world.field_hints import give_hints
from roletrust_env.world.group import AgentGroup, FrozenModel


class Everyone(FrozenModel):
    """Access without restrictions: every provider serves every rater, as in the paper."""

    kind: Literal["everyone"] = "everyone"
    """`everyone`."""


class InRange(FrozenModel):
    """Access by distance: agents are robots that move between waypoints, and providers serve the
    raters near them.
    """

    kind: Literal["in-range"] = "in-range"
    """`in-range`."""
    radius: PositiveAmount = 4.0
    """Distance up to which a service reaches, in metres."""
    arena: PositiveAmount = 10.0
    """Side length of the square arena, in metres."""
    speed: Amount = 0.25
    """Distance that a robot moves in a round, in metres."""


class Choice(FrozenModel):
    """Access by choice: each rater chooses a few providers by trust, and receives their services
    alone.
    """

    kind: Literal["choice"] = "choice"
    """`choice`."""
    providers: PositiveInt = 1
    """Number of providers that each rater chooses in a round."""
    by: Literal["published", "own", "model"] = "published"
    """Trust by which a rater chooses: `published` ToP; its `own` trust under a personal model, and
    the published one under any other; or the choice rule of the trust `model`."""
    explore: Share = 0.0
    """Probability that a rater chooses uniformly at random in a round."""
    temperature: ZeroOrAmount = 0.0
    """Temperature of the softmax of trust, without replacement. At 0 the choice is greedy, and ties
    break at random."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in ("explore", "temperature"):
            if self.by == "model" and getattr(self, name):
                raise ValueError(
                    f"{name} is {getattr(self, name)}; it must be 0 where the trust model has the "
                    "choice, by = 'model'"
                )
        return self


class Encounters(FrozenModel):
    """Access by chance: each rater meets a few providers, drawn anew in each round, and those that
    act serve it.
    """

    kind: Literal["encounters"] = "encounters"
    """`encounters`."""
    providers: PositiveInt = 5
    """Number of providers that each rater meets in a round, all different."""


class RatingDelivery(FrozenModel):
    """Ratings that a rater can report, and their losses and delays on the way to the trust manager.

    Reports are verified by default: a rater can rate each service that it received, once. They are
    open with `open`: a rater can also rate providers that did not serve it.
    """

    deadline: Annotated[int, Field(ge=1, le=1000)] = 1
    """Number of rounds in which a service can be rated: those after its own. A newer service of the
    same provider replaces it."""
    open: PositiveInt | None = None
    """Largest number of ratings that a rater can send in a round, one for each provider, with or
    without a service. Ratings of services have priority. None sends ratings of services alone, and
    all of them."""
    lost: Share = 0.0
    """Probability that a rating is lost."""
    late: Share = 0.0
    """Probability that a rating that is not lost arrives late."""
    delay: Annotated[int, Field(ge=1, le=1000)] = 1
    """Delay of a late rating, in rounds. If a newer rating arrives in the same round, the late one
    is dropped."""


class Perturbation(FrozenModel):
    """Perturbation of all services for some rounds, like the fast-moving target in the paper."""

    start: NonNegativeInt
    """First round of the perturbation."""
    stop: PositiveInt
    """First round after the perturbation."""
    strength: Share = 1.0
    """Share of the quality that every service loses; with the camera, the speed of the target."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.stop <= self.start:
            raise ValueError(f"stop is {self.stop}; it must be later than start, {self.start}")
        return self


class Admission(FrozenModel):
    """Admission control: an agent whose trust stays too low is cut off for good."""

    threshold: Share
    """Trust below which a round counts towards the cut-off."""
    rounds: PositiveInt = 5
    """Number of successive rounds below the threshold after which the agent is cut off."""


class Rewards(FrozenModel):
    """Weights in the rewards of honest agents."""

    rater_trust: Amount = 1.0
    """Weight of ToR in a rater's reward."""
    provider_trust: Amount = 1.0
    """Weight of ToP in a provider's reward."""
    agent_trust: Amount = 1.0
    """Weight of ToA in the reward of an agent with both roles."""
    quality_cost: Amount = 0.1
    """Cost of a service of delivered quality 1 and value 1."""


class Scenario(FrozenModel):
    """Everything that is fixed before a game starts. Times are in rounds; a round lasts `period_s`
    seconds.

    Example:
        >>> Scenario(agents=[{"role": "SR", "count": 3}, {"role": "SP", "count": 3}], lam=0.7).max_cycles
        120
    """  # noqa: E501

    name: str = "custom"
    """Name of the scenario."""
    description: str = ""
    """One-line description."""
    tags: tuple[str, ...] = ()
    """Keywords for searching."""
    agents: tuple[AgentGroup, ...]
    """Groups of agents."""
    access: Annotated[Everyone | InRange | Choice | Encounters, Field(discriminator="kind")] = (
        Everyone()
    )
    """Rule by which providers serve raters, who can then rate them. No agent serves or rates
    itself."""
    service: Literal["synthetic", "hog"] = "synthetic"
    """Service: `synthetic`, with a number as perceived quality, or `hog`, a people detector on
    camera frames."""
    frames: str | int | None = None
    """Frames of the service `hog`: a video, an image folder or a camera number; None renders the
    same scene always."""
    playback: Literal["once", "loop"] = "once"
    """Playback of a video or image folder: `once`, which must last as long as the game, or
    `loop`."""
    ratings: RatingDelivery = RatingDelivery()
    """Ratings that can be reported, and their losses and delays: `deadline`, `open`, `lost`,
    `late`, `delay`."""
    perturbations: tuple[Perturbation, ...] = ()
    """Perturbations of all services: `start`, `stop`, `strength`."""
    values: Annotated[tuple[PositiveAmount, ...], Field(min_length=1)] = (1.0,)
    """Values of a service, one of which is drawn uniformly each time; the provider knows it before
    it serves."""
    admission: Admission | None = None
    """Admission control: `threshold`, `rounds`; None cuts no agent off."""
    rewards: Rewards = Rewards()
    """Weights in the rewards of honest agents."""
    max_cycles: Annotated[int, Field(ge=1, le=1_000_000)] = 120
    """Length of the game, in rounds; the longest with a `continuation` below 1."""
    continuation: Factor = 1.0
    """Probability that the game goes on after a round, up to `max_cycles`; no agent knows when it
    ends."""
    period_s: PositiveAmount = 0.5
    """Length of a round, in seconds."""
    lam: Lam = 0.5
    """Weight of the newest round in every trust."""
    initial_trust: Share = 0.5
    """Trust of every agent before any rating."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not any(self._somebody_rates(round) for round in range(self.max_cycles)):
            roles = (
                ", ".join(f"{g.count} {' then '.join(g.turns) or g.role}" for g in self.agents)
                or "none at all"
            )
            raise ValueError(
                f"agents: {roles}; no agent can rate another. In some round there must be a rater "
                "(SR or SR+SP) "
                "and another agent that provides (SP or SR+SP)"
            )
        providers = sum(group.count for group in self.agents if group.role != "SR")
        if isinstance(self.access, Choice) and self.access.providers > providers:
            raise ValueError(
                f"access.providers is {self.access.providers}; there are only {providers} providers"
            )
        others = self._providers_to_meet()
        if isinstance(self.access, Encounters) and self.access.providers > others:
            raise ValueError(
                f"access.providers is {self.access.providers}; a rater can meet only {others} "
                "providers"
            )
        if self.frames == "" or (isinstance(self.frames, int) and not 0 <= self.frames < 2**31):
            raise ValueError(
                f"frames is {self.frames!r}; it must be a path, or a camera number from 0 on"
            )
        if self.frames is not None and self.service != "hog":
            raise ValueError(f"frames are for the service 'hog', not {self.service!r}")
        if self.service != "synthetic" and any(group.subjective for group in self.agents):
            raise ValueError(
                f"raters' bias and scale are for the service 'synthetic', not {self.service!r}"
            )
        if self.playback == "loop" and not isinstance(self.frames, str):
            raise ValueError(
                f"playback is 'loop', for a video or a folder of images; frames is {self.frames!r}"
            )
        return self

    @property
    def round_weights(self) -> npt.NDArray[np.float64]:
        """Weights of the rounds, shape (max_cycles,): the probability `continuation`^t that round t
        is played.

        Games that measure or search last `max_cycles` rounds, and a round counts by its weight.
        This is the expectation over the length of the game, without the noise of lengths that are
        drawn.
        """
        return np.power(self.continuation, np.arange(self.max_cycles))

    @property
    def mean_length(self) -> float:
        """Mean number of rounds, the sum of the weights of the rounds."""
        return float(self.round_weights.sum())

    def _providers_to_meet(self) -> int:
        """Return the number of providers that every rater can meet, with identities in reserve;
        nobody meets itself.
        """
        providers = sum(
            group.count * (1 + group.reserve) for group in self.agents if group.role != "SR"
        )
        return providers - any(group.role == "SR+SP" for group in self.agents)

    def _somebody_rates(self, round: int) -> bool:
        """Return whether, in a round, one agent can rate and another one can provide."""
        present = [
            g for g in self.agents if g.joins <= round and (g.leaves is None or round < g.leaves)
        ]
        playing = [(group.role_in(round), group.count) for group in present]
        raters = sum(count for role, count in playing if role != "SP")
        providers = sum(count for role, count in playing if role != "SR")
        both = sum(count for role, count in playing if role == "SR+SP")
        return raters > 0 and providers > 0 and not raters == providers == both == 1

    def change(self, /, **changes: Any) -> "Scenario":
        """Return a copy of the scenario with other values of some fields, validated anew.

        Args:
            **changes: Fields of the scenario, and `noise`, which replaces the perception noise of
                every group.

        Raises:
            ValueError: A field does not exist or a value is not allowed.
        """
        source, noise = f"scenario {self.name!r}", changes.pop("noise", None)
        changed = read_scenario({**self.model_dump(), **changes}, source)
        if noise is None:
            return changed
        agents = [{**group.model_dump(), "noise": noise} for group in changed.agents]
        return read_scenario({**changed.model_dump(), "agents": agents}, source)


give_hints(
    Scenario,
    {
        "agents": [AgentGroup],
        "access": [Everyone, InRange, Choice, Encounters],
        "ratings": [RatingDelivery],
        "perturbations": [Perturbation],
        "admission": [Admission],
        "rewards": [Rewards],
    },
)


def read_scenario(data: Mapping[str, Any], source: str) -> Scenario:
    """Return the scenario described by plain data.

    Args:
        data: Fields of `Scenario`, nested as in a TOML file.
        source: Source of the data, for error messages.

    Raises:
        ValueError: Some fields are wrong. The message gives each of them with its value and the
            values allowed.
    """
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        raise ValueError(f"{source}: {validation_message(error)}") from None


def load_scenario(path: str | Path) -> Scenario:
    """Read a scenario from a TOML or YAML file.

    Raises:
        ValueError: The file cannot be read, is neither TOML nor YAML, or holds no valid scenario.
    """
    check_instance("path", path, str | Path, "the path of a TOML or YAML file")
    path = Path(path)
    readers: dict[str, Callable[[str], Any]] = {
        ".toml": tomllib.loads,
        ".yaml": _parse_yaml,
        ".yml": _parse_yaml,
    }
    if path.suffix not in readers:
        raise ValueError(f"scenario file {path}: the name must end in one of {', '.join(readers)}")
    try:
        data = readers[path.suffix](path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"scenario file {path} cannot be read: {error.strerror}") from None
    except RecursionError:
        raise ValueError(f"scenario file {path} is broken: it is nested too deeply") from None
    except ValueError as error:  # raised by the parsers, and for invalid UTF-8
        reason = " ".join(str(error).split())
        raise ValueError(f"scenario file {path} is broken: {reason}") from None
    if not isinstance(data, dict):
        raise ValueError(
            f"scenario file {path} holds a {type(data).__name__}; it must hold fields with values"
        )
    return read_scenario({"name": path.stem, **data}, f"scenario file {path}")


def _parse_yaml(text: str) -> Any:
    try:
        import yaml
    except ImportError:
        raise ValueError(
            "YAML needs PyYAML: pip install 'roletrust-env[cli]'; TOML needs no package"
        ) from None

    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from None
