"""The settings of the learners, tuned per task."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from roletrust_env.errors import explain

Algo = Literal["ppo", "sac", "recurrent-ppo"]
Natural = Annotated[int, Field(ge=1, le=10_000_000)]
Rate = Annotated[float, Field(gt=0, le=1)]
Discount = Annotated[float, Field(ge=0, le=1)]
LogStd = Annotated[float, Field(ge=-10, le=2)]


class _Settings(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    steps: Natural
    """Rounds to train for, of all games together, unless `--steps` says otherwise."""
    games: Natural
    """Games that are played as one batch."""
    gamma: Discount = 0.95
    learning_rate: Rate = 1e-3
    """At first; it falls to 0 in a straight line."""
    batch_size: Natural
    hidden: Annotated[tuple[Natural, ...], Field(min_length=1, max_length=8)] = (64, 64)
    """Units of each hidden layer."""


class OnPolicySettings(_Settings):
    """Of PPO of either kind: many games, short rollouts, and a spread of the actions that starts narrow."""

    n_steps: Natural = 25
    """Rounds of each game between two updates."""
    n_epochs: Natural = 10
    gae_lambda: Discount = 0.95
    clip_range: Rate = 0.2
    ent_coef: Annotated[float, Field(ge=0, le=1)] = 0.0
    log_std_init: LogStd = -0.5
    log_std_last: LogStd | None = None
    """Below which the spread has to be at last: its logarithm's limit falls in a straight line. None is no limit."""


class PPOSettings(OnPolicySettings):
    """Of PPO."""

    steps: Natural = 800_000
    games: Natural = 256
    batch_size: Natural = 1600
    heads: Annotated[tuple[Natural, ...], Field(max_length=8)] = ()
    """Units of each hidden layer of small networks in the actor's place, see `roletrust_experiments.training.heads`."""


class RecurrentPPOSettings(OnPolicySettings):
    """Of PPO with an LSTM, which also minds what it no longer sees."""

    steps: Natural = 400_000
    games: Natural = 128
    batch_size: Natural = 800
    n_epochs: Natural = 5
    lstm: Natural = 32
    """Units of the LSTM."""


class SACSettings(_Settings):
    """Of soft actor-critic, which learns from fewer rounds, each at a higher price."""

    steps: Natural = 100_000
    games: Natural = 16
    batch_size: Natural = 256
    gradient_steps: Natural = 4
    """Updates for each round of all games."""
    buffer_size: Natural = 100_000
    learning_starts: Natural = 5_000


Settings = PPOSettings | RecurrentPPOSettings | SACSettings
_KINDS: dict[str, type[Settings]] = {"ppo": PPOSettings, "sac": SACSettings, "recurrent-ppo": RecurrentPPOSettings}

TUNED: dict[tuple[str, str], dict[str, Any]] = {
    # Many actions at once: shared heads, longer, in fewer passes over each rollout, each of which may change more, and
    # with an eye on the next ten rounds only. A lie is worth most where it is exact, so the spread must go. With the
    # games that choose the best on the way it plays just under two million rounds, the budget of a ladder.
    ("RoleTrust/CollusionAttack-v0", "ppo"): {
        "steps": 1_900_000,
        "gamma": 0.9,
        "n_epochs": 5,
        "learning_rate": 0.0015,
        "clip_range": 0.4,
        "log_std_last": -4.0,
        "heads": (32, 32),
    },
}
"""Settings other than the algorithm's own, by task and algorithm."""


def make_settings(task_id: str, algo: Algo, changes: Mapping[str, Any]) -> Settings:
    """The settings for a task, with some changed.

    Raises:
        ValueError: a setting does not exist or its value is not allowed.
    """
    try:
        return _KINDS[algo].model_validate({**TUNED.get((task_id, algo), {}), **changes})
    except ValidationError as error:
        known = ", ".join(_KINDS[algo].model_fields)
        raise ValueError(f"--learner of {algo}: {explain(error)}; there are {known}") from None
