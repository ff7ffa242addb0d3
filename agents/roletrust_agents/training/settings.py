"""Settings of the learners, tuned per task."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from roletrust_agents.learned.deep_set import UNITS
from roletrust_env.errors import suggest, validation_message
from roletrust_env.parameters import plain

Algo = Literal["ppo", "sac", "recurrent-ppo", "evolution", "evolution-strategy", "coalition-ppo"]
Start = Literal["universal", "alike", "random"]
Natural = Annotated[int, Field(ge=1, le=10_000_000)]
Rate = Annotated[float, Field(gt=0, le=1)]
Discount = Annotated[float, Field(ge=0, le=1)]
LogStd = Annotated[float, Field(ge=-10, le=2)]


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)


class _Settings(_Frozen):
    steps: Natural
    """Number of rounds to train for, over all games, unless `--steps` is given."""
    games: Natural
    """Number of games in a batch."""
    gamma: Discount = 0.95
    learning_rate: Rate = 1e-3
    """Initial learning rate; it falls linearly to 0."""
    batch_size: Natural
    hidden: Annotated[tuple[Natural, ...], Field(min_length=1, max_length=8)] = (64, 64)
    """Number of units in each hidden layer."""


class OnPolicySettings(_Settings):
    """Settings that PPO with and without an LSTM share: many games, short rollouts, and a narrow
    spread of actions.
    """

    n_steps: Natural = 25
    """Number of rounds of each game between two updates."""
    n_epochs: Natural = 10
    gae_lambda: Discount = 0.95
    clip_range: Rate = 0.2
    ent_coef: Annotated[float, Field(ge=0, le=1)] = 0.0
    log_std_init: LogStd = -0.5
    log_std_last: LogStd | None = None
    """Upper limit of the logarithm of the spread at the end, reached linearly; None is no limit."""


class PPOSettings(OnPolicySettings):
    """Settings of PPO."""

    steps: Natural = 800_000
    games: Natural = 256
    batch_size: Natural = 1600
    heads: Annotated[tuple[Natural, ...], Field(max_length=8)] = ()
    """Number of units in each hidden layer of the actor's heads, see
    `roletrust_agents.training.heads`."""


class RecurrentPPOSettings(OnPolicySettings):
    """Settings of PPO with an LSTM, which remembers earlier observations."""

    steps: Natural = 400_000
    games: Natural = 128
    batch_size: Natural = 800
    n_epochs: Natural = 5
    lstm: Natural = 32
    """Number of units of the LSTM."""


class SACSettings(_Settings):
    """Settings of soft actor-critic, which learns from fewer rounds and spends more time on
    each.
    """

    steps: Natural = 100_000
    games: Natural = 16
    batch_size: Natural = 256
    gradient_steps: Natural = 4
    """Number of updates for each round of all games."""
    buffer_size: Natural = 100_000
    learning_starts: Natural = 5_000


class CoalitionSettings(_Frozen, ABC):
    """Settings of trainings of a coalition, see `roletrust_agents.training.coalition_training`."""

    steps: Natural
    """Number of rounds to play, over all games, unless `--steps` is given."""
    games: Natural
    """Number of games of a step, of evolution for each candidate."""
    units: Annotated[int, Field(ge=1, le=256)] = UNITS
    """Number of units of each layer of the network."""
    wide: bool = True
    """Whether the network also decides on silence, and on the treatment of each rater."""
    start: Start = "universal"
    """Networks to start from: the universal coalitions, or those of them that serve all raters
    alike, and random networks; or only the latter."""
    candidates: Natural = 64
    """Number of random networks of which the best is the start, as far as a tenth of the rounds
    allows."""
    validation: Natural = 64
    """Number of games that choose the best network."""
    validate_every: Natural = 10
    """Number of steps, such as generations, between two validations."""

    @property
    @abstractmethod
    def step_games(self) -> int:
        """Number of games of a step with one task."""


class EvolutionSettings(CoalitionSettings):
    """Settings of the evolution of a coalition, see `roletrust_agents.training.evolution`."""

    steps: Natural = 1_000_000
    games: Natural = 8
    population: Annotated[int, Field(ge=4, le=10_000)] = 32
    """Number of candidates in a generation."""
    spread: Annotated[float, Field(gt=0, le=100)] = 0.3
    """Standard deviation of the first generation."""
    starts: Natural = 4
    """Number of networks that begin; in the first part of the rounds, the worse half is dropped
    again and again."""

    @property
    def step_games(self) -> int:
        """See `CoalitionSettings.step_games`."""
        return self.population * self.games


class StrategySettings(CoalitionSettings):
    """Settings of an evolution strategy, see `roletrust_agents.training.evolution_strategy`."""

    steps: Natural = 400_000
    games: Natural = 4
    pairs: Annotated[int, Field(ge=2, le=5_000)] = 8
    """Number of pairs of candidates of a step."""
    spread: Annotated[float, Field(gt=0, le=100)] = 0.1
    """Standard deviation of the candidates in each weight."""
    learning_rate: Rate = 0.05
    """Initial learning rate of Adam; it falls linearly to a tenth."""

    @property
    def step_games(self) -> int:
        """See `CoalitionSettings.step_games`."""
        return 2 * self.pairs * self.games


class CoalitionPPOSettings(CoalitionSettings):
    """Settings of PPO for a coalition, see `roletrust_agents.training.coalition_ppo`."""

    steps: Natural = 100_000
    games: Natural = 32
    """Number of games of a rollout."""
    candidates: Annotated[int, Field(ge=1, le=1)] = 1
    """Number of random networks to start from: the policy draws its own."""
    validate_every: Natural = 15
    learning_rate: Rate | None = None
    """Initial learning rate, which falls linearly to a tenth; None is 0.003 for a universal
    coalition and 0.01 for a random network, because a good start is easily lost."""
    gamma: Discount = 0.95
    gae_lambda: Discount = 0.95
    n_epochs: Natural = 5
    clip_range: Rate = 0.3
    spread: Annotated[float, Field(gt=0, le=10)] | None = None
    """Initial standard deviation of the actions, which lie in [-1, 1]; None is 0.2 for a universal
    coalition and 0.5 for a random network."""

    @property
    def step_games(self) -> int:
        """See `CoalitionSettings.step_games`."""
        return self.games

    @property
    def first_rate(self) -> float:
        """Initial learning rate."""
        return self.learning_rate or (0.01 if self.start == "random" else 0.003)

    @property
    def first_spread(self) -> float:
        """Initial standard deviation of the actions."""
        return self.spread or (0.5 if self.start == "random" else 0.2)


CoalitionSettingsT = TypeVar("CoalitionSettingsT", bound=CoalitionSettings)
LearnerSettings = PPOSettings | RecurrentPPOSettings | SACSettings
Settings = LearnerSettings | EvolutionSettings | StrategySettings | CoalitionPPOSettings
_KINDS: dict[str, type[Settings]] = {
    "ppo": PPOSettings,
    "sac": SACSettings,
    "recurrent-ppo": RecurrentPPOSettings,
    "evolution": EvolutionSettings,
    "evolution-strategy": StrategySettings,
    "coalition-ppo": CoalitionPPOSettings,
}

TUNED: dict[tuple[str, str], dict[str, Any]] = {
    # Many actions at once need shared heads and longer training, with fewer and larger passes over
    # each rollout and a horizon of about ten rounds. An exact lie is worth most, so the spread must
    # fall. Together with the games that choose the best network, training plays just under two
    # million rounds, the budget of a ladder.
    ("RoleTrust/CollusionAttack-v0", "ppo"): {
        "steps": 1_900_000,
        "gamma": 0.9,
        "n_epochs": 5,
        "learning_rate": 0.0015,
        "clip_range": 0.4,
        "log_std_last": -4.0,
        "heads": (32, 32),
    }
}
"""Settings that differ from the algorithm's defaults, by task and algorithm."""

