"""Card of a saved attacker: all data except its weights, validated when it is read."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from roletrust_agents.learned.deep_set import DeepSetArchitecture
from roletrust_agents.learned.network import Architecture
from roletrust_env.game.attack_task import Consumers, Knowledge, Objective
from roletrust_env.game.views import AgentView, ProviderView, RaterView
from roletrust_env.storage.untrusted import UntrustedModel
from roletrust_env.trust import TrustModel, make_trust_model
from roletrust_env.world.group import Role
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario

_MAX_AGENTS = 10_000

Text = Annotated[str, Field(max_length=1000)]
Count = Annotated[int, Field(ge=0, le=10**12)]
Number = Annotated[float, Field(ge=-1e6, le=1e6)]
Positive = Annotated[float, Field(ge=1e-12, le=1e6)]
Plain = bool | int | float | Text
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]{1,100}$")]


class ModelCard(UntrustedModel):
    """Trust model, given by its name and its parameters."""

    name: Name
    parameters: Annotated[dict[Name, Plain], Field(max_length=100, default_factory=dict)]

    def make(self) -> TrustModel[Any]:
        """Return the trust model. If it is of another package, that package must be installed."""
        return make_trust_model(self.name, **self.parameters)


class Price(UntrustedModel):
    """Price of a trust gap to the honest agents, see `roletrust_env.game.attack_task.Stealth`."""

    weight: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    tolerance: Annotated[float, Field(ge=0, le=1)] = 0.1


class TaskCard(UntrustedModel):
    """Task that the attacker was trained for."""

    id: Text
    """Id of the Gymnasium task with the defaults; or `SUITE:SETTING`."""
    compromised: Annotated[tuple[Name, ...], Field(min_length=1, max_length=1000)]
    objective: Objective
    stealth: Price = Price()
    knowledge: Knowledge = "black_box"
    accomplices: Annotated[tuple[Name, ...], Field(max_length=1000)] = ()
    consumers: Consumers = "public"


class InputField(UntrustedModel):
    """Field of the observation, such as `sp_2.trust`, and the number of its entries."""

    name: Annotated[str, Field(max_length=200)]
    size: Annotated[int, Field(ge=0, le=100_000)]


class InputCard(UntrustedModel):
    """Observation: its fields in order, and its normalisation."""

    fields: Annotated[tuple[InputField, ...], Field(max_length=20_000)]
    mean: Annotated[tuple[Number, ...], Field(max_length=100_000)]
    variance: Annotated[tuple[Positive, ...], Field(max_length=100_000)]


class TrainingCard(UntrustedModel):
    """Training of the attacker."""

    algorithm: Annotated[str, Field(max_length=100)]
    steps: Count
    """Number of rounds of experience, in all games together."""
    rounds: Count = 0
    """Number of all rounds played, including those for the normalisation of observations and for
    model selection."""
    seed: Count
    seconds: Annotated[float, Field(ge=0, le=1e9)]
    settings: Annotated[dict[Name, Plain], Field(max_length=100, default_factory=dict)]
    versions: Annotated[dict[Name, Text], Field(max_length=100, default_factory=dict)]


class ScoreCard(UntrustedModel):
    """Mean reward per round in games that were not used for training, and half its 95% confidence
    interval.
    """

    mean: Number
    half_95: Annotated[float, Field(ge=0, le=1e6)]
    games: Annotated[int, Field(ge=1, le=10**9)]
    seed: Count
    honest: Number
    """Mean reward of honest play in the same games."""


class Card(UntrustedModel):
    """All data of a saved attacker except its weights."""

    format: Literal["roletrust-attacker"] = "roletrust-attacker"
    format_version: Literal[1] = 1
    package_version: Annotated[str, Field(max_length=100)]
    task: TaskCard
    trust_model: ModelCard
    further_models: Annotated[tuple[ModelCard, ...], Field(max_length=100)] = ()
    """Further trust models that it was trained against in turn."""
    scenario: Scenario
    observation: InputCard | None = None
    """Observation of a network; a deep set has the features of its architecture."""
    architecture: Architecture | DeepSetArchitecture
    training: TrainingCard
    score: ScoreCard
    weights_sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]

    @model_validator(mode="after")
    def _check(self) -> Self:
        if sum(group.count for group in self.scenario.agents) > _MAX_AGENTS:
            raise ValueError(f"the scenario has more than {_MAX_AGENTS} agents")
        roster, task = Roster.of(self.scenario), self.task
        for names, known in (
            (task.compromised, roster.names),
            (task.accomplices, roster.provider_names),
        ):
            if len(set(names)) < len(names) or not set(names) <= set(known):
                raise ValueError(f"{', '.join(names)} must be different agents of the scenario")
        if isinstance(self.architecture, DeepSetArchitecture):
            if self.observation is not None or task.knowledge != "black_box":
                raise ValueError(
                    "a deep set has black_box knowledge, and no observation besides its features"
                )
        elif self.observation is None:
            raise ValueError("the observation of the network is missing")
        else:
            self._check_network(self.architecture, self.observation)
        return self

    def _check_network(self, architecture: Architecture, observation: InputCard) -> None:
        roster, task = Roster.of(self.scenario), self.task
        total = sum(field.size for field in observation.fields)
        if observation.fields != observation_fields(
            self.scenario, task.compromised, task.knowledge, total
        ):
            raise ValueError("the fields of the observation are not those of the task")
        if not total == len(observation.mean) == len(observation.variance) == architecture.inputs:
            raise ValueError(
                "the observation, its normalisation and the network's inputs differ in size"
            )
        providing = sum(name in roster.provider_names for name in task.compromised)
        rating = sum(name in roster.rater_names for name in task.compromised)
        if architecture.outputs != providing + roster.n_providers * rating:
            raise ValueError(
                "the number of outputs of the network must be that of the actions of the agents"
            )


def observation_fields(
    scenario: Scenario, compromised: Sequence[str], knowledge: Knowledge, total: int
) -> tuple[InputField, ...]:
    """Return the fields of the observation of an attacker in order, see `AttackTask.observe`.

    Args:
        scenario: Scenario of the task.
        compromised: Names of the compromised agents.
        knowledge: Knowledge of the attacker.
        total: Number of entries of the whole observation.
    """
    roster = Roster.of(scenario)
    s, p = roster.n_raters, roster.n_providers
    provider = [(name, s if name in ("ratings", "rated") else 1) for name in ProviderView._fields]
    rater = [(name, 1 if name in ("round", "trust") else p) for name in RaterView._fields]
    both = [("trust", 1)]
    for part, fields in zip(AgentView._fields[1:], (provider, rater), strict=True):
        both += [(f"{part}.{name}", size) for name, size in fields]
    by_role: dict[Role, list[tuple[str, int]]] = {"SP": provider, "SR": rater, "SR+SP": both}
    sizes = [
        (f"{agent}.{name}", size)
        for agent in compromised
        for name, size in by_role[roster.role(agent)]
    ]
    if knowledge != "black_box":
        sizes += [("published.raters", s), ("published.providers", p)]
    if knowledge == "white_box":
        sizes.append(("state", max(0, total - sum(size for _, size in sizes))))
    return tuple(InputField(name=name, size=size) for name, size in sizes)