WORLDS = {"games": 2, "candidates": 16, "validation": 8}
"""The same in a setting of a suite, whose worlds share the games."""

OF_WORLDS: tuple[Algo, ...] = ("evolution", "evolution-strategy")
"""Algorithms that train in several worlds."""


SettingsT = TypeVar("SettingsT", bound=BaseModel)


def checked_settings(kind: type[SettingsT], name: str, fields: Mapping[str, Any]) -> SettingsT:
    """Return settings of a kind.

    Args:
        kind: Class of the settings.
        name: Name of the learner or search method, for errors.
        fields: Fields of the settings.

    Raises:
        ValueError: A value is not allowed.
    """
    try:
        return kind.model_validate(plain(dict(fields)))
    except ValidationError as error:
        raise ValueError(f"{name}: {validation_message(error)}") from None


def settings_of(kind: type[SettingsT], method: Any) -> SettingsT:
    """Return the settings of a training from the fields of a search method that have the same
    names.

    Args:
        kind: Class of the settings.
        method: Search method with a `name`.

    Raises:
        ValueError: A value is not allowed.
    """
    fields = {name: getattr(method, name) for name in kind.model_fields if hasattr(method, name)}
    return checked_settings(kind, method.name, fields)


def learner_settings(task_id: str, algo: Algo, changes: Mapping[str, Any]) -> LearnerSettings:
    """Return the settings of a learner of Stable-Baselines3. Arguments and errors as for
    `make_settings`.
    """
    settings = make_settings(task_id, algo, changes)
    if isinstance(settings, CoalitionSettings):
        raise ValueError(f"{algo} is no learner of Stable-Baselines3")
    return settings


def make_settings(task_id: str, algo: Algo, changes: Mapping[str, Any]) -> Settings:
    """Return the settings for a task, with some of them changed.

    Raises:
        ValueError: A setting does not exist, or its value is not allowed.
    """
    known = _KINDS[algo].model_fields
    for name in changes:
        if name not in known:
            raise ValueError(f"--learner: {algo} has no setting {name!r}{suggest(name, known)}")
    usual = WORLDS if ":" in task_id else TUNED.get((task_id, algo), {})
    return checked_settings(_KINDS[algo], f"--learner of {algo}", {**usual, **changes})
